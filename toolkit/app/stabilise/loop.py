"""The loop of Fig. 6.1 of the thesis: label a track, predict its occluded limbs, track again, select."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from toolkit.app.stabilise.demands import marked_terms
from toolkit.app.stabilise.retrack import GapGuide, Retracked, retrack
from toolkit.app.stabilise.source_run import SourceRun
from toolkit.io.errors import SettingsError
from toolkit.io.progress import Progress, silent
from toolkit.io.spans import spans
from toolkit.kernels import linear
from toolkit.motion.contact import foot_contacts
from toolkit.retrieval.annotation.annotator import Annotation, Annotator, MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLES
from toolkit.retrieval.annotation.measures import Segment, frame_scores, label_frames
from toolkit.retrieval.features.motion import frame_rate_of, from_poses
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.priors.allocation import allocate, unknown_rows
from toolkit.retrieval.priors.expectation import GapContext
from toolkit.retrieval.priors.gap_trajectories import (
    KEPT,
    PRIOR_SPREAD,
    WIDENED,
    GapWays,
    bad_frames,
    cheapest_path,
    flags_of,
    ways_through,
    whole_priors,
)
from toolkit.retrieval.priors.gaps import Gap, find_gaps
from toolkit.retrieval.priors.limb_entries import OUTER
from toolkit.retrieval.priors.marks import Marks, marks_of_classes, tracking_priors
from toolkit.tracks import Track

SOURCE = "prior"
"""Name of the source in `Track.source_names` for frames with a replaced limb."""
AGREED, MOVED = 0.99, 0.002
"""Fraction of equal labels and mean joint movement in metres at which the loop stops."""
UNLIKELY = 0.00015
"""Cost in metres of one squared standard deviation of one angle. This constant, the next one and the stiffness of the
path were chosen on the tuning split."""
MARGIN = 0.0007
"""Minimum improvement in metres for a candidate to replace the tracked motion."""


@dataclass(frozen=True)
class StabiliseSettings:
    """Settings of the loop of Fig. 6.1.

    Attributes
    ----------
    rounds : maximum number of rounds; five in the thesis
    threshold : costs at or above it are no hits (0.07 in the thesis, for tracks of another kind)
    marks : whether MT priors hold hidden limbs
    """

    rounds: int = 5
    threshold: float = 0.1
    marks: bool = True

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise SettingsError(f"{self.rounds} rounds are impossible; give a whole number from 1 on")
        if not 0.0 < self.threshold <= 1.0:
            raise SettingsError(f"threshold {self.threshold} is not in (0, 1]; try 0.1")


@dataclass(frozen=True, eq=False)
class FilledGap:
    """Result for one gap.

    Attributes
    ----------
    limb, start, stop : the limb and the examined frames; the last one is exclusive
    hidden : bool (D,), in which of them it is hidden
    names : of the ways through it
    angles : float64 (C, D, A), radians, of each way
    path : int64 (D,), the way that was taken in each frame
    changed : mean movement of the limb's outer joints over the gap, metres
    before, after : metres, mean distance of the whole body from its frames
    """

    limb: str
    start: int
    stop: int
    hidden: np.ndarray
    names: tuple[str, ...]
    angles: np.ndarray
    path: np.ndarray
    changed: float
    before: float
    after: float

    @property
    def sources(self) -> dict[str, int]:
        """Selected candidates, each with its number of frames."""
        return {name: int((self.path == k).sum()) for k, name in enumerate(self.names) if (self.path == k).any()}

    @property
    def accepted(self) -> bool:
        """Return whether any frame was replaced."""
        return set(self.sources) != {KEPT}


class LoopInputs(NamedTuple):
    """Inputs of all rounds: the classes, given segments or None, and template entries."""

    classes: tuple[MotionClass, ...]
    segments: Sequence[Segment] | None
    marks: Marks


@dataclass(frozen=True, eq=False)
class Round:
    """Result of one round: its labels, gaps, track and the mean movement of joints.

    Attributes
    ----------
    annotation : of the track before, None where the segments were given
    segments : by which the gaps were filled
    gaps : what became of each
    track : afterwards
    moved : metres, of all joints on average
    priors : int8 (40, T), required feature values of the frames: 0, 1 or `WILDCARD`
    before, after : metres, mean distance of the track from its frames as the round found it and as it left it
    """

    annotation: Annotation | None
    segments: tuple[Segment, ...]
    gaps: tuple[FilledGap, ...]
    track: Track
    moved: float
    priors: np.ndarray
    before: float = 0.0
    after: float = 0.0


def stabilise(
    source: SourceRun,
    classes: Sequence[MotionClass],
    settings: StabiliseSettings | None = None,
    *,
    segments: Sequence[Segment] | None = None,
    marks: Marks | None = None,
    progress: Progress = silent,
) -> list[Round]:
    """Stabilise a track in rounds; the result is the track of `best_round`.

    Parameters
    ----------
    source : the run
    classes : motion classes; classes with motions predict limbs, the others mark repetitions
    segments : labelled stretches in place of those that annotation finds
    marks : MT priors in place of those that the classes have by themselves
    progress : told what is going on

    Raises
    ------
    RetrievalError
        Segments overlap, end after the track, or have an unknown label.
    """
    settings = settings or StabiliseSettings()
    known = LoopInputs(tuple(classes), segments, marks or marks_of_classes(classes))
    track, rounds = source.track, list[Round]()
    for number in range(settings.rounds):
        found = _round(source, track, known, settings, partial(progress, f"round {number + 1}"))
        rounds.append(found)
        track = found.track
        if found.moved == 0.0 or (number and _settled(rounds[-2], found)):
            break
    return rounds


def best_round(rounds: Sequence[Round]) -> Round:
    """Return the last round, or an earlier one with a clearly better fit (thesis 6.6: wrong priors harm)."""
    worst = min(found.after for found in rounds) + MARGIN
    return next(found for found in reversed(rounds) if found.after <= worst)


def _settled(before: Round, after: Round) -> bool:
    labels = sorted({s.label for s in (*before.segments, *after.segments)})
    frames = [label_frames(r.segments, labels, len(r.track), FEATURE_RATE) for r in (before, after)]
    return after.moved < MOVED and (not labels or frame_scores(*frames).f >= AGREED)


def _round(
    source: SourceRun,
    track: Track,
    known: LoopInputs,
    settings: StabiliseSettings,
    progress: Callable[[int, int], None],
) -> Round:
    gaps = find_gaps(track.confidence, source.present)
    told, annotation, labelled = _told(source, track, known, gaps, settings)
    priors = tracking_priors(told.allocation, known.classes, known.marks)
    ways = ways_through(told, gaps) if labelled else []
    if not ways:  # no limb is occluded, or no class covers the gap
        return Round(annotation, labelled, (), track, 0.0, priors)
    bad = bad_frames(told.hidden)
    marked = marked_terms(source, told, priors) if settings.marks else {}
    guide = GapGuide(ways, whole_priors(told, bad), track.timestamps, marked)
    again = retrack(source, track.pose, ways, _around(bad, WIDENED), guide, progress)
    paths = [choose(*of_gap) for of_gap in zip(ways, again.distances, again.angles, strict=True)]
    fresh = _exchanged(source, track, ways, again, paths, _choose_rows(track, again))
    moved = linear.lengths((fresh.joints - track.joints).reshape(-1, 3).astype(np.float64)).reshape(len(track), -1)
    filled = tuple(_filled(*of_gap, moved) for of_gap in zip(ways, paths, again.angles, again.distances, strict=True))
    before, after = _explained(track, again, filled)
    return Round(annotation, labelled, filled, fresh, float(moved.mean()), priors, before, after)


def _explained(track: Track, again: Retracked, filled: Sequence[FilledGap]) -> tuple[float, float]:
    """Return the mean distance of the track from its frames before and after filling, metres."""
    seen = np.isfinite(again.explained)
    before = float(again.explained[seen].mean()) if seen.any() else 0.0
    gained = sum((gap.after - gap.before) * (gap.stop - gap.start) for gap in filled)
    return before, before + gained / max(len(track), 1)


def choose(way: GapWays, distances: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the candidate index (D,) for each frame of a gap: best fit, likely, smooth; the tracked motion unless a
    candidate is better.

    The thesis accepts each prediction (6.6 names the harm of a wrong one); here the measured depth decides.
    """
    spread = way.expected.variance + PRIOR_SPREAD**2
    unlikely = ((angles - way.expected.mean) ** 2 / spread).sum(axis=2)
    costs = distances + UNLIKELY * unlikely
    costs[way.names.index(KEPT)] -= MARGIN
    costs = np.where(np.isfinite(costs), costs, np.where(np.arange(len(costs))[:, None] == 0, 0.0, np.inf))
    return cheapest_path(costs, np.nan_to_num(angles))


def _choose_rows(track: Track, again: Retracked) -> np.ndarray:
    """Return bool (T,): frames whose whole pose is replaced by the second tracking, in contiguous segments."""
    taken = np.zeros(len(track), dtype=np.bool_)
    angles = np.stack([track.pose, np.array([row.pose for row in again.rows])])[:, :, ANGLES]
    for span in spans(np.isfinite(again.whole).all(axis=0)):
        costs = again.whole[:, span].copy()
        costs[0] -= MARGIN
        taken[span] = cheapest_path(costs, angles[:, span]) == 1
    return taken


def _around(flags: np.ndarray, by: int) -> np.ndarray:
    """Return the frames (T,) within `by` frames of a flagged one."""
    wide = np.zeros_like(flags)
    for span in spans(flags):
        wide[max(0, span.start - by) : span.stop + by] = True
    return wide


def _told(
    source: SourceRun, track: Track, known: LoopInputs, gaps: Sequence[Gap], settings: StabiliseSettings
) -> tuple[GapContext, Annotation | None, tuple[Segment, ...]]:
    """Return the context of the gaps: the track, its labels and its occluded limbs."""
    classes, segments = known.classes, known.segments
    rate = frame_rate_of(track.timestamps)
    features = relational_features(from_poses(track.pose, source.body, rate, source.run.name))
    annotation = None
    if segments is None:
        annotation = annotate(features, classes, settings.threshold)
    labelled = tuple(segments if segments is not None else annotation.segments if annotation else ())
    hidden = flags_of(gaps, len(track))
    columns = np.minimum(np.rint(np.arange(len(track)) * FEATURE_RATE / rate).astype(np.int64), len(features) - 1)
    first = np.searchsorted(columns, np.arange(len(features)))
    unknown = unknown_rows({limb: flags[first] for limb, flags in hidden.items()}, len(features))
    allocation = allocate(features, labelled, classes, unknown).at(columns)
    return GapContext(track.pose, track.timestamps, hidden, allocation, classes), annotation, labelled


def annotate(features: FeatureMatrix, classes: Sequence[MotionClass], threshold: float) -> Annotation | None:
    """Label a track without keyframes (thesis 6.3); None for a track shorter than all classes."""
    annotator = Annotator([replace(motion_class, threshold=threshold) for motion_class in classes])
    return annotator.annotate(features) if len(features) >= annotator.shortest else None


def _exchanged(
    source: SourceRun,
    track: Track,
    ways: Sequence[GapWays],
    again: Retracked,
    paths: Sequence[np.ndarray],
    whole: np.ndarray,
) -> Track:
    """Return the track with the selected limbs and whole poses, and with their confidence."""
    poses, confidence, touched = track.pose.copy(), track.confidence.copy(), np.zeros(len(track), dtype=np.bool_)
    for way, angles, trust, path in zip(ways, again.angles, again.confidence, paths, strict=True):
        outer = OUTER[way.gap.limb]
        for place in np.flatnonzero(path != way.names.index(KEPT)):
            frame = way.gap.start + place
            poses[frame, way.entries] = angles[path[place], place]
            confidence[frame, outer] = trust[path[place], place]
            touched[frame] = True
    for frame in np.flatnonzero(whole):
        poses[frame], confidence[frame] = again.rows[frame].pose, again.rows[frame].confidence
    touched |= whole
    joints, at = track.joints.copy(), track.source.copy()
    for frame in np.flatnonzero(touched):
        joints[frame] = linear.rotated(source.body.joint_positions(poses[frame]), source.info.R_level_camera)
    names = track.source_names if SOURCE in track.source_names else (*track.source_names, SOURCE)
    at[touched] = names.index(SOURCE)
    changed = replace(track, joints=joints, pose=poses, confidence=confidence, source=at, source_names=names)
    height = source.info.floor[0] if source.info.floor else None
    return replace(changed, contact=foot_contacts(source.body, changed, height)) if touched.any() else changed


def _filled(way: GapWays, path: np.ndarray, angles: np.ndarray, distances: np.ndarray, moved: np.ndarray) -> FilledGap:
    gap, here = way.gap, np.arange(len(path))
    seen = np.isfinite(distances[0])
    before, after = (float(d[seen].mean()) if seen.any() else 0.0 for d in (distances[0], distances[path, here]))
    changed = float(moved[gap.start : gap.stop, OUTER[gap.limb]].mean())
    return FilledGap(gap.limb, gap.start, gap.stop, way.hidden, way.names, angles, path, changed, before, after)
