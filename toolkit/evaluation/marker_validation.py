"""Validation of a track against a marker system: one clock, one frame, statistics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.evaluation.marker_alignment import RigidAlignment, align, refined_lag, resampled, synchronise
from toolkit.evaluation.marker_files import MarkerRecording, read_markers
from toolkit.evaluation.marker_sets import joint_centres
from toolkit.evaluation.marker_statistics import (
    AngleAgreement,
    JointAgreement,
    StrideAgreement,
    angle_agreement,
    joint_agreement,
    stride_agreement,
    three_point_angles,
)
from toolkit.io.errors import RecordingError
from toolkit.motion.angles import coordinates
from toolkit.tracks import TRACKED
from toolkit.tracks.runs import Person


@dataclass(frozen=True, eq=False)
class Validation:
    """A track beside a marker recording.

    Attributes
    ----------
    person : name of the person of the run
    reference : name of the marker recording
    marker_set : marker set, "" for a file of angles
    subject : subject of the marker file, "" where it names none
    lag : seconds, added to the reference's clock
    correlation : correlation of the speeds at that lag, NaN where the lag was given
    alignment : rigid motion from marker axes to the level frame; None for a file of angles
    frames : frames of the track that have a reference
    tracked : share of them in which the person is tracked
    joints, angles, strides : statistics
    times : float64 (T,), seconds of the frames in which both systems have joints
    curves : angle -> (track, reference), each float64 (T,), degrees
    notes : remarks about the result
    """

    person: str
    reference: str
    marker_set: str
    subject: str
    lag: float
    correlation: float
    alignment: RigidAlignment | None
    frames: int
    tracked: float
    joints: Sequence[JointAgreement]
    angles: Sequence[AngleAgreement]
    strides: Sequence[StrideAgreement]
    times: np.ndarray
    curves: dict[str, tuple[np.ndarray, np.ndarray]]
    notes: tuple[str, ...]

    @property
    def mean_mm(self) -> float:
        """Mean distance over joints and frames, millimetres; NaN without joints."""
        count = sum(row.frames for row in self.joints)
        return sum(row.frames * row.mean for row in self.joints) / count if count else float("nan")

    def figures(self) -> dict[str, Any]:
        """Return all figures as plain values, for JSON."""
        rigid = self.alignment
        return {
            "person": self.person, "reference": self.reference, "marker_set": self.marker_set, "subject": self.subject,
            "lag_s": self.lag, "correlation": self.correlation, "frames": self.frames, "tracked": self.tracked,
            "mean_mm": self.mean_mm,
            "alignment": None if rigid is None else {
                "rotation": rigid.rotation.tolist(), "translation_m": rigid.translation.tolist(),
                "residual_mm": 1000 * rigid.residual,
            },
            "joints": [asdict(row) for row in self.joints],
            "angles": [asdict(row) for row in self.angles],
            "strides": [asdict(row) for row in self.strides],
            "notes": list(self.notes),
        }  # fmt: skip


def validate(
    people: Sequence[Person],
    reference: str | Path | MarkerRecording,
    *,
    marker_set: str | Path | None = None,
    lag: float | None = None,
) -> Validation:
    """Compare the person of a run who fits best with a marker recording.

    Parameters
    ----------
    people : people of one run
    reference : file that `read_markers` reads, or a recording in memory
    marker_set : name or YAML file; found by the marker names without
    lag : seconds that added to the reference's clock give the track's (from its first frame on); estimated without

    Raises
    ------
    RecordingError
        The file is not understood, its markers fit no set, or it shows another movement or time.
    UsageError
        There is no such marker set.
    """
    recording = reference if isinstance(reference, MarkerRecording) else read_markers(reference)
    if not recording.labels:
        by_angles = [_against_angles(person, recording, lag) for person in people]
        return max(by_angles, key=lambda each: each.correlation if lag is None else -_rms(each))
    found, errors = [], []
    subjects = sorted(set(recording.subjects))
    for person, subject in product(people, subjects):
        try:
            found.append(_against_joints(person, recording.of_subject(subject), marker_set, lag))
        except RecordingError as error:
            errors.append(error)
    if not found:
        raise errors[0]
    best = min(found, key=lambda each: each.alignment.residual if each.alignment is not None else np.inf)
    if len(subjects) < 2:
        return best
    note = f"the file holds {len(subjects)} subjects; {best.subject!r} fits best"
    return replace(best, notes=(*best.notes, note))


def _rms(validation: Validation) -> float:
    return float(np.mean([row.rms for row in validation.angles])) if validation.angles else float("inf")


def _against_joints(
    person: Person, recording: MarkerRecording, marker_set: str | Path | None, lag: float | None
) -> Validation:
    centres = joint_centres(recording, marker_set)
    times, track = person.times, person.joints_level
    correlation = float("nan")
    if lag is None:
        lag, correlation = synchronise(times, track, recording.times, centres.points)
        lag = refined_lag(times, track, recording.times, centres.points, lag)
    moved = resampled(recording.times + lag, centres.points, times)
    alignment = align(moved, track)
    reference = alignment.apply(moved)
    shared = np.isfinite(reference).all(axis=2).any(axis=1) & person.there
    notes = list(recording.notes)
    if alignment.mirrored_residual < 0.5 * alignment.residual:
        notes.append("the markers fit far better when mirrored: left and right are exchanged in one of the files")
    if centres.on_skin.any():
        notes.append("joints marked * are one marker on the skin, some centimetres from the joint centre")
    found = _by_angles(
        person, recording, (lag, correlation), shared, three_point_angles(track), three_point_angles(reference)
    )
    return replace(
        found,
        marker_set=centres.set_name,
        subject=recording.subjects[0],
        alignment=alignment,
        joints=joint_agreement(track[shared], reference[shared], centres.on_skin),
        strides=stride_agreement(times[shared], track[shared], reference[shared]),
        notes=tuple(notes),
    )


def _against_angles(person: Person, recording: MarkerRecording, lag: float | None) -> Validation:
    times, rows = person.times, np.flatnonzero(person.there)
    tracked = coordinates(person, rows)
    common = [name for name in tracked if name in recording.angles]
    if not common:
        raise RecordingError(
            f"{recording.name} has no angle of the track; it has {', '.join(sorted(recording.angles)[:8])}, not one of "
            f"{', '.join(sorted(tracked)[:8])}"
        )
    track = np.full((len(times), len(common)), np.nan)
    track[rows] = np.column_stack([tracked[name] for name in common])
    theirs = np.column_stack([recording.angles[name] for name in common])
    correlation = float("nan")
    if lag is None:  # the rates of angles are compared as the speeds of joints are
        lag, correlation = synchronise(times, track[..., None], recording.times, theirs[..., None])
    reference = resampled(recording.times + lag, theirs, times)
    shared = np.isfinite(reference).any(axis=1) & person.there
    own, other = (dict(zip(common, columns.T, strict=True)) for columns in (track, reference))
    return _by_angles(person, recording, (lag, correlation), shared, own, other)


def _by_angles(
    person: Person,
    recording: MarkerRecording,
    clock: tuple[float, float],
    shared: np.ndarray,
    track: dict[str, np.ndarray],
    reference: dict[str, np.ndarray],
) -> Validation:
    """Return the comparison of angles (T,) in the shared frames, bool (T,), without joints and strides."""
    own, other = ({name: values[shared] for name, values in angles.items()} for angles in (track, reference))
    rows = angle_agreement(own, other)
    tracked = person.track.state[shared] == TRACKED
    return Validation(
        person.name, recording.name, "", "", *clock, None, len(tracked), float(tracked.mean()) if len(tracked) else 0.0,
        (), rows, (), person.times[shared], {row.angle: (own[row.angle], other[row.angle]) for row in rows},
        recording.notes,
    )  # fmt: skip
