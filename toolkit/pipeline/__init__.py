"""A tracker run over recordings: progress, timing, interruption, resuming and the run folder."""

from toolkit.pipeline.batch import run_folders, track_recordings
from toolkit.pipeline.run import Progress, track_recording
from toolkit.pipeline.summary import BatchReport, RunSummary
from toolkit.pipeline.trackers import load_tracker

__all__ = [
    "BatchReport",
    "Progress",
    "RunSummary",
    "load_tracker",
    "run_folders",
    "track_recording",
    "track_recordings",
]
