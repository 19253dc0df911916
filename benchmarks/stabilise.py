"""Occluded limbs by motion classes: `depthmocap bench stabilise classes [--split report]`.

Sequences of one actor's clips (`tests/support/labelled.py`) are simulated, tracked, and stabilised with classes of the
other actors; the labels are compared with the performed motions. Figures are the mean error over joints and frames, its
standard deviation and largest value over the frames (Table 6.1), of visible and of hidden joints, before and after, and
a plot frame by frame (Fig. 6.14).
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import RESULTS, benchmark, drawn, script
from benchmarks._rows import DATABASE, SPLIT, poses_of
from tests.support.labelled import SEQUENCES, MotionSequence, Performed, class_clips, record_sequence
from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.app.stabilise.source_run import open_source
from toolkit.app.stabilise.stabiliser import Stabilised, stabilise
from toolkit.evaluation.joint_errors import CORRECT_WITHIN, joint_errors, visible_joints
from toolkit.recordings.opening import open_recording
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.measures import Scores, frame_scores, label_frames, segment_scores
from toolkit.retrieval.workflow.learn import learn_templates
from toolkit.sensing.recording import Recording
from toolkit.tracks import TRACK_FILE, Track

LINES = {"before": "tab:red", "after": "black"}
"""Colours of the tracks."""


def visible(recording: Recording) -> np.ndarray:
    """Return the true joints that the camera sees: bool (T, 20)."""
    assert recording.joints is not None  # simulated
    frames = zip(recording.joints, recording.stream(), strict=True)
    return np.array([visible_joints(j, f.depth_mm.astype(np.float32) / 1000, recording.camera) for j, f in frames])


def figures_of(track: Track, truth: np.ndarray, seen: np.ndarray) -> dict[str, float]:
    """Return the errors of a track."""
    errors = joint_errors(track.joints, truth)
    hidden = errors[~seen] if (~seen).any() else np.zeros(1)
    frames = 1000 * errors.mean(axis=1)
    return {
        "mean mm": 1000 * float(errors.mean()),
        "seen mm": 1000 * float(errors[seen].mean()),
        "hidden mm": 1000 * float(hidden.mean()),
        "hidden within 100 mm": float((hidden < CORRECT_WITHIN).mean()),
        "deviation mm": float(frames.std()),
        "largest mm": float(frames.max()),
    }


def labels_of(found: Stabilised, performed: Performed, classes: Sequence[MotionClass]) -> tuple[Scores, Scores]:
    """Return the scores of the labels of a track, over segments and over frames."""
    labels, size = [c.label for c in classes], (len(performed.clip), performed.clip.frame_rate)
    frames = [label_frames(part, labels, *size) for part in (performed.segments, found.segments)]
    return segment_scores(performed.segments, found.segments), frame_scores(*frames)


def tracked(sequence: MotionSequence, database: Path, options: argparse.Namespace) -> tuple[Path, Performed]:
    """Return the sequence's run folder, made unless present, and its performance."""
    path, performed = record_sequence(sequence, options.split, options.work)
    run = options.work / "sequences" / "runs" / path.stem
    if not (run / TRACK_FILE).exists():
        track_recording(open_recording(path), TrackerRecipe(database=database).build(), run)
    return run, performed


Measured = tuple[dict[str, Any], tuple[Scores, Scores], list[np.ndarray]]
"""Figures of one sequence, scores of its labels (segments, frames), and errors (T,) before and after, mm."""


def measured(run: Path, database: Path, performed: Performed, classes: Sequence[MotionClass]) -> Measured:
    """Stabilise a track and compare it with the truth."""
    source = open_source(run, database=database)
    result = stabilise(source, list(classes))
    labels = labels_of(result, performed, classes)
    truth, seen = np.asarray(source.recording.joints), visible(source.recording)
    tracks = dict(zip(LINES, (source.track, result.track), strict=True))
    row: dict[str, Any] = {name: figures_of(track, truth, seen) for name, track in tracks.items()}
    row |= {"F segments": labels[0].f, "F frames": labels[1].f}
    return row, labels, [1000 * joint_errors(t.joints, truth).mean(axis=1) for t in tracks.values()]


@benchmark(SPLIT, DATABASE)
def classes(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and stabilise all sequences, and plot their errors."""
    database, known = poses_of(options), learn_templates(class_clips(options.split))
    done: dict[str, Measured] = {}
    for sequence in SEQUENCES:
        run, performed = tracked(sequence, database, options)
        done[sequence.name] = measured(run, database, performed, known)
    rows = {name: row for name, (row, _, _) in done.items()}
    segments, frames = (sum((labels[k] for _, labels, _ in done.values()), Scores(0, 0, 0, 0)) for k in (0, 1))
    name = f"stabilise_{options.split}"
    plot_errors({name: errors for name, (_, _, errors) in done.items()}, RESULTS / f"{name}_frames.jpg")
    return name, {"sequences": rows, **summary(rows), "F segments": segments.f, "F frames": frames.f}


def plot_errors(errors: Mapping[str, Sequence[np.ndarray]], path: Path) -> None:
    """Draw the errors (T,) in mm frame by frame, before and after, as in Fig. 6.14."""
    with drawn(path, (11, 1.2 + 1.6 * len(errors)), len(errors)) as panels:
        for panel, (name, curves) in zip(panels, errors.items(), strict=True):
            for (label, color), curve in zip(LINES.items(), curves, strict=True):
                panel.plot(curve, color=color, lw=1.0, label=label)
            panel.set(xlim=(0, len(curves[0]) - 1), ylim=(0, None), ylabel="mm")
            panel.set_title(name, fontsize=9, loc="left")
        panels[0].legend(fontsize=7, ncols=3, frameon=False)
        panels[-1].set_xlabel("frame")


def summary(rows: Mapping[str, Any]) -> dict[str, Any]:
    """Return means over the sequences, and the largest deterioration."""
    means = {
        kind: {name: float(np.mean([row[kind][name] for row in rows.values()])) for name in first}
        for kind, first in next(iter(rows.values())).items()
        if kind in LINES
    }
    harm = [row["after"]["mean mm"] - row["before"]["mean mm"] for row in rows.values()]
    return {**means, "most harm mm": float(max(harm))}


main = script(__name__, __doc__, {"classes": classes})
