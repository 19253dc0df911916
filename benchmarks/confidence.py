"""Confidence of joints: `depthmocap bench confidence judge [--every 3] [--takes 1]`.

People who are not in the fit (`training/fit_confidence.py`) are tracked: UTD-MHAD 5 and 7, MSR Action3D 4 and 5, every
`--every`-th recording, and `--takes` recordings of each group of the clean suite and of the scenes (report split). Of
each real recording, `STILLS` frames are tracked as photographs, too.

A joint is right within 10 cm. The Kinect SDK's joints are those of the moment that the depth shows (`bench real lag`),
without the person's median offset of each joint in the frame of the torso, which is the difference of two definitions.
Figures are calibration errors with and without these corrections, and the share of wrists over 250 mm from the SDK's
that are surer than 0.7. The reliability is drawn.
"""

import argparse
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._record import benchmark, drawn, script
from benchmarks.real import SHIFTS, shifted
from tests.support.calibration import BINS, calibration_error
from tests.support.scenes import GROUPS, chosen_scenes, record_scene
from tests.support.suite import WORK, chosen_takes
from toolkit.app.pipeline import track_recording
from toolkit.body import skeleton
from toolkit.database import DEFAULT_DATABASE
from toolkit.database.database import PoseDatabase
from toolkit.datasets.folder import data_folder
from toolkit.evaluation.agreement import torso_frames
from toolkit.landmarks.joint_network import RELIABLE_WITHIN
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.recordings.writer import save_recording
from toolkit.sensing.recording import Recording
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracks import TRACKED
from toolkit.tracks.runs import load_persons, person_runs

PEOPLE = {"utd_mhad": "57", "msr_action3d": "45"}
"""People of each data set, by the numbers in the names of their files."""
GROSS, SURE = 0.25, 0.7
"""Metres from the SDK's joint and confidence from which a wrist is wrong without warning."""
STILLS, APART_SECONDS = 4, 10.0
"""Number of photographs of each real recording, and seconds between them, too long to track a pose."""
PICTURE = Path(__file__).parents[1] / "docs" / "images" / "confidence.png"
WRISTS = [skeleton.REPORTED.index(f"{side}_wrist") for side in ("left", "right")]


class Rows(NamedTuple):
    """Tracked frames of one person with a reference; `person` is data set and number, empty for a simulated one.

    `apart`, (F, 20, 3), is the way to the joints of the reference in the torso's frame, in time; `plain`, (F, 20), are
    the distances from the reference in the same row of the file. Both are metres.
    """

    source: str
    person: str
    apart: np.ndarray
    plain: np.ndarray
    confidence: np.ndarray


def files_of(split: str, people: Mapping[str, str], every: int, takes: int) -> list[tuple[str, Path]]:
    """Return source and file of the recordings of some people, and of the clean suite and the scenes of a split.

    Simulated recordings are made if they are not there yet.
    """
    found = []
    for name, numbers in people.items():
        files = sorted((data_folder() / "depth" / name).glob("*_depth.mat"))
        for number in numbers:
            found += [(name, file) for file in [f for f in files if f"_s{number}_" in f.name][::every]]
    groups = tuple(group for group in GROUPS if group != "empty")
    scenes = [*chosen_takes(split, (), takes), *chosen_scenes(split, groups, takes)]
    return found + [("simulated", record_scene(scene, WORK)) for scene in scenes]


def rows_of(tracker: HybridTracker, source: str, file: Path, work: Path) -> list[Rows]:
    """Track a recording, and some frames of a real one as photographs, and return the rows of all people."""
    recording = open_recording(file)
    if source == "simulated":
        truth = np.asarray(recording.joints, dtype=np.float64).reshape(-1, len(recording), 20, 3)
        return tracked_rows(tracker, (source, ""), open_upright(file), (truth, truth), work, people=None)
    plain = np.asarray(recording.reference_joints, dtype=np.float64)
    references, person = (plain, shifted(plain, SHIFTS[source])), f"{source} {file.stem.split('_')[1]}"
    chosen = np.linspace(0, len(recording) - 1, STILLS + 2).astype(np.int64)[1:-1]
    stills, depth = work / "runs" / "confidence" / "stills.npz", [recording.depth(i) for i in chosen.tolist()]
    save_recording(stills, depth=depth, camera=recording.camera, timestamps=APART_SECONDS * np.arange(STILLS))
    films: dict[str, Any] = {source: (recording, slice(None)), "photographs": (open_recording(stills), chosen)}
    return [
        row
        for kind, (film, rows) in films.items()
        for row in tracked_rows(tracker, (kind, person), film, tuple(r[None, rows] for r in references), work)
    ]


def tracked_rows(
    tracker: HybridTracker,
    about: tuple[str, str],
    recording: Recording,
    references: Any,
    work: Path,
    people: int | None = 1,
) -> list[Rows]:
    """Return tracked rows beside the nearest person of the references: plain and in time, (N, T, 20, 3), metres."""
    run = work / "runs" / "confidence" / recording.name
    shutil.rmtree(run, ignore_errors=True)
    track_recording(recording, tracker, run, people=people)
    found = []
    for person in load_persons(run) if person_runs(run) else ():
        track = person.track
        ours = track.joints.astype(np.float64)
        distances = np.linalg.norm(references[0][:, : len(track)] - ours, axis=3).mean(axis=2)
        nearest = np.argmin(np.where(np.isfinite(distances), distances, np.inf), axis=0)
        plain, theirs = (each[nearest, np.arange(len(track))] for each in references)
        known = (track.state == TRACKED) & np.isfinite(plain + theirs).all(axis=(1, 2))
        if (rows := np.flatnonzero(known)).size:
            apart = np.einsum("tca,tjc->tja", torso_frames(ours[rows]), theirs[rows] - ours[rows])
            distance = np.linalg.norm(plain[rows] - ours[rows], axis=2)
            found.append(Rows(*about, apart, distance, track.confidence[rows]))
    shutil.rmtree(run)
    return found


def offsets_of(rows: Sequence[Rows]) -> dict[str, np.ndarray]:
    """Return the median offset of each joint from ours to the SDK's in the torso's frame, (20, 3) metres, by person."""
    people = {r.person for r in rows if r.person}
    return {p: np.median(np.concatenate([r.apart for r in rows if r.person == p]), axis=0) for p in people}


def distances(rows: Rows, offsets: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the distances (F, 20) from the reference in time, metres, without the offsets of the person."""
    return np.linalg.norm(rows.apart - offsets.get(rows.person, 0.0), axis=2)


@benchmark(takes=1, work=WORK, every=3)
def judge(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure the calibration on other people and draw it."""
    tracker = HybridTracker(PoseDatabase.load(DEFAULT_DATABASE), database_path=str(DEFAULT_DATABASE))
    files, rows = files_of("report", PEOPLE, options.every, options.takes), list[Rows]()
    for i, (source, file) in enumerate(files):
        rows += rows_of(tracker, source, file, options.work)
        print(f"\r{i + 1} of {len(files)} tracked", end="", flush=True)
    print()
    return "confidence", judged(rows)


def judged(rows: Sequence[Rows]) -> dict[str, dict[str, float]]:
    """Return the figures of each source, and draw them."""
    offsets, figures, curves = offsets_of(rows), {}, {}
    for source in sources(rows):
        own = [r for r in rows if r.source == source]
        confidence = np.concatenate([r.confidence for r in own])
        plain = np.concatenate([r.plain for r in own])
        in_time, true = (np.concatenate([distances(r, moved) for r in own]) for moved in ({}, offsets))
        curves[source] = confidence.ravel(), true.ravel() <= RELIABLE_WITHIN
        figures[source] = {
            "frames": len(confidence),
            "confidence": float(confidence.mean()),
            "ece": calibration_error(*curves[source]),
            "ece_plain": calibration_error(confidence.ravel(), plain.ravel() <= RELIABLE_WITHIN),
            "within_100_mm": float((true <= RELIABLE_WITHIN).mean()),
            "within_100_mm_plain": float((plain <= RELIABLE_WITHIN).mean()),
        } | {
            f"{name}{which}": value
            for which, measured in (("_in_time", in_time), ("_plain", plain))
            for name, value in gross_wrists(confidence, measured).items()
        }
    draw(curves)
    return figures


def gross_wrists(confidence: np.ndarray, measured: np.ndarray) -> dict[str, float]:
    """Return the share of wrists over `GROSS` from the reference, and the share of these that are surer than `SURE`."""
    gross = measured[:, WRISTS] > GROSS
    sure = confidence[:, WRISTS][gross] > SURE
    return {"wrists_over_250_mm": float(gross.mean()), "of_these_sure": float(sure.mean()) if len(sure) else 0.0}


def sources(rows: Sequence[Rows]) -> list[str]:
    """Return the names of the sources in their order."""
    return list(dict.fromkeys(r.source for r in rows))


def draw(curves: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """Draw the fraction of joints that are right against the confidence, with the number of joints below."""
    middles = (np.arange(BINS) + 0.5) / BINS
    with drawn(PICTURE, (5.2, 5.4), 2, sharex=True, height_ratios=(3, 1)) as (above, below):
        above.plot([0, 1], [0, 1], color="0.7", lw=0.8)
        for name, (confidence, right) in curves.items():
            number = np.minimum((confidence * BINS).astype(np.int64), BINS - 1)
            counts, said, found = (np.bincount(number, w, minlength=BINS) for w in (None, confidence, right))
            enough = counts >= 50
            mean, share = said[enough] / counts[enough], found[enough] / counts[enough]
            (line,) = above.plot(mean, share, "o-", ms=4, lw=1.2, label=LABELS[name])
            below.step(middles, counts / counts.sum(), where="mid", color=line.get_color(), lw=1.2)
        above.set(ylabel="joints within 10 cm", xlim=(0, 1), ylim=(0, 1))
        above.legend(frameon=False, loc="lower right", fontsize=9)
        below.set(xlabel="confidence", ylabel="fraction of joints", ylim=(0, 1))


LABELS = {
    "utd_mhad": "UTD-MHAD, people 5 and 7", "msr_action3d": "MSR Action3D, people 4 and 5",
    "photographs": "single frames of both", "simulated": "simulated, report split",
}  # fmt: skip


main = script(__name__, __doc__, {"judge": judge})
