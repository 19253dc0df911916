"""From run folders to the table of their figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.errors import TrackError, UsageError
from toolkit.evaluation import joints as metrics
from toolkit.evaluation import upper
from toolkit.evaluation.agreement import (
    UTD_SUBJECT,
    agreement,
    agreement_with_offsets,
    local_differences,
    subject_of,
)
from toolkit.evaluation.extrema import TIPS, all_free, extrema_found
from toolkit.evaluation.reference import Reference, find_reference
from toolkit.evaluation.scores import EvaluationTable, RunScores
from toolkit.evaluation.surface import depth_residual, silhouette_overlap
from toolkit.landmarks.settings import LandmarkSettings
from toolkit.people.survey import find_person
from toolkit.progress import Progress
from toolkit.runs import PEOPLE_FILE, person_runs
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.sensing.settings import SensingSettings
from toolkit.skeleton import REPORTED
from toolkit.track import EMPTY, PARTIAL_FILE, STATE_NAMES, TRACK_FILE, TRACKED, RunInfo, Track


@dataclass(frozen=True, eq=False)
class _Evaluated:
    """One run's scores and what the agreement over subjects still needs: `local_differences`, None of a truth."""

    scores: RunScores
    differences: np.ndarray | None = None


def evaluate_runs(
    runs: Sequence[str | Path],
    references: Sequence[str | Path] | None = None,
    *,
    surface: bool = True,
    subject_pattern: str = UTD_SUBJECT,
    recording: str | Path | None = None,
    progress: Progress | None = None,
) -> EvaluationTable:
    """Compare tracks with the truth or with another system's skeleton, and fitted bodies with the depth they explain.

    The people of a run of several (`people.json`) are matched with those of the truth at the least total error; each is
    a row, and a person who was not found is one of 1 m. What needs every depth frame is left out for them.

    Parameters
    ----------
    runs : run folders of one person or of several, or folders that hold some
    references : files, or folders matched by the recording's stem; by default each run's own recording
    surface : also compute what needs every depth frame: hidden joints, extrema, silhouette overlap, depth residual
    subject_pattern : regular expression whose first group is the subject in a recording's name
    recording : where the recording of the one run has been moved to

    Raises
    ------
    UsageError
        A recording is named for several runs, or nobody was found in any run.
    TrackError
        There is no finished track, or it does not fit its recording.
    RecordingError
        A recording is missing or has changed since it was tracked.
    """
    folders = find_runs(runs)
    if recording is not None and len(folders) > 1:
        raise UsageError(f"one recording, {recording}, is no place of {len(folders)} runs; evaluate them one by one")
    paths = [Path(reference) for reference in references or []]
    evaluated: list[_Evaluated] = []
    for i, folder in enumerate(folders):
        if progress is not None:
            progress(folder.name, i, len(folders))
        evaluated.extend(_evaluate(folder, paths, surface, recording))
    if progress is not None:
        progress("", len(folders), len(folders))
    if folders and not evaluated:
        raise UsageError(f"nobody was found in {', '.join(map(str, folders))}; there is nothing to compare")
    return _with_offsets(evaluated, subject_pattern)


def find_runs(paths: Sequence[str | Path]) -> list[Path]:
    """Runs among `paths` and directly inside them, each folder's in the order of their names.

    Raises
    ------
    TrackError
        A path holds no track.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        inside = sorted({p.parent for name in (TRACK_FILE, PEOPLE_FILE) for p in path.glob(f"*/{name}")})
        own = any((path / name).exists() for name in (TRACK_FILE, PARTIAL_FILE, PEOPLE_FILE))
        found.extend([path] if own or not inside else inside)
    return found


def _evaluate(run: Path, references: list[Path], surface: bool, moved_to: str | Path | None = None) -> list[_Evaluated]:
    """Every person of a run, and of a run of several a person who is in the truth and was not found."""
    folders = person_runs(run)
    tracks = [Track.load(folder) for folder in folders]
    if not tracks:
        return []
    recording = RunInfo.load(folders[0]).open_recording(moved_to)
    rows = max(map(len, tracks))
    if rows > len(recording):
        raise TrackError(f"{run} has {rows} rows, its recording {len(recording)} frames; track it again")
    alone = folders == (run,)
    reference = find_reference(recording, references, rows)
    own, missing = match_people(reference, tracks)
    evaluated = [
        _evaluate_person(folder, track, recording, person, surface and alone)
        for folder, track, person in zip(folders, tracks, own, strict=True)
    ]
    named = [
        replace(item, scores=replace(item.scores, recording=f"{recording.name}/{folder.name}"))
        for item, folder in zip(evaluated, folders, strict=True)
    ]
    return evaluated if alone else [*named, *(_not_found(recording, run, person) for person in missing)]


def assigned(costs: np.ndarray) -> np.ndarray:
    """The column of each row at the least total cost, int64 (N,), -1 for none; infinite costs are never chosen.

    Parameters
    ----------
    costs : float64 (N, M), not negative
    """
    from scipy.optimize import linear_sum_assignment

    allowed = np.isfinite(costs)
    chosen = np.full(len(costs), -1, dtype=np.int64)
    if not allowed.any():
        return chosen
    forbidden = 1.0 + 2.0 * costs[allowed].sum()
    rows, columns = linear_sum_assignment(np.where(allowed, costs, forbidden))
    kept = allowed[rows, columns]
    chosen[rows[kept]] = columns[kept]
    return chosen


def match_people(
    reference: Reference | None, tracks: Sequence[Track]
) -> tuple[list[Reference | None], list[Reference]]:
    """The person whom each track follows, None for none, at the least total error; and the people without a track."""
    if reference is None:
        return [None] * len(tracks), []
    costs = np.array([[_mean_error(track, person) for track in tracks] for person in reference.people])
    track_of = assigned(costs.reshape(len(reference.people), len(tracks)))
    own: list[Reference | None] = [None] * len(tracks)
    for person, track in enumerate(track_of):
        if track >= 0:
            own[track] = Reference(reference.people[person, : len(tracks[track])], reference.is_truth)
    missing = [reference.of(int(person)) for person in np.flatnonzero(track_of < 0)]
    return own, missing


def _mean_error(track: Track, person: np.ndarray) -> float:
    """Mean error of a track as that of a person (T, 20, 3), metres; 1 m in frames for which it reports no person."""
    errors = metrics.joint_errors(track.joints, person[: len(track)])
    errors[track.state == EMPTY] = metrics.CAP
    known = np.isfinite(person).all(axis=2)
    total = np.where(known[: len(track)], errors, 0.0).sum() + metrics.CAP * known[len(track) :].sum()
    return float(total / max(known.sum(), 1))


def _not_found(recording: Recording, run: Path, person: Reference) -> _Evaluated:
    """The row of a person who is in the truth and in no track: 1 m in every frame."""
    nowhere = np.full(person.joints.shape, np.inf)
    errors = metrics.joint_errors(nowhere, person.joints)
    scores = RunScores(f"{recording.name}/not found", str(run), 0, len(recording))
    if person.is_truth and np.isfinite(errors).any():
        scores = replace(scores, **_error_figures(errors))
    return _Evaluated(scores)


def _evaluate_person(
    run: Path, track: Track, recording: Recording, reference: Reference | None, surface: bool
) -> _Evaluated:
    info = RunInfo.load(run)
    scores = _scores_of(track, recording.name, str(run), len(recording))
    if reference is not None:
        scores = replace(scores, **_distances(track, reference))
    if reference is not None and reference.is_truth:
        scores = replace(scores, **_upper_figures(track, recording, reference))
    if surface:
        scores = replace(scores, **_frame_figures(track, info, recording, reference))
    if reference is None or reference.is_truth:
        return _Evaluated(scores)
    return _Evaluated(scores, local_differences(track.joints, reference.joints))


def _scores_of(track: Track, recording: str, run: str, recorded_frames: int) -> RunScores:
    """Figures of a track without a reference."""
    return RunScores(
        recording=recording,
        run=run,
        frames=len(track),
        recorded_frames=recorded_frames,
        states={name: float((track.state == i).mean()) for i, name in enumerate(STATE_NAMES)},
        **_selection(track),
        **_times(track),
    )


def evaluate_tracks(tracks: Sequence[tuple[str, Track]], truth: np.ndarray) -> EvaluationTable:
    """Compare tracks in memory, each with its name, with the true joints.

    Parameters
    ----------
    tracks : of one recording
    truth : float64 (T, 20, 3), or (N, T, 20, 3) of several people in any order: metres, camera frame, NaN = unknown

    Raises
    ------
    UsageError
        The truth has another shape, or another number of frames than the tracks.
    """
    if truth.ndim not in (3, 4) or truth.shape[-2:] != (len(REPORTED), 3):
        raise UsageError(f"the truth has shape {truth.shape}; give joints (frames, {len(REPORTED)}, 3) in metres")
    if any(len(track) != truth.shape[-3] for _, track in tracks):
        raise UsageError(f"the truth has {truth.shape[-3]} frames and the track {len(tracks[0][1])}; give as many")
    own, missing = match_people(Reference(truth, True), [track for _, track in tracks])
    rows = [_scores_of(track, name, "", len(track)) for name, track in tracks]
    for i, reference in enumerate(own):
        if reference is not None:
            rows[i] = replace(rows[i], **_distances(tracks[i][1], reference))
    for person in missing:
        errors = metrics.joint_errors(np.full(person.joints.shape, np.inf), person.joints)
        rows.append(replace(RunScores("not found", "", 0, len(person.joints)), **_error_figures(errors)))
    return EvaluationTable(rows)


def _selection(track: Track) -> dict[str, Any]:
    won = track.source[track.state == TRACKED]
    names = enumerate(track.source_names)
    return {"sources": {name: float((won == i).mean()) for i, name in names} if len(won) else {}}


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
    """Figures of the joints alone; of a reference that is no truth only what is called agreement, and the curve."""
    errors = metrics.joint_errors(track.joints, reference.joints)
    per_frame = metrics.frame_errors(errors)
    figures: dict[str, Any] = {
        "curve": metrics.accuracy(errors, metrics.CURVE),
        "frame_error_mm": 1000 * per_frame,
        "timestamps": track.timestamps,
    }
    if not reference.is_truth:
        return figures | {"agreement": agreement(track.joints, reference.joints)}
    return figures | _error_figures(errors)


def _error_figures(errors: np.ndarray) -> dict[str, Any]:
    """Figures of the errors (T, 20), metres, against a truth."""
    per_joint = metrics.accuracy_per_joint(errors)
    per_frame = metrics.frame_errors(errors)
    known = per_frame[np.isfinite(per_frame)]
    return {
        "error_mm": 1000 * float(np.nanmean(errors)),
        "median_mm": 1000 * float(np.nanmedian(errors)),
        "a100": float(metrics.accuracy(errors)),
        "a100_hands_feet": float(metrics.accuracy(errors[:, metrics.HANDS_AND_FEET])),
        "a100_joints": {name: float(share) for name, share in zip(REPORTED, per_joint, strict=True)},
        "lost": float((known > metrics.LOST_ERROR).mean()),
    }


def _upper_figures(track: Track, recording: Recording, reference: Reference) -> dict[str, Any]:
    """Figures of the upper body, of the frames in which all of it is known."""
    known = np.isfinite(reference.joints[:, upper.ROWS]).all(axis=(1, 2))
    if not known.any():
        return {}
    joints, states, truth = track.joints[known], track.state[known], reference.joints[known]
    figures = upper.upper_figures([upper.score_upper(recording.name, joints, states, truth, recording.camera)])
    own = ("upper_mm", "upper_px", "hands_px", "first_px")
    return {name: figures[name] for name in own} | {"upper_curve": figures["curve"]}


def _frame_figures(track: Track, info: RunInfo, recording: Recording, reference: Reference | None) -> dict[str, Any]:
    """Figures that need every depth frame: what the camera sees, and how well the fitted body explains it."""
    from toolkit.body.raycast import render_depth

    # Full resolution whatever the tracker used, so that runs at both resolutions are measured alike. The silhouette is
    # that of the person as measured: cleaning takes away its contour, a tenth of its pixels.
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
    figures: dict[str, Any] = {"overlap": _median(overlap), "residual_mm": _median(1000 * residual)}
    if found:
        hits, free = np.array(found).T
        figures["extrema"] = float(hits.mean())
        figures["extrema_free"] = float(hits[free].mean()) if free.any() else None
    if reference is not None and reference.is_truth:
        figures |= _by_visibility(track.joints, reference.joints, visible)
    return figures


def _extrema(cloud: Cloud, truth_level: np.ndarray) -> tuple[bool, bool]:
    settings = LandmarkSettings()
    return extrema_found(cloud, truth_level, settings), all_free(cloud, truth_level, settings)


def _by_visibility(joints: np.ndarray, truth: np.ndarray, visible: np.ndarray) -> dict[str, Any]:
    errors = metrics.joint_errors(joints, truth)
    known = np.isfinite(errors)
    mean, deviation = metrics.average_pose_error(joints, truth, visible)
    return {
        "visible_mm": _mean_mm(errors[visible & known]),
        "hidden_mm": _mean_mm(errors[~visible & known]),
        "pose_error_mm": 1000 * mean,
        "pose_error_std_mm": 1000 * deviation,
    }


def _mean_mm(values: np.ndarray) -> float | None:
    return 1000 * float(values.mean()) if values.size else None


def _median(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None


def _with_offsets(evaluated: list[_Evaluated], pattern: str) -> EvaluationTable:
    """Fill in the agreement with offsets, which needs the runs of other subjects."""
    rows = [item.scores for item in evaluated]
    agreed = {i: item.differences for i, item in enumerate(evaluated) if item.differences is not None}
    subjects = [subject_of(rows[i].recording, pattern) for i in agreed]
    shares = agreement_with_offsets(list(agreed.values()), subjects)
    for i, share in zip(agreed, shares, strict=True):
        rows[i] = replace(rows[i], agreement_offsets=share if np.isfinite(share) else None)
    return EvaluationTable(rows)
