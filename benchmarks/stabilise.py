"""Occluded limbs by motion classes: `depthmocap bench stabilise classes [--split report] [--config hybrid]`.

Sequences of one actor's clips (`tests/support/labelled.py`) are simulated, tracked, and stabilised with classes of the
other actors; the labels are compared with the performed motions. `--noise 200` adds Gaussian noise of 200 mm to each
measured pixel: the thesis's second experiment (6.5: 15 % of the range of its colours, here of 1.3 m of depth).

Figures are the mean error over joints and frames, its standard deviation and largest value over the frames (Table 6.1),
of visible and of hidden joints, before and after, and a plot frame by frame (Fig. 6.14).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._record import RESULTS, run_part, save_figures
from benchmarks._rows import add_database_options, poses_of
from tests.support.labelled import SEQUENCES, MotionSequence, Performed, class_clips, record_sequence
from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.app.stabilise.result_page import write_page
from toolkit.app.stabilise.source_run import SourceRun, open_source
from toolkit.app.stabilise.stabiliser import Stabilised, StabiliseSettings, annotate, stabilise
from toolkit.evaluation.joint_errors import CORRECT_WITHIN, joint_errors, visible_joints
from toolkit.io.files import save_bytes
from toolkit.io.html import png_of
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.measures import Scores, frame_scores, label_frames, segment_scores
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import relational_features
from toolkit.retrieval.workflow.learn import learn_templates
from toolkit.sensing.recording import Recording
from toolkit.tracks import TRACK_FILE, Track

FIGURES = ("mean mm", "seen mm", "hidden mm", "hidden within 100 mm", "deviation mm", "largest mm")
LINES = {"before": "tab:red", "after": "black"}
NOTHING = Scores(0, 0, 0, 0)


def visible(recording: Recording) -> np.ndarray:
    """Return the true joints that the camera sees: bool (T, 20)."""
    assert recording.joints is not None  # simulated
    frames = zip(recording.joints, recording.stream(), strict=True)
    return np.array([visible_joints(j, f.depth_mm.astype(np.float32) / 1000, recording.camera) for j, f in frames])


def figures_of(track: Track, truth: np.ndarray, seen: np.ndarray) -> list[float]:
    """Return `FIGURES` of a track."""
    errors = joint_errors(track.joints, truth)
    hidden = errors[~seen] if (~seen).any() else np.zeros(1)
    frames = 1000 * errors.mean(axis=1)
    near = float((hidden < CORRECT_WITHIN).mean())
    means = [1000 * errors.mean(), 1000 * errors[seen].mean(), 1000 * hidden.mean(), near]
    return [*means, float(frames.std()), float(frames.max())]


def labels_of(found: Stabilised, performed: Performed, classes: list[MotionClass]) -> tuple[Scores, Scores]:
    """Return the scores of the labels of a track, over segments and over frames."""
    labels = [c.label for c in classes]
    length = len(performed.clip)
    frames = [label_frames(s, labels, length, performed.clip.frame_rate) for s in (performed.segments, found.segments)]
    return segment_scores(performed.segments, found.segments), frame_scores(*frames)


def labels_of_truth(
    performed: Performed, classes: list[MotionClass], settings: StabiliseSettings
) -> tuple[Scores, Scores]:
    """Return the same scores for the true motions."""
    clip = performed.clip
    features = relational_features(from_poses(clip.poses, performed.body, clip.frame_rate, clip.name))
    labels, size = [c.label for c in classes], (len(features), features.frame_rate)
    found = annotate(features, classes, settings.threshold)
    segments = found.segments if found else ()
    frames = [label_frames(part, labels, *size) for part in (performed.segments, segments)]
    return segment_scores(performed.segments, segments), frame_scores(*frames)


def noisy(path: Path, mm: float) -> Path:
    """Return a recording with Gaussian noise of a standard deviation in millimetres on all measured pixels."""
    out = path.with_name(f"{path.stem}_noise{mm:g}.npz")
    if mm == 0.0 or out.exists():
        return out if mm else path
    recording, rng = open_recording(path), np.random.default_rng(0)

    def frames() -> Iterator[np.ndarray]:
        for frame in recording.stream():
            depth = frame.depth_mm + rng.normal(0.0, mm, frame.depth_mm.shape)
            yield np.where(frame.depth_mm > 0, np.maximum(depth, 1.0), 0.0).astype(np.uint16)

    save_recording(
        out, depth=frames(), camera=recording.camera, timestamps=recording.timestamps, joints=recording.joints,
        background=recording.background, up_camera=recording.up_camera,
    )  # fmt: skip
    return out


def tracked(sequence: MotionSequence, database: Path, options: argparse.Namespace) -> tuple[Path, Performed]:
    """Return the sequence's run folder, made unless present, and its performance."""
    path, performed = record_sequence(sequence, options.split, options.work)
    path = noisy(path, options.noise)
    run = options.work / "sequences" / "runs" / options.config / path.stem
    if not (run / TRACK_FILE).exists():
        tracker = TrackerRecipe(options.config, database=database).build()
        track_recording(open_recording(path), tracker, run, warm_up=False)
    return run, performed


class Measured(NamedTuple):
    """Figures of one sequence: its row, scores of its labels and of those of the true motions (over segments, over
    frames), number of frames with foot contact, and errors (T,) of the frames, mm, before and after.
    """

    row: dict[str, Any]
    labels: tuple[Scores, Scores]
    true_labels: tuple[Scores, Scores]
    contact_frames: int
    errors: list[np.ndarray]


def measured(
    name: str, source: SourceRun, performed: Performed, classes: list[MotionClass], settings: StabiliseSettings,
    options: argparse.Namespace,
) -> Measured:  # fmt: skip
    """Stabilise a track and compare it with the truth."""
    start = time.process_time()
    result = stabilise(source, classes, settings)
    seconds = time.process_time() - start
    tracks = [source.track, result.track]
    labels = labels_of(result, performed, classes)
    if options.pages:
        (options.pages / name).mkdir(parents=True, exist_ok=True)
        write_page(source, result, options.pages / name)
    truth, seen = np.asarray(source.recording.joints), visible(source.recording)
    own = [figures_of(track, truth, seen) for track in tracks]
    print(name, " | ".join(" ".join(f"{v:.2f}" if v <= 1 else f"{v:.1f}" for v in f) for f in own), flush=True)
    row = {
        "frames": len(source.track),
        **{kind: dict(zip(FIGURES, f, strict=True)) for kind, f in zip(LINES, own, strict=True)},
        "F segments": labels[0].f, "F frames": labels[1].f, "seconds of processor": seconds,
    }  # fmt: skip
    errors = [1000 * joint_errors(track.joints, truth).mean(axis=1) for track in tracks]
    return Measured(row, labels, labels_of_truth(performed, classes, settings), result.contact_frames, errors)


def classes(parser: argparse.ArgumentParser) -> None:
    """Track, stabilise, compare, print, write JSON."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--config", default="hybrid", help="settings of the tracker")
    parser.add_argument("--sequences", nargs="*", help="names of some; all")
    parser.add_argument("--noise", type=float, default=0.0, help="standard deviation of every depth, millimetres")
    parser.add_argument("--pages", type=Path, help="folder for the pages of `depthmocap stabilise`, with pictures")
    add_database_options(parser)
    options = parser.parse_args()
    settings = StabiliseSettings()
    database, classes = poses_of(options), learn_templates(class_clips(options.split))
    done: dict[str, Measured] = {}
    for sequence in SEQUENCES:
        if not options.sequences or sequence.name in options.sequences:
            run, performed = tracked(sequence, database, options)
            done[sequence.name] = measured(
                sequence.name, open_source(run, database=database), performed, classes, settings, options
            )
    rows = {name: found.row for name, found in done.items()}
    labels: dict[str, Any] = {}
    for words, kind in (("", "labels"), (", true motions", "true_labels")):
        segments, frames = (sum((getattr(found, kind)[k] for found in done.values()), NOTHING) for k in (0, 1))
        labels |= {f"F segments{words}": segments.f, f"F frames{words}": frames.f}
    labels["frames with a held foot"] = sum(found.contact_frames for found in done.values())
    figures = {"sequences": rows, **_summary(rows), **labels}
    for name, value in figures.items():
        if name != "sequences":
            print(name, value)
    marks = [
        options.split,
        *([options.config] if options.config != "hybrid" else []),
        *["noise"] * bool(options.noise),
    ]
    name = "_".join(["stabilise", *marks])
    plot_errors({name: found.errors for name, found in done.items()}, RESULTS / f"{name}_frames.jpg")
    print("written:", save_figures(name, figures, {**asdict(settings), "noise mm": options.noise}))


def plot_errors(errors: Mapping[str, Sequence[np.ndarray]], path: Path) -> None:
    """Draw the errors (T,) in mm frame by frame, before and after, as in Fig. 6.14."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 1.2 + 1.6 * len(errors)), layout="constrained")
    for panel, (name, curves) in zip(np.atleast_1d(figure.subplots(len(errors), 1)), errors.items(), strict=True):
        for (label, color), curve in zip(LINES.items(), curves, strict=True):
            panel.plot(curve, color=color, lw=1.0, label=label)
        panel.set(xlim=(0, len(curves[0]) - 1), ylim=(0, None), ylabel="mm")
        panel.set_title(name, fontsize=9, loc="left")
    figure.axes[0].legend(fontsize=7, ncols=3, frameon=False)
    figure.axes[-1].set_xlabel("frame")
    save_bytes(path, png_of(figure))


def _summary(rows: dict[str, Any]) -> dict[str, Any]:
    """Return means over the sequences, and the largest deterioration."""

    def mean(kind: str) -> dict[str, float]:
        return {name: float(np.mean([row[kind][name] for row in rows.values()])) for name in FIGURES}

    harm = [row["after"]["mean mm"] - row["before"]["mean mm"] for row in rows.values()]
    return {**{kind: mean(kind) for kind in LINES}, "most harm mm": float(max(harm))}


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"classes": classes})


if __name__ == "__main__":
    main()
