"""Summary of a finished or interrupted run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.io.errors import PlausibilityWarning
from toolkit.people.plausibility import HELP
from toolkit.tracks import EMPTY, LOST, STATE_NAMES, TRACKED, Track

LOW_ADVICE = (
    "check the film of `depthmocap render`; --intrinsics, --depth-unit, --up or --segment may be wrong; a --database "
    "of such motions, or the person's own --body, may help"
)


@dataclass(frozen=True)
class RunSummary:
    """Summary of one tracked recording.

    Attributes
    ----------
    name : name of the recording
    run : its run folder
    frames, recorded_frames : rows of the track and frames of the recording
    stage_ms, frame_ms : median milliseconds of each stage, and of a frame, of all people together, where there
        was something to do
    states : number of tracked, lost and empty frames by `STATE_NAMES`, summed over people
    people : number of tracked people
    confidence : mean over the observed joints in tracked frames of all people; NaN without any
    unfinished : the second pass was stopped, and all rows are those of the first
    stature : stature of the fitted body in metres, for a single person
    """

    name: str
    run: Path
    frames: int
    recorded_frames: int
    stage_ms: dict[str, float]
    frame_ms: float
    states: dict[str, int]
    people: int = 1
    confidence: float = float("nan")
    unfinished: bool = False
    stature: float | None = None

    @property
    def interrupted(self) -> bool:
        """Return whether the run stopped before the last frame, so that `resume` continues it."""
        return self.unfinished or self.frames < self.recorded_frames

    def text(self) -> str:
        """Return the summary as one line."""
        stages = ", ".join(f"{name} {ms:.1f}" for name, ms in self.stage_ms.items())
        count = f"{self.frames} of {self.recorded_frames}" if self.interrupted else f"{self.frames}"
        states = ", ".join(f"{count} {name}" for name, count in self.states.items() if count)
        people = "" if self.people == 1 else f" of {self.people} people"
        hint = "; continue with --resume" if self.interrupted else ""
        sure = f", confidence {self.confidence:.2f}" if self.states["tracked"] else ""
        sure += f", {self.stature:.2f} m tall" if self.states["tracked"] and self.stature is not None else ""
        spent = f", {self.frame_ms:.1f} ms a frame ({stages})" if self.stage_ms else ""
        return f"{self.run}: {count} frames{people}: {states or 'no person seen'}{sure}{spent}{hint}"


def track_warnings(summary: RunSummary, statures: Sequence[float]) -> list[PlausibilityWarning]:
    """Return the reasons to doubt a track: nothing is tracked, its confidence is low, a body has no person's size.

    Parameters
    ----------
    statures : metres, of the fitted bodies
    """
    texts = []
    # Minimum mean confidence of the observed joints; below it the body often does not fit the depth.
    low_confidence = 0.4
    if not summary.states["tracked"]:
        texts.append(
            "no person was tracked; `depthmocap info` shows what the recording holds, and --segment, --depth-unit, "
            "--rotate or --up may help"
        )
    elif summary.confidence < low_confidence:
        texts.append(f"the mean confidence is {summary.confidence:.2f}; {LOW_ADVICE}")
    # Metres: a child of two years, and the tallest man in 2,000; fitted bodies beyond are mostly wrong units or
    # lenses.
    stature_range = (0.95, 2.1)
    low, high = stature_range
    odd = [f"{stature:.2f}" for stature in statures if not low <= stature <= high] if not texts else []
    if odd:
        texts.append(f"a fitted body is {' and '.join(odd)} m tall; check --intrinsics and --depth-unit")
    return [PlausibilityWarning(f"{summary.name}: {text}; {HELP}") for text in texts]


def summarised(
    name: str,
    run: Path,
    tracks: Sequence[Track],
    recorded_frames: int,
    *,
    unfinished: bool = False,
    stature: float | None = None,
) -> RunSummary:
    """Return the summary of a recording from the tracks of its people."""
    stage_ms: dict[str, float] = {}
    states = dict.fromkeys(STATE_NAMES, 0)
    for track in tracks:
        busy = track.stage_ms[track.stage_ms.any(axis=1)]
        medians = np.median(busy, axis=0) if len(busy) else np.zeros(len(track.stage_names))
        for stage, milliseconds in zip(track.stage_names, map(float, medians), strict=True):
            stage_ms[stage] = stage_ms.get(stage, 0.0) + milliseconds
        for state in (TRACKED, LOST, EMPTY):
            states[STATE_NAMES[state]] += int((track.state == state).sum())
    frames = len(tracks[0]) if tracks else recorded_frames
    each = sum((track.stage_ms.sum(axis=1) for track in tracks), np.zeros(frames if tracks else 0))
    frame_ms = float(np.median(each[each > 0])) if each.any() else 0.0
    people, sure = len(tracks), confidence_of(tracks)
    return RunSummary(name, run, frames, recorded_frames, stage_ms, frame_ms, states, people, sure, unfinished, stature)


def confidence_of(tracks: Sequence[Track]) -> float:
    """Return the mean confidence of the observed joints in tracked frames, NaN without any."""
    sure = [track.confidence[(track.state == TRACKED)[:, None] & track.observed] for track in tracks]
    values = np.concatenate(sure) if sure else np.zeros(0)
    return float(values.mean()) if len(values) else float("nan")
