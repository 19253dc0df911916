"""Synthetic documents of cut clips for annotation: blended joins, true segments, unlabelled filler."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features


class TransitionSettings(NamedTuple):
    """Settings of the joins between parts.

    Attributes
    ----------
    speed : metres per second of the fastest joint
    shortest, longest : seconds
    """

    speed: float
    shortest: float
    longest: float


JOINS = TransitionSettings(1.5, 0.25, 1.5)
HARD_JOINS = TransitionSettings(6.0, 0.02, 0.1)
"""Joins faster than any person, so that motions begin and end abruptly."""

_LEFT_HIP, _RIGHT_HIP, _ROOT = (NAMED_JOINTS.index(name) for name in ("left_hip", "right_hip", "root"))


@dataclass(frozen=True, eq=False)
class Document:
    """Motion of known truth.

    Attributes
    ----------
    motion : the whole motion
    segments : true segments, seconds
    """

    motion: Motion
    segments: tuple[Segment, ...] = ()

    @cached_property
    def features(self) -> FeatureMatrix:
        """Features of the motion."""
        return relational_features(self.motion)


def assemble(name: str, parts: Sequence[tuple[Motion, str | None]], joining: TransitionSettings = JOINS) -> Document:
    """Concatenate motions as one person would perform them.

    Each part is rotated about y and shifted along the ground so that it starts at the end of the part before, scaled to
    the body length of the first part and placed on its floor. Between two parts the joints move along an eased straight
    line, for as long as the fastest one needs at the speed of `joining`.

    Parameters
    ----------
    name : name of the document
    parts : motions (metres, world y up) of one frame rate, with their label or None for filler; joins have no label
    joining : speed and length of the joins

    Raises
    ------
    RetrievalError
        There are no parts, or their frame rates differ.
    """
    rates = sorted({motion.frame_rate for motion, _ in parts})
    if len(rates) != 1:
        raise RetrievalError(f"document {name!r} needs parts of one frame rate, got {rates}; resample them")
    rate = rates[0]
    size = BodyLengths.of(parts[0][0]).body
    pieces: list[tuple[np.ndarray, np.ndarray]] = []
    segments: list[Segment] = []
    frames = 0
    for motion, label in parts:
        piece = _placed(motion, size, pieces[-1] if pieces else None)
        if pieces:
            pieces.append(_join(pieces[-1], piece, rate, joining))
            frames += len(pieces[-1][0])
        if label is not None:
            segments.append(Segment(frames / rate, (frames + len(motion)) / rate, label))
        pieces.append(piece)
        frames += len(motion)
    joints, axes = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    return Document(Motion(name, joints, rate, axes), tuple(segments))


def excerpt(motions: Sequence[Motion], seconds: tuple[float, float], rng: np.random.Generator) -> Motion:
    """Return a random excerpt of one of the motions, of a random length between two bounds."""
    motion = motions[int(rng.integers(len(motions)))]
    length = min(len(motion), int(rng.uniform(*seconds) * motion.frame_rate))
    start = int(rng.integers(len(motion) - length + 1))
    return motion.sliced(start, start + length)


def shuffled_parts(
    clips: Sequence[tuple[Motion, str | None]],
    fillers: Sequence[Motion],
    rng: np.random.Generator,
) -> list[tuple[Motion, str | None]]:
    """Return the clips in random order, with a random filler excerpt before about every second one."""
    parts: list[tuple[Motion, str | None]] = []
    filler_seconds = (2.0, 5.0)  # shortest and longest excerpt of a filler, seconds
    for index in rng.permutation(len(clips)):
        if fillers and rng.random() < 0.5 and parts:
            parts.append((excerpt(fillers, filler_seconds, rng), None))
        parts.append(clips[index])
    return parts


def _placed(motion: Motion, size: float, before: tuple[np.ndarray, np.ndarray] | None) -> tuple[np.ndarray, np.ndarray]:
    """Return joints (T, 24, 3) and root axes (T, 3) of a part, scaled, on the floor, in line with the part before."""
    scale = size / BodyLengths.of(motion).body
    joints = motion.joints * scale
    joints = joints - np.array([0.0, joints[..., 1].min(), 0.0])
    axes = motion.root_axis
    if axes is None:
        axes = joints[:, _LEFT_HIP] - joints[:, _RIGHT_HIP]
    if before is None:
        return joints, axes
    last = before[0][-1]
    turn = _yaw(last) - _yaw(joints[0])
    rotation = np.array([[np.cos(turn), 0.0, np.sin(turn)], [0.0, 1.0, 0.0], [-np.sin(turn), 0.0, np.cos(turn)]])
    joints = joints @ rotation.T
    shift = (last[_ROOT] - joints[0, _ROOT]) * [1.0, 0.0, 1.0]
    return joints + shift, axes @ rotation.T


def _yaw(pose: np.ndarray) -> float:
    """Return the angle about +y of the line from right to left hip, counted from +x."""
    across = pose[_LEFT_HIP] - pose[_RIGHT_HIP]
    return float(np.arctan2(-across[2], across[0]))


def _join(
    before: tuple[np.ndarray, np.ndarray],
    after: tuple[np.ndarray, np.ndarray],
    rate: float,
    joining: TransitionSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the frames strictly between the last one of a part and the first one of the next."""
    farthest = float(np.linalg.norm(after[0][0] - before[0][-1], axis=-1).max())
    count = int(round(np.clip(farthest / joining.speed, joining.shortest, joining.longest) * rate))
    place = np.arange(1, count + 1) / (count + 1.0)
    ease = place * place * (3.0 - 2.0 * place)
    joints = before[0][-1] + ease[:, None, None] * (after[0][0] - before[0][-1])
    axes = before[1][-1] + ease[:, None] * (after[1][0] - before[1][-1])
    return joints, axes
