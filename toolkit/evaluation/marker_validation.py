"""Validation of a track against a marker system: one clock, one frame, statistics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.evaluation.marker_alignment import (
    RigidAlignment,
    align,
    refined_lag,
    resampled,
    synchronise,
)
from toolkit.evaluation.marker_files import MarkerRecording, read_markers
from toolkit.evaluation.marker_sets import JointCentres, joint_centres
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
from toolkit.motion.opensim_coordinates import coordinates
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
        found = [_against_angles(person, recording, lag) for person in people]
        return max(found, key=lambda each: each.correlation if lag is None else -_rms(each))
    centres = _centres_by_subject(recording, marker_set)
    found, errors = [], []
    for person in people:
        for subject, own in centres.items():
            try:
                found.append(_against_joints(person, _subject_alone(recording, subject), own, lag))
            except RecordingError as error:
                errors.append(error)
    if not found:
        raise errors[0]
    return min(found, key=lambda each: each.alignment.residual if each.alignment is not None else np.inf)


def _subject_alone(recording: MarkerRecording, subject: str) -> MarkerRecording:
    """Return the recording of one subject, with a note where the file holds several."""
    subjects = sorted(set(recording.subjects))
    own = recording.of_subject(subject)
    if len(subjects) < 2:
        return own
    return replace(own, notes=(*own.notes, f"the file holds {len(subjects)} subjects; {subject!r} fits best"))


def _centres_by_subject(recording: MarkerRecording, marker_set: str | Path | None) -> dict[str, JointCentres]:
    found, errors = {}, []
    for subject in sorted(set(recording.subjects)):
        try:
            found[subject] = joint_centres(recording.of_subject(subject), marker_set)
        except RecordingError as error:
            errors.append(error)
    if not found:
        raise errors[0]
    return found


def _rms(validation: Validation) -> float:
    return float(np.mean([row.rms for row in validation.angles])) if validation.angles else float("inf")


def _against_joints(person: Person, recording: MarkerRecording, centres: JointCentres, lag: float | None) -> Validation:
    times, track = person.times, person.joints_level
    correlation = float("nan")
    if lag is None:
        lag, correlation = synchronise(times, track, centres.times, centres.points)
        lag = refined_lag(times, track, centres.times, centres.points, lag)
    moved = resampled(centres.times + lag, centres.points, times)
    alignment = align(moved, track)
    reference = alignment.apply(moved)
    shared = np.isfinite(reference).all(axis=2).any(axis=1) & person.there
    notes = list(recording.notes)
    if alignment.mirrored_residual < 0.5 * alignment.residual:
        notes.append("the markers fit far better when mirrored: left and right are exchanged in one of the files")
    if centres.on_skin.any():
        notes.append("joints marked * are one marker on the skin, some centimetres from the joint centre")
    own_angles, other_angles = three_point_angles(track), three_point_angles(reference)
    angles = angle_agreement(_only(own_angles, shared), _only(other_angles, shared))
    curves = {row.angle: (own_angles[row.angle][shared], other_angles[row.angle][shared]) for row in angles}
    return Validation(
        person.name, recording.name, centres.set_name, recording.subjects[0] if recording.subjects else "", lag,
        correlation, alignment, int(shared.sum()), float((person.track.state[shared] == TRACKED).mean()),
        joint_agreement(track[shared], reference[shared], centres.on_skin), angles,
        stride_agreement(times[shared], track[shared], reference[shared]), times[shared], curves, tuple(notes),
    )  # fmt: skip


def _against_angles(person: Person, recording: MarkerRecording, lag: float | None) -> Validation:
    times, rows = person.times, np.flatnonzero(person.there)
    own = {name: _placed(values, rows, len(times)) for name, values in coordinates(person, rows).items()}
    common = [name for name in own if name in recording.angles]
    if not common:
        raise RecordingError(
            f"{recording.name} has no angle of ours; it has {', '.join(sorted(recording.angles)[:8])}, ours are "
            f"{', '.join(sorted(own)[:8])}"
        )
    correlation = float("nan")
    if lag is None:
        # Angles on a line stand for points: their speeds are compared as those of joints are.
        lag, correlation = synchronise(
            times, _as_points(own, common), recording.times, _as_points(recording.angles, common)
        )
    reference = {name: resampled(recording.times + lag, recording.angles[name], times) for name in common}
    shared = np.isfinite(np.column_stack(list(reference.values()))).any(axis=1) & person.there
    angles = angle_agreement(_only(own, shared), _only(reference, shared))
    curves = {row.angle: (own[row.angle][shared], reference[row.angle][shared]) for row in angles}
    return Validation(
        person.name, recording.name, "", "", lag, correlation, None, int(shared.sum()),
        float((person.track.state[shared] == TRACKED).mean()) if shared.any() else 0.0, (), angles, (), times[shared],
        curves, recording.notes,
    )  # fmt: skip


def _placed(values: np.ndarray, rows: np.ndarray, frames: int) -> np.ndarray:
    out = np.full(frames, np.nan)
    out[rows] = values
    return out


def _as_points(angles: dict[str, np.ndarray], names: Sequence[str]) -> np.ndarray:
    columns = np.column_stack([angles[name] for name in names])
    return np.stack([columns, np.zeros_like(columns), np.zeros_like(columns)], axis=2)


def _only(angles: dict[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[rows] for name, values in angles.items()}
