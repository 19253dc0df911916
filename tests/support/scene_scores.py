"""Figures of a scene with no person, one or several, of which the camera sees a part."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.support.identities import Identities, identities_of
from toolkit.evaluation.joint_errors import CORRECT_WITHIN, ERROR_CAP, visible_joints
from toolkit.people.known_people import assigned
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, TRACKED, Track

THERE = 5
"""Smallest number of visible joints of a person who has to be found."""
SOON = 0.5
"""Seconds within which an entering person should be found."""
CONFIDENT = 0.5
"""Confidence above which a joint that is not visible counts as claimed."""


@dataclass(frozen=True, eq=False)
class SceneScore:
    """One recording and its tracks, T frames, N people.

    Attributes
    ----------
    name : of the recording
    errors : float64 (T, N, 20), metres, capped at 1 m, also the error of a missed person; NaN = truth unknown
    seen : bool (T, N, 20), what the camera sees (`visible_joints`)
    confidence : float64 (T, N, 20), NaN for a missed person
    identities : matches and counts within the gate
    delays : float64 (N,), seconds from a person's coming to their being found, inf = never, NaN = never there
    numbers_right : bool (T,), whether as many are reported as there are
    tracked : bool (T,), whether a person is said to be tracked
    """

    name: str
    errors: np.ndarray
    seen: np.ndarray
    confidence: np.ndarray
    identities: Identities
    delays: np.ndarray
    numbers_right: np.ndarray
    tracked: np.ndarray


def score_scene(recording: Recording, tracks: Sequence[Track]) -> SceneScore:
    """Compare all tracks of a recording with all people in it.

    In each frame people and tracks are matched at the least total error of the seen joints (of all joints where none is
    seen). A track may end before the recording; it reports no person then.
    """
    assert recording.joints is not None
    truth = recording.joints if recording.joints.ndim == 4 else recording.joints[None]
    truth = truth.swapaxes(0, 1).astype(np.float64)
    seen = np.array(
        [visible_joints(j, d / 1000.0, recording.camera) for j, d in zip(truth, recording.frames(), strict=True)]
    )
    joints, confidence, states = _stacked(tracks, len(truth))
    active = states != EMPTY
    distances = _distances(truth, joints, seen, active)
    errors, held = _errors(truth, joints, confidence, distances)
    there = seen.sum(axis=2) >= THERE
    identities = identities_of(distances, there, active)
    present = np.isfinite(truth).all(axis=(2, 3))
    reported = active.sum(axis=1)
    return SceneScore(
        name=recording.name,
        errors=errors,
        seen=seen,
        confidence=held,
        identities=identities,
        delays=_delays(there, identities.track_of >= 0, recording.timestamps),
        numbers_right=(there.sum(axis=1) <= reported) & (reported <= present.sum(axis=1)),
        tracked=(states == TRACKED).any(axis=1),
    )


def _stacked(tracks: Sequence[Track], frames: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return joints (T, M, 20, 3), confidence (T, M, 20) and states (T, M) of all tracks, empty after a track's end."""
    joints = np.zeros((frames, len(tracks), 20, 3))
    confidence = np.zeros((frames, len(tracks), 20))
    states = np.full((frames, len(tracks)), EMPTY, dtype=np.uint8)
    for i, track in enumerate(tracks):
        rows = min(frames, len(track))
        joints[:rows, i], confidence[:rows, i] = track.joints[:rows], track.confidence[:rows]
        states[:rows, i] = track.state[:rows]
    return joints, confidence, states


def _distances(truth: np.ndarray, joints: np.ndarray, seen: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Return mean distances (T, N, M) of the visible joints, of all joints if none is; NaN where either is absent."""
    between = np.linalg.norm(truth[:, :, None] - joints[:, None], axis=-1)
    counted = np.where(seen.any(axis=2, keepdims=True), seen, np.isfinite(truth).all(axis=-1))[:, :, None]
    total = np.where(counted, between, 0.0).sum(axis=-1)
    number = np.broadcast_to(counted.sum(axis=-1), total.shape)
    known = (number > 0) & active[:, None]
    return np.where(known, total / np.maximum(number, 1), np.nan)


def _errors(
    truth: np.ndarray, joints: np.ndarray, confidence: np.ndarray, distances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return errors and confidences (T, N, 20) of the best assignment of each frame."""
    known = np.isfinite(truth).all(axis=-1)
    errors = np.where(known, ERROR_CAP, np.nan)
    held = np.full(errors.shape, np.nan)
    for t, costs in enumerate(distances):
        near = np.where(np.isfinite(costs), np.minimum(costs, ERROR_CAP), np.inf)
        for person, track in assigned(near, np.full(len(near), ERROR_CAP)):
            apart = np.linalg.norm(truth[t, person] - joints[t, track], axis=-1)
            errors[t, person] = np.where(known[t, person], np.minimum(apart, ERROR_CAP), np.nan)
            held[t, person] = confidence[t, track]
    return errors, held


def _delays(there: np.ndarray, found: np.ndarray, timestamps: np.ndarray) -> np.ndarray:
    """Return seconds from a person's first frame in view to the first one with their track."""
    delays = np.full(there.shape[1], np.nan)
    for person in np.flatnonzero(there.any(axis=0)):
        coming = int(there[:, person].argmax())
        later = np.flatnonzero(found[coming:, person])
        delays[person] = timestamps[coming + later[0]] - timestamps[coming] if len(later) else np.inf
    return delays


def scene_figures(scores: Sequence[SceneScore]) -> dict[str, Any]:
    """Return figures of a group of recordings, by name; None for a figure without samples.

    `error_mm` and `a100`, of the seen joints, are means over the recordings. All others are taken over all frames of
    all recordings: `switches`, `misses` and `false` count, the rest are shares.
    """
    of_seen = [score.errors[score.seen] for score in scores if score.seen.any()]
    errors, seen, confidence = (
        np.concatenate([np.ravel(getattr(score, name)) for score in scores] or [np.empty(0)])
        for name in ("errors", "seen", "confidence")
    )
    sure = np.isfinite(errors) & ~seen.astype(bool) & (np.nan_to_num(confidence) > CONFIDENT)
    delays = np.concatenate([score.delays for score in scores] or [np.empty(0)])
    return {
        "recordings": len(scores),
        "error_mm": _mean([1000 * e.mean() for e in of_seen]),
        "a100": _mean([(e <= CORRECT_WITHIN).mean() for e in of_seen]),
        "switches": sum(score.identities.switches for score in scores),
        "misses": sum(score.identities.misses for score in scores),
        "false": sum(score.identities.false for score in scores),
        "found_soon": _mean(delays[~np.isnan(delays)] <= SOON),
        "numbers_right": _mean(np.concatenate([score.numbers_right for score in scores] or [np.empty(0)])),
        "unobserved_sure_a100": _mean(errors[sure] <= CORRECT_WITHIN),
    }


def _mean(values: Sequence[float] | np.ndarray) -> float | None:
    return float(np.mean(values)) if len(values) else None
