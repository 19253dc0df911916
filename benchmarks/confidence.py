"""Confidence of joints: `depthmocap bench confidence PART`, which is one of

- `fit`: track the training recordings and write the regressions of `toolkit/fitting/assets/confidence.json`: UTD-MHAD
  (people 1 and 3), MSR Action3D (1, 2 and 3), and `--takes` recordings of each group of the clean suite and of the
  scenes (tuning split). Of each real recording, `STILLS` frames are tracked as photographs, too. A joint is right
  within 10 cm. The Kinect SDK's joints are those of the moment that the depth shows (`bench real lag`), without the
  person's median offset of each joint in the frame of the torso: it is the difference of two definitions.
- `judge`: the same of other people: UTD-MHAD 5 and 7, MSR Action3D 4 and 5, and the report split. Prints calibration
  errors with and without these corrections, the share of wrists over 250 mm from the SDK's that are surer than 0.7,
  and draws the reliability.

`--every N` takes every N-th recording of each real person.
"""

import argparse
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import benchmark, drawn, script
from benchmarks.real import SHIFTS
from tests.support.calibration import BINS, calibration_error
from tests.support.scenes import GROUPS, chosen_scenes, record_scene
from tests.support.suite import WORK, chosen_takes
from toolkit.app.pipeline import track_recording
from toolkit.body import skeleton
from toolkit.database.database import PoseDatabase
from toolkit.database.default import DEFAULT_DATABASE
from toolkit.datasets.folder import data_folder
from toolkit.evaluation.agreement import shifted, torso_frames
from toolkit.fitting import joint_confidence as model
from toolkit.fitting.joint_confidence import FEATURES, WITHIN, WITHOUT_NETWORK, JointConfidence
from toolkit.io.files import save_json
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.recordings.writer import save_recording
from toolkit.sensing.recording import Recording
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracks import TRACKED
from toolkit.tracks.runs import load_persons, person_runs

PEOPLE = {"fit": {"utd_mhad": "13", "msr_action3d": "123"}, "judge": {"utd_mhad": "57", "msr_action3d": "45"}}
"""People of each part and data set, by the numbers in the names of their files."""
SPLITS = {"fit": "tune", "judge": "report"}
"""Split of the simulated suites of each part."""
GROSS, SURE = 0.25, 0.7
"""Metres from the SDK's joint and confidence from which a wrist is wrong without warning."""
WEIGHTS = {"films": 0.7, "photographs": 0.2, "simulated": 0.1}
"""Weight of all joints of a kind together: the confidence is for real people, and photographs have uncovered limbs."""
STILLS, APART_SECONDS = 4, 10.0
"""Number of photographs of each real recording, and seconds between them, too long to track a pose."""
REGULARISATION = 10.0
"""Inverse strength of the L2 penalty of the regressions, whose inputs lie in [0, 1]."""
SIGNS = tuple(1 if name in ("support", "observed", "precision") else -1 for name in FEATURES)
"""Direction in which each input changes the odds; the others raise doubt."""
PICTURE = Path(__file__).parents[1] / "docs" / "images" / "confidence.png"
OPTIONS: dict[str, Any] = {"takes": 1, "work": WORK}
"""Options of both parts: simulated recordings of each group, and work folder."""
WRISTS = [skeleton.REPORTED.index(f"{side}_wrist") for side in ("left", "right")]


class WatchedConfidence(JointConfidence):
    """Regressions that keep the inputs of each row, by the confidence that they returned for it.

    Attributes
    ----------
    inputs : bytes of a float32 (20,) confidence -> float64 (20, 9): features and distance between both passes
    """

    def __init__(self, content: dict[str, Any]) -> None:
        super().__init__(content)
        self.inputs: dict[bytes, np.ndarray] = {}

    def of(self, features: np.ndarray) -> np.ndarray:
        """See `JointConfidence.of`."""
        confidence = super().of(features)
        unknown = np.full((len(features), 1), np.nan)
        self.inputs[confidence.astype(np.float32).tobytes()] = np.concatenate([features, unknown], axis=1)
        return confidence

    def of_both(self, confidence: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """See `JointConfidence.of_both`."""
        both = super().of_both(confidence, apart)
        own = self.inputs[confidence.astype(np.float32).tobytes()].copy()
        own[:, -1] = apart
        self.inputs[both.astype(np.float32).tobytes()] = own
        return both


class WatchedTracker(HybridTracker):
    """Hybrid tracker with the default settings and database, and watched regressions."""

    def __init__(self) -> None:
        self.watched = WatchedConfidence(model.joint_confidence().content)
        super().__init__(PoseDatabase.load(DEFAULT_DATABASE), database_path=str(DEFAULT_DATABASE))

    @property
    def regressions(self) -> JointConfidence:
        """See `SearchingTracker.regressions`."""
        return self.watched


@dataclass(frozen=True, eq=False)
class Rows:
    """Tracked frames of one person with a reference.

    Attributes
    ----------
    source : data set, "photographs" or "simulated"
    person : data set and number of a real person
    inputs : float64 (F, 20, 9), see `WatchedConfidence.inputs`
    apart : float64 (F, 20, 3), metres, from our joints to those of the reference in the torso's frame, in time
    plain : float64 (F, 20), metres, distances from the reference in the same row of the file
    confidence : float32 (F, 20)
    """

    source: str
    person: str
    inputs: np.ndarray
    apart: np.ndarray
    plain: np.ndarray
    confidence: np.ndarray


def real_files(part: str, every: int) -> Iterator[tuple[str, Path]]:
    """Yield data set and file of the recordings of a part's people."""
    for name, people in PEOPLE[part].items():
        files = sorted((data_folder() / "depth" / name).glob("*_depth.mat"))
        for person in people:
            own = [file for file in files if f"_s{person}_" in file.name]
            yield from ((name, file) for file in own[::every])


def simulated_files(part: str, takes: int) -> list[Path]:
    """Return recordings of the clean suite and of the scenes, made if they are not there yet."""
    people = [group for group in GROUPS if group != "empty"]
    scenes = [*chosen_takes(SPLITS[part], (), takes), *chosen_scenes(SPLITS[part], tuple(people), takes)]
    return [record_scene(scene, WORK) for scene in scenes]


def rows_of(tracker: WatchedTracker, source: str, file: Path, work: Path) -> list[Rows]:
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
    tracker: WatchedTracker,
    about: tuple[str, str],
    recording: Recording,
    references: Any,
    work: Path,
    people: int | None = 1,
) -> list[Rows]:
    """Track a recording; return the tracked rows of its people beside the nearest person of the reference.

    `about` : source and person; `references` : plain and in time, float64 (N, T, 20, 3) each, metres
    """
    run = work / "runs" / "confidence" / recording.name
    shutil.rmtree(run, ignore_errors=True)
    tracker.watched.inputs.clear()
    track_recording(recording, tracker, run, people=people)
    found = []
    for person in load_persons(run) if person_runs(run) else ():
        track = person.track
        inputs = [tracker.watched.inputs.get(row.tobytes()) for row in track.confidence]
        ours = track.joints.astype(np.float64)
        distances = np.linalg.norm(references[0][:, : len(track)] - ours, axis=3).mean(axis=2)
        nearest = np.argmin(np.where(np.isfinite(distances), distances, np.inf), axis=0)
        plain, theirs = (each[nearest, np.arange(len(track))] for each in references)
        known = (track.state == TRACKED) & np.isfinite(plain + theirs).all(axis=(1, 2))
        rows = [t for t in np.flatnonzero(known).tolist() if inputs[t] is not None]
        if rows:
            apart = np.einsum("tca,tjc->tja", torso_frames(ours[rows]), theirs[rows] - ours[rows])
            distance = np.linalg.norm(plain[rows] - ours[rows], axis=2)
            seen = np.stack([inputs[t] for t in rows])
            found.append(Rows(*about, seen, apart, distance, track.confidence[rows]))
    shutil.rmtree(run)
    return found


def all_rows(part: str, options: argparse.Namespace) -> list[Rows]:
    """Track all recordings of a part."""
    files = [*real_files(part, options.every), *(("simulated", file) for file in simulated_files(part, options.takes))]
    tracker, found = WatchedTracker(), []
    for i, (source, file) in enumerate(files):
        found += rows_of(tracker, source, file, options.work)
        print(f"\r{i + 1} of {len(files)} tracked", end="", flush=True)
    print()
    return found


def offsets_of(rows: Sequence[Rows]) -> dict[str, np.ndarray]:
    """Return the median offset of each joint from ours to the SDK's in the torso's frame, (20, 3) metres, by person."""
    people = {r.person for r in rows if r.person}
    return {p: np.median(np.concatenate([r.apart for r in rows if r.person == p]), axis=0) for p in people}


def distances(rows: Rows, offsets: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the distances (F, 20) from the reference in time, metres, without the offsets of the person."""
    return np.linalg.norm(rows.apart - offsets.get(rows.person, 0.0), axis=2)


def fitted(inputs: np.ndarray, right: np.ndarray, weights: np.ndarray, signs: Sequence[int]) -> np.ndarray:
    """Return intercept and coefficients of a logistic regression, each coefficient with its sign or zero."""
    from scipy.optimize import minimize

    columns = np.concatenate([np.ones((len(inputs), 1)), inputs], axis=1)
    sides = np.where(right, 1.0, -1.0)

    def loss(coefficients: np.ndarray) -> tuple[float, np.ndarray]:
        odds = sides * (columns @ coefficients)
        slopes = -weights * sides / (1.0 + np.exp(np.clip(odds, -500.0, 500.0)))
        penalty = coefficients * ([0.0] + [1.0] * len(signs)) / REGULARISATION
        total = float(weights @ np.logaddexp(0.0, -odds) + 0.5 * penalty @ coefficients)
        return total, columns.T @ slopes + penalty

    bounds = [(None, None), *((0.0, None) if sign > 0 else (None, 0.0) for sign in signs)]
    return np.asarray(minimize(loss, np.zeros(len(bounds)), jac=True, method="L-BFGS-B", bounds=bounds).x)


def regressions(rows: Sequence[Rows]) -> dict[str, Any]:
    """Fit all regressions: the content of `joint_confidence.ASSET`."""
    offsets = offsets_of(rows)
    counts = {kind: sum(len(r.inputs) for r in rows if kind_of(r) == kind) for kind in WEIGHTS}
    total = sum(counts.values())
    weight = np.concatenate([np.full(len(r.inputs), WEIGHTS[k] * total / counts[k]) for r in rows if (k := kind_of(r))])
    inputs = np.concatenate([r.inputs for r in rows])
    right = np.concatenate([distances(r, offsets) <= WITHIN for r in rows])
    content: dict[str, Any] = {"network": {}, "depth": {}, "passes": {}}
    for group in model.GROUPS:
        columns = [k for k, name in enumerate(skeleton.REPORTED) if model.group_of(name) == group]
        own, labels = inputs[:, columns].reshape(-1, inputs.shape[2]), right[:, columns].ravel()
        weights = np.repeat(weight, len(columns))
        features, apart = own[:, : len(FEATURES)], own[:, -1]
        for name, count in (("network", len(FEATURES)), ("depth", WITHOUT_NETWORK)):
            content[name][group] = fitted(features[:, :count], labels, weights, SIGNS[:count]).round(4).tolist()
        table = content["network"][group]
        odds, both = table[0] + features @ table[1:], np.isfinite(apart)
        pairs = np.stack([odds, model.bounded(apart, model.SCALES["apart"])], axis=1)[both]
        content["passes"][group] = fitted(pairs, labels[both], weights[both], (1, -1)).round(4).tolist()
    return content


@benchmark(OPTIONS, every=2)
def fit(options: argparse.Namespace) -> tuple[str, Any]:
    """Fit the regressions and write the asset."""
    rows = all_rows("fit", options)
    content = regressions(rows)
    about = {
        "command": f"depthmocap bench confidence fit --every {options.every} --takes {options.takes}",
        "features": list(FEATURES),
        "frames": {source: sum(len(r.inputs) for r in rows if r.source == source) for source in sources(rows)},
    }
    save_json(model.ASSET, {"about": about, **content})
    return "", about["frames"]


@benchmark(OPTIONS, every=3)
def judge(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure the calibration on other people and draw it."""
    return "confidence", judged(all_rows("judge", options))


def judged(rows: Sequence[Rows]) -> dict[str, dict[str, float]]:
    """Return the figures of each source, and draw them."""
    offsets, figures, curves = offsets_of(rows), {}, {}
    for source in sources(rows):
        own = [r for r in rows if r.source == source]
        confidence = np.concatenate([r.confidence for r in own])
        plain = np.concatenate([r.plain for r in own])
        in_time, true = (np.concatenate([distances(r, moved) for r in own]) for moved in ({}, offsets))
        curves[source] = confidence.ravel(), true.ravel() <= WITHIN
        figures[source] = {
            "frames": len(confidence),
            "confidence": float(confidence.mean()),
            "ece": calibration_error(*curves[source]),
            "ece_plain": calibration_error(confidence.ravel(), plain.ravel() <= WITHIN),
            "within_100_mm": float((true <= WITHIN).mean()),
            "within_100_mm_plain": float((plain <= WITHIN).mean()),
        } | {
            f"{name}{which}": value
            for which, measured in (("_in_time", in_time), ("_plain", plain))
            for name, value in gross_wrists(confidence, measured).items()
        }
    draw(curves)
    return figures


def kind_of(rows: Rows) -> str:
    """Return the entry of `WEIGHTS` of some rows."""
    return rows.source if rows.source in WEIGHTS else "films"


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


main = script(__name__, __doc__, {"fit": fit, "judge": judge})
