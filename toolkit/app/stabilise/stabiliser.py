"""Stabilisation of a track (thesis, Fig. 6.1): label it, predict its occluded limbs, track again, select."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from toolkit.app.stabilise.floor_contact import contact_terms
from toolkit.app.stabilise.retrack import GapGuide, Retracked, retrack
from toolkit.app.stabilise.source_run import SourceRun
from toolkit.body import skeleton
from toolkit.io.errors import SettingsError
from toolkit.io.progress import Progress, silent
from toolkit.kernels import linear
from toolkit.motion.contact import foot_contacts
from toolkit.retrieval.annotation.annotator import Annotation, Annotator, MotionClass
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.priors.allocation import allocate, unknown_rows
from toolkit.retrieval.priors.expectation import GapContext
from toolkit.retrieval.priors.gap_trajectories import (
    KEPT,
    PRIOR_SPREAD,
    GapCandidates,
    cheapest_path,
    gap_candidates,
)
from toolkit.retrieval.priors.gaps import Gap, find_gaps, hidden_flags
from toolkit.sensing.recording import frame_rate_of
from toolkit.tracks import Track

SOURCE = "prior"
"""Entry of `Track.source_names` for frames with an exchanged limb."""
ALIGNMENT_THRESHOLD = 0.1
"""Fraction of differing features from which an alignment with a template is rejected; the thesis has 0.07 for tracks of
another sensor."""


@dataclass(frozen=True, eq=False)
class FilledGap:
    """A gap of D frames with its candidate trajectories and the selected path.

    Attributes
    ----------
    limb, start, stop : limb and frames of the widened gap; `stop` is exclusive
    hidden : bool (D,), frames in which the limb is occluded
    names : names of the C candidates
    path : int64 (D,), selected candidate of each frame
    changed : metres, mean displacement of the limb's outer joints over the gap
    before, after : metres, mean distance of the whole body from its frames
    """

    limb: str
    start: int
    stop: int
    hidden: np.ndarray
    names: tuple[str, ...]
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
        """True if at least one frame differs from the track."""
        return set(self.sources) != {KEPT}


@dataclass(frozen=True, eq=False)
class Stabilised:
    """Result of a stabilisation.

    Attributes
    ----------
    annotation : annotation of the track, None where the segments were given
    segments : labelled segments that the gaps were filled by
    gaps : the gaps, each with its selected path
    track : stabilised track
    moved : metres, mean displacement of all joints
    contact_frames : number of frames in which an occluded foot was held on the floor
    before, after : metres, mean distance of the track from its frames before and after the stabilisation
    """

    annotation: Annotation | None
    segments: tuple[Segment, ...]
    gaps: tuple[FilledGap, ...]
    track: Track
    moved: float = 0.0
    contact_frames: int = 0
    before: float = 0.0
    after: float = 0.0


def stabilise(
    source: SourceRun,
    classes: Sequence[MotionClass],
    threshold: float = ALIGNMENT_THRESHOLD,
    *,
    segments: Sequence[Segment] | None = None,
    progress: Progress = silent,
) -> Stabilised:
    """Fill the gaps of a track by the motion classes that are recognised in it.

    The thesis repeats the steps until the track settles; here a second round changed no mean error (31.0 mm after one
    round and at the end, eight sequences, report split), so that there is one.

    Parameters
    ----------
    source : finished run
    classes : motion classes; a class without a motion only marks segments as repetitions
    threshold : fraction of differing features, in (0, 1], from which an alignment with a template is rejected
    segments : labelled segments in place of an annotation of the track
    progress : callback for the number of frames done

    Raises
    ------
    RetrievalError
        A segment has a label of no class.
    SettingsError
        The threshold is out of range.
    """
    if not 0.0 < threshold <= 1.0:
        raise SettingsError(f"threshold {threshold} is not in (0, 1]; try {ALIGNMENT_THRESHOLD}")
    track = source.track
    gaps = find_gaps(track.confidence, source.present)
    context, annotation, labelled = _context(source, gaps, classes, segments, threshold)
    candidates = gap_candidates(context, gaps) if labelled else []
    if not candidates:  # no limb is occluded, or no class is recognised
        return Stabilised(annotation, labelled, (), track)
    contacts = contact_terms(source, context)
    guide = GapGuide(candidates, track.timestamps, contacts)
    again = retrack(source, candidates, guide, partial(progress, "tracking again"))
    paths = [select(*of_gap) for of_gap in zip(candidates, again.distances, again.angles, strict=True)]
    changed = _exchanged(source, candidates, again, paths)
    moved = linear.lengths((changed.joints - track.joints).reshape(-1, 3).astype(np.float64)).reshape(len(track), -1)
    filled = tuple(_filled(*of_gap, moved) for of_gap in zip(candidates, paths, again.distances, strict=True))
    before, after = _mean_distances(track, again, filled)
    return Stabilised(annotation, labelled, filled, changed, float(moved.mean()), len(contacts), before, after)


def _mean_distances(track: Track, again: Retracked, filled: Sequence[FilledGap]) -> tuple[float, float]:
    """Return the mean distance in metres of the track from its frames before and after gaps were filled."""
    measured = np.isfinite(again.explained)
    before = float(again.explained[measured].mean()) if measured.any() else 0.0
    gained = sum((gap.after - gap.before) * (gap.stop - gap.start) for gap in filled)
    return before, before + gained / max(len(track), 1)


def select(gap: GapCandidates, distances: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the selected candidate (D,) of each frame of a gap.

    The cost is the distance (C, D) from the frame, the deviation from the expected angles, and the step from the frame
    before. The thesis accepts every prior and reports the harm of wrong ones (6.6); here the depth decides.
    """
    # Chosen on the tuning split of the labelled sequences: metres for one squared standard deviation of one angle, and
    # metres by which another trajectory must be closer to the depth than the track.
    prior_cost, track_advantage = 0.00015, 0.0007
    spread = gap.expected.variance + PRIOR_SPREAD**2
    deviation = ((angles - gap.expected.mean) ** 2 / spread).sum(axis=2)
    costs = distances + prior_cost * deviation
    costs[gap.names.index(KEPT)] -= track_advantage
    costs = np.where(np.isfinite(costs), costs, np.where(np.arange(len(costs))[:, None] == 0, 0.0, np.inf))
    return cheapest_path(costs, np.nan_to_num(angles))


def _context(
    source: SourceRun,
    gaps: Sequence[Gap],
    classes: Sequence[MotionClass],
    segments: Sequence[Segment] | None,
    threshold: float,
) -> tuple[GapContext, Annotation | None, tuple[Segment, ...]]:
    """Return the track with its labels and occluded limbs, its annotation, and its labelled segments."""
    track = source.track
    rate = frame_rate_of(track.timestamps)
    features = relational_features(from_poses(track.pose, source.body, rate, source.run.name))
    annotation = None
    if segments is None:
        annotation = annotate(features, classes, threshold)
    labelled = tuple(segments if segments is not None else annotation.segments if annotation else ())
    hidden = hidden_flags(gaps, len(track))
    columns = np.minimum(np.rint(np.arange(len(track)) * FEATURE_RATE / rate).astype(np.int64), len(features) - 1)
    first = np.searchsorted(columns, np.arange(len(features)))
    unknown = unknown_rows({limb: flags[first] for limb, flags in hidden.items()}, len(features))
    allocation = allocate(features, labelled, classes, unknown).at(columns)
    context = GapContext(track.pose, track.timestamps, hidden, allocation, classes)
    return context, annotation, labelled


def annotate(features: FeatureMatrix, classes: Sequence[MotionClass], threshold: float) -> Annotation | None:
    """Annotate a track without keyframes (thesis 6.3); return None if it is shorter than every class."""
    annotator = Annotator([replace(motion_class, threshold=threshold) for motion_class in classes])
    return annotator.annotate(features) if len(features) >= annotator.shortest else None


def _exchanged(
    source: SourceRun,
    candidates: Sequence[GapCandidates],
    again: Retracked,
    paths: Sequence[np.ndarray],
) -> Track:
    """Return the track with the selected limbs, and with the confidence of their joints."""
    track = source.track
    poses, confidence, touched = track.pose.copy(), track.confidence.copy(), np.zeros(len(track), dtype=np.bool_)
    for candidate, angles, trust, path in zip(candidates, again.angles, again.confidence, paths, strict=True):
        outer = skeleton.OUTER[candidate.gap.limb]
        for place in np.flatnonzero(path != candidate.names.index(KEPT)):
            frame = candidate.gap.start + place
            poses[frame, candidate.entries] = angles[path[place], place]
            confidence[frame, outer] = trust[path[place], place]
            touched[frame] = True
    joints, at = track.joints.copy(), track.source.copy()
    for frame in np.flatnonzero(touched):
        joints[frame] = linear.rotated(source.body.joint_positions(poses[frame]), source.info.R_level_camera)
    names = track.source_names if SOURCE in track.source_names else (*track.source_names, SOURCE)
    at[touched] = names.index(SOURCE)
    changed = replace(track, joints=joints, pose=poses, confidence=confidence, source=at, source_names=names)
    height = source.info.floor[0] if source.info.floor else None
    return replace(changed, contact=foot_contacts(source.body, changed, height)) if touched.any() else changed


def _filled(candidates: GapCandidates, path: np.ndarray, distances: np.ndarray, moved: np.ndarray) -> FilledGap:
    """Return the record of one gap; `moved` are the displacements (T, 20) of all joints, metres."""
    gap, here = candidates.gap, np.arange(len(path))
    measured = np.isfinite(distances[0])
    before, after = (
        float(d[measured].mean()) if measured.any() else 0.0 for d in (distances[0], distances[path, here])
    )
    changed = float(moved[gap.start : gap.stop, skeleton.OUTER[gap.limb]].mean())
    return FilledGap(gap.limb, gap.start, gap.stop, candidates.hidden, candidates.names, path, changed, before, after)
