"""Runs of several people: their tracks, their times, and frames with skeletons and true joints drawn on the depth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from toolkit.rendering import style
from toolkit.rendering.overlay import color_depth, draw_points, draw_skeleton
from toolkit.runs import person_runs
from toolkit.sensing.recording import Recording
from toolkit.track import EMPTY, TRACK_FILE, TRACKED, Track

WIDTH, HEIGHT = 640, 480
"""Pixels of a picture, filled as far as the recording's proportions allow."""
TRUTH = (255, 0, 160)


def frame_picture(
    recording: Recording, frame: int, tracks: Sequence[Track], pixels: np.ndarray, title: str
) -> np.ndarray:
    """One frame as uint8 (HEIGHT, WIDTH, 3): everybody who is there, and true joints at image `pixels` (N, 2)."""
    import cv2

    depth = recording.depth(frame)
    factor = min(WIDTH / recording.camera.width, HEIGHT / recording.camera.height)
    measured = depth[depth > 0] / 1000.0
    near, far = np.percentile(measured, [1, 99]) if measured.size else (1.0, 4.0)
    colored = color_depth(depth, np.ones(depth.shape, dtype=bool), float(near), float(far))
    shown = cv2.resize(colored, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    picture = np.full((HEIGHT, WIDTH, 3), style.PAPER, dtype=np.uint8)
    picture[: shown.shape[0], : shown.shape[1]] = shown
    camera = recording.camera.scaled(factor)
    for track in tracks:
        if frame < len(track) and track.state[frame] != EMPTY:
            draw_skeleton(picture, camera.project(track.joints[frame]), track.observed[frame])
    for shift in np.ndindex(3, 3):
        draw_points(picture, factor * pixels.reshape(-1, 2) + shift, TRUTH)
    style.write(picture, title, 6, 4)
    return picture


def tracks_of(run: Path) -> list[Track]:
    """The tracks of everybody in a run; none where it holds none."""
    return [Track.load(person) for person in person_runs(run) if (person / TRACK_FILE).exists()]


def frame_times(recordings: Sequence[Sequence[Track]]) -> dict[int, float]:
    """Milliseconds, median over the frames in which so many people are tracked, without reading them, by their number.

    Frames are those of recordings with the tracks of everybody in them.
    """
    times: dict[int, list[float]] = {}
    for tracks in recordings:
        for frame in range(max(map(len, tracks), default=0)):
            there = [track for track in tracks if frame < len(track)]
            count = sum(bool(track.state[frame] == TRACKED) for track in there)
            times.setdefault(count, []).append(sum(float(track.stage_ms[frame].sum()) for track in there))
    return {count: float(np.median(times[count])) for count in sorted(times) if count}
