"""Evaluation of run folders into one table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body.skeleton import REPORTED
from toolkit.evaluation import joint_errors as metrics
from toolkit.evaluation.agreement import COMPARED, agreement, agreement_with_offsets, local_differences, subject_of
from toolkit.evaluation.extrema_scores import TIPS, all_found, all_free
from toolkit.evaluation.reference import Reference, find_reference
from toolkit.evaluation.scores import EvaluationTable, RunScores
from toolkit.io.errors import TrackError, UsageError
from toolkit.io.progress import Progress, silent
from toolkit.landmarks.extrema import geodesic_extrema
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.people.known_people import assigned
from toolkit.people.survey import find_person
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks import EMPTY, PARTIAL_FILE, STATE_NAMES, TRACK_FILE, TRACKED, RunInfo, Track
from toolkit.tracks.runs import PEOPLE_FILE, person_runs


def evaluate_runs(
    runs: Sequence[str | Path],
    references: Sequence[str | Path] | None = None,
    *,
    surface: bool = True,
    recording: str | Path | None = None,
    progress: Progress = silent,
) -> EvaluationTable:
    """Compare tracks with the truth or another system's skeleton, and fitted bodies with the measured depth.

    The people of a run with several (`people.json`) are matched with the true people at minimum total error. Each
    person is a row; a missed person has an error of 1 m. Figures that need all depth frames are left out for them.

    Parameters
    ----------
    runs : run folders of one person or of several, or folders that hold some
    references : files, or folders matched by the recording's stem; default: the recording of each run
    surface : also compute the figures that need all depth frames: hidden joints, extrema, overlap, residual
    recording : new place of the recording, for a single run

    Raises
    ------
    UsageError
        One recording is named for several runs, or no run contains a person.
    TrackError
        A track is missing or does not fit its recording.
    RecordingError
        A recording is missing or has changed since tracking.
    """
    folders = find_runs(runs)
    if recording is not None and len(folders) > 1:
        raise UsageError(f"one recording, {recording}, cannot belong to {len(folders)} runs; evaluate them one by one")
    paths = [Path(reference) for reference in references or []]
    rows: list[RunScores] = []
    for i, folder in enumerate(folders):
        progress(folder.name, i, len(folders))
        rows.extend(_evaluate(folder, paths, surface, recording))
    progress("", len(folders), len(folders))
    if folders and not rows:
        raise UsageError(f"no person was found in {', '.join(map(str, folders))}; there is nothing to compare")
    return EvaluationTable(_with_offsets(rows))


def find_runs(paths: Sequence[str | Path]) -> list[Path]:
    """Return the runs among `paths` and directly inside them, sorted by name within each folder.

    Raises
    ------
    TrackError
        A path contains no track.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        inside = sorted({p.parent for name in (TRACK_FILE, PEOPLE_FILE) for p in path.glob(f"*/{name}")})
        own = any((path / name).exists() for name in (TRACK_FILE, PARTIAL_FILE, PEOPLE_FILE))
        found.extend([path] if own or not inside else inside)
    return found


def _evaluate(run: Path, references: list[Path], surface: bool, moved_to: str | Path | None = None) -> list[RunScores]:
    """Yield the people of a run, and the true people that the run missed."""
    folders = person_runs(run)
    tracks = [Track.load(folder) for folder in folders]
    if not tracks:
        return []
    recording = RunInfo.load(folders[0]).open_recording(moved_to)
    frames = max(map(len, tracks))
    if frames > len(recording):
        raise TrackError(f"{run} has {frames} rows, its recording {len(recording)} frames; track it again")
    alone = folders == (run,)
    own, missing = match_people(find_reference(recording, references, frames), tracks)
    rows = []
    for folder, track, person in zip(folders, tracks, own, strict=True):
        name = recording.name if alone else f"{recording.name}/{folder.name}"
        row = _scores(track, name, str(folder), len(recording), person)
        if surface and alone:
            row = replace(row, **_frame_figures(track, RunInfo.load(folder), recording, person))
        rows.append(row)
    lost = [] if alone else [_not_found(f"{recording.name}/not found", str(run), person) for person in missing]
    return rows + lost


def match_people(
    reference: Reference | None, tracks: Sequence[Track]
) -> tuple[list[Reference | None], list[Reference]]:
    """Match tracks with people at minimum total error; return the person of each track or None, and missed people."""
    if reference is None:
        return [None] * len(tracks), []
    costs = np.array([[_mean_error(track, person) for track in tracks] for person in reference.people])
    track_of = dict(assigned(costs, np.full(len(costs), np.inf)))
    own: list[Reference | None] = [None] * len(tracks)
    for person, track in track_of.items():
        own[track] = Reference(reference.people[person, : len(tracks[track])], reference.is_truth)
    missed = [joints for person, joints in enumerate(reference.people) if person not in track_of]
    return own, [Reference(joints, reference.is_truth) for joints in missed]


def _mean_error(track: Track, person: np.ndarray) -> float:
    """Return the mean error of a track for a person (T, 20, 3), metres; 1 m in frames without a reported person."""
    errors = metrics.joint_errors(track.joints, person[: len(track)])
    errors[track.state == EMPTY] = metrics.ERROR_CAP
    known = np.isfinite(person).all(axis=2)
    total = np.where(known[: len(track)], errors, 0.0).sum() + metrics.ERROR_CAP * known[len(track) :].sum()
    return float(total / max(known.sum(), 1))


def _not_found(name: str, run: str, person: Reference) -> RunScores:
    """Return the row of a missed person: 1 m in all frames."""
    errors = metrics.joint_errors(np.full(person.joints.shape, np.inf), person.joints)
    row = RunScores(name, run, 0, len(errors))
    return replace(row, **_error_figures(errors)) if person.is_truth and np.isfinite(errors).any() else row


def _scores(
    track: Track, recording: str, run: str, recorded_frames: int, reference: Reference | None = None
) -> RunScores:
    """Return the figures of a track that need no depth."""
    won = track.source[track.state == TRACKED]
    names = enumerate(track.source_names)
    return RunScores(
        recording=recording,
        run=run,
        frames=len(track),
        recorded_frames=recorded_frames,
        states={name: float((track.state == i).mean()) for i, name in enumerate(STATE_NAMES)},
        sources={name: float((won == i).mean()) for i, name in names} if len(won) else {},
        **_times(track),
        **({} if reference is None else _distances(track, reference)),
    )


def evaluate_tracks(tracks: Sequence[tuple[str, Track]], truth: np.ndarray) -> EvaluationTable:
    """Compare tracks in memory, each with its name, with the true joints.

    Parameters
    ----------
    tracks : tracks of one recording
    truth : float64 (T, 20, 3), or (N, T, 20, 3) for several people in any order: metres, camera frame, NaN = unknown

    Raises
    ------
    UsageError
        The truth has another shape, or another number of frames than the tracks.
    """
    if truth.ndim not in (3, 4) or truth.shape[-2:] != (len(REPORTED), 3):
        raise UsageError(f"the truth has shape {truth.shape}; give joints (frames, {len(REPORTED)}, 3) in metres")
    if any(len(track) != truth.shape[-3] for _, track in tracks):
        raise UsageError(f"the truth has {truth.shape[-3]} frames and the track {len(tracks[0][1])}; give as many")
    distance = float(np.nanmedian(np.abs(truth[..., 2]))) if np.isfinite(truth[..., 2]).any() else 0.0
    farthest_median = 65.5  # metres: the largest depth of a 16-bit image in millimetres
    if distance > farthest_median:
        raise UsageError(f"the truth is {distance:g} m away in the median; give metres, not millimetres")
    own, missing = match_people(Reference(truth, True), [track for _, track in tracks])
    rows = [_scores(track, name, "", len(track), person) for (name, track), person in zip(tracks, own, strict=True)]
    return EvaluationTable([*rows, *(_not_found("not found", "", person) for person in missing)])


def _times(track: Track) -> dict[str, Any]:
    if len(track) == 0:
        return {}
    total = track.stage_ms.sum(axis=1)
    return {
        "frame_ms": float(np.median(total)),
        "frame_ms_p99": float(np.percentile(total, 99)),
        "stages_ms": {name: float(np.median(track.stage_ms[:, i])) for i, name in enumerate(track.stage_names)},
    }


def _distances(track: Track, reference: Reference) -> dict[str, Any]:
    """Return the figures of the joints; for a reference that is no truth only agreement and curve."""
    errors = metrics.joint_errors(track.joints, reference.joints)
    per_frame = metrics.frame_errors(errors)
    figures: dict[str, Any] = {
        "curve": metrics.accuracy(errors, metrics.CURVE),
        "frame_error_mm": 1000 * per_frame,
        "timestamps": track.timestamps,
    }
    if reference.is_truth:
        return figures | _error_figures(errors)
    apart = local_differences(track.joints, reference.joints)
    near, ends = (agreement(track.joints, reference.joints, own) for own in (COMPARED, metrics.HANDS_AND_FEET))
    return figures | {"agreement": near, "agreement_hands_feet": ends, "differences": apart}


def _error_figures(errors: np.ndarray) -> dict[str, Any]:
    """Return the figures of errors (T, 20), metres, against a truth."""
    per_frame = metrics.frame_errors(errors)
    known = per_frame[np.isfinite(per_frame)]
    return {
        "error_mm": 1000 * float(np.nanmean(errors)),
        "median_mm": 1000 * float(np.nanmedian(errors)),
        "a100": float(metrics.accuracy(errors)),
        "a100_hands_feet": float(metrics.accuracy(errors[:, metrics.HANDS_AND_FEET])),
        "a100_joints": {name: float(metrics.accuracy(errors[:, j])) for j, name in enumerate(REPORTED)},
        "lost": float((known > metrics.LOST_ERROR).mean()),
    }


def _frame_figures(track: Track, info: RunInfo, recording: Recording, reference: Reference | None) -> dict[str, Any]:
    """Return the figures that need all depth frames: visible joints and fit of the body to the depth."""
    from toolkit.simulation.raycast import render_depth

    # Full resolution, so that runs at both resolutions are comparable. The silhouette is the measured one, because
    # cleaning removes its contour, which has a tenth of its pixels.
    settings = replace(SensingSettings(**info.sensing), half_resolution=False)
    cleaner = find_person(recording, settings)
    cutter = find_person(recording, replace(settings, contour="keep", median=False))
    body, rotation = info.body(), info.R_level_camera
    visible = np.zeros((len(track), len(REPORTED)), dtype=bool)
    overlap, residual = np.full(len(track), np.nan), np.full(len(track), np.nan)
    found: list[tuple[bool, bool]] = []
    for i, raw in zip(range(len(track)), recording.frames(), strict=False):
        depth = cleaner.find(raw, float(recording.timestamps[i]), {})[0].depth
        whole = cutter.find(raw, float(recording.timestamps[i]), {})[0].depth
        if not depth.any():
            continue
        rendered = render_depth(body, track.pose[i], cleaner.camera, rotation)
        overlap[i] = silhouette_overlap(whole, rendered)
        residual[i] = depth_residual(depth, rendered)
        if reference is None:
            continue
        truth = np.asarray(reference.joints[i], dtype=np.float64)
        visible[i] = metrics.visible_joints(truth, depth, cleaner.camera)
        if visible[i, TIPS].all():
            found.append(_extrema(Cloud.from_depth(depth, cleaner.camera, rotation), truth @ rotation.T))
    figures: dict[str, Any] = {
        "overlap": _known(np.median, overlap), "residual_mm": _known(np.median, 1000 * residual)
    }  # fmt: skip
    if found:
        hits, free = np.array(found).T
        figures["extrema"] = float(hits.mean())
        figures["extrema_free"] = float(hits[free].mean()) if free.any() else None
    if reference is not None and reference.is_truth:
        errors = 1000 * metrics.joint_errors(track.joints, reference.joints)
        figures |= {"visible_mm": _known(np.mean, errors[visible]), "hidden_mm": _known(np.mean, errors[~visible])}
    return figures


def _extrema(cloud: Cloud, truth_level: np.ndarray) -> tuple[bool, bool]:
    """Return whether the first five extrema are the five end effectors of joints (20, 3), and whether all are free."""
    settings = LandmarkSettings()
    extrema = geodesic_extrema(cloud, len(TIPS), settings).points
    return all_found(extrema, truth_level[TIPS]), all_free(cloud, truth_level, settings)


def _known(statistic: Callable[[np.ndarray], Any], values: np.ndarray) -> float | None:
    """Return a statistic of the known values, None if there is none."""
    known = values[np.isfinite(values)]
    return float(statistic(known)) if known.size else None


def _with_offsets(rows: list[RunScores]) -> list[RunScores]:
    """Return the rows with their agreement with offsets, which needs runs of other subjects."""
    agreed = [i for i, row in enumerate(rows) if row.differences.size]
    subjects = [subject_of(rows[i].recording) for i in agreed]
    for i, share in zip(agreed, agreement_with_offsets([rows[i].differences for i in agreed], subjects), strict=True):
        rows[i] = replace(rows[i], agreement_offsets=share if np.isfinite(share) else None)
    return rows


def silhouette_overlap(measured: np.ndarray, rendered: np.ndarray) -> float:
    """Return the intersection over union of two silhouettes, in [0, 1]; NaN if both are empty.

    Parameters
    ----------
    measured, rendered : float32 (H, W), metres along z, 0 = nothing
    """
    first, second = measured > 0, rendered > 0
    union = int((first | second).sum())
    return float((first & second).sum() / union) if union else float("nan")


def depth_residual(measured: np.ndarray, rendered: np.ndarray) -> float:
    """Return the median absolute depth difference where both have a surface, metres; NaN without overlap."""
    both = (measured > 0) & (rendered > 0)
    if not both.any():
        return float("nan")
    return float(np.median(np.abs(measured[both].astype(np.float64) - rendered[both])))
