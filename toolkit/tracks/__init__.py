"""Tracks: their type and their files in a run folder.

A run folder holds `track.npz` (exactly one row per tracked frame), `run.json`, `config.yaml` and `log.txt`.
May import `recordings`, `people`, `sensing`, `body` and packages below.
"""

from toolkit.tracks.run_info import RUN_FILE, RunInfo
from toolkit.tracks.track import EMPTY, LOST, PARTIAL_FILE, STATE_NAMES, TRACK_FILE, TRACKED, FrameResult, Track
from toolkit.tracks.track_writer import TrackWriter

__all__ = [
    "EMPTY",
    "LOST",
    "PARTIAL_FILE",
    "RUN_FILE",
    "STATE_NAMES",
    "TRACKED",
    "TRACK_FILE",
    "FrameResult",
    "RunInfo",
    "Track",
    "TrackWriter",
]
