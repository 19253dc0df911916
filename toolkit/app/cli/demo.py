"""The verb `depthmocap demo`: the whole pipeline on bundled motions or on downloaded real frames."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from toolkit.app.cli.terminal import doing_words, next_commands, print_lines, print_table, progress_bars
from toolkit.io.errors import DataError
from toolkit.io.progress import Progress, silent

if TYPE_CHECKING:
    from toolkit.app.pipeline.run_summary import RunSummary
    from toolkit.evaluation.scores import EvaluationTable
    from toolkit.sensing.recording import Recording

REAL = "two-people"
"""Data set of the real demo."""


class DemoResult(NamedTuple):
    """Result of a demo: summary, scores of a simulated recording, run folder, and the written files in order."""

    summary: RunSummary
    table: EvaluationTable | None
    run: Path
    files: list[Path]


def run_demo(
    output: str | Path,
    *,
    real: bool = False,
    seconds: float = 5.0,
    show: Progress = silent,
) -> DemoResult:
    """Track a recording, score it if it is simulated, draw the film and the page.

    Parameters
    ----------
    output : folder of all files; replaces an earlier demo
    real : download 20 real depth frames of two men; else simulate motions outside the database
    seconds : duration of each simulated motion
    show : called with each step

    Raises
    ------
    DataError
        The real frames are not in the data folder and cannot be downloaded.
    OutputError
        The folder cannot be written.
    """
    from toolkit.app.pipeline import TrackerRecipe, track_recording
    from toolkit.database import DEFAULT_DATABASE
    from toolkit.evaluation.evaluate import evaluate_runs
    from toolkit.evaluation.scores import write_evaluation
    from toolkit.output.rendering.film import render_run
    from toolkit.output.report.page import write_report
    from toolkit.tracks import PARTIAL_FILE

    folder, prefix = Path(output), "real_" if real else ""
    run = folder / f"{prefix}run"
    recording = _real_recording(folder, show) if real else _simulated_recording(folder, seconds, show)
    for unfinished in run.rglob(PARTIAL_FILE):
        unfinished.unlink()
    summary = track_recording(
        recording, TrackerRecipe(database=DEFAULT_DATABASE).build(), run, people=None if real else 1,
        progress=lambda name, doing, done, total: show(doing_words(doing), done, total),
    )  # fmt: skip
    files, table = [recording.path, run], None
    if not real:
        table = evaluate_runs([run], progress=lambda name, done, total: show("evaluating", done, total))
        files += write_evaluation(table, folder)
    for name in (f"{prefix}film.webm", f"{prefix}contact_sheet.png"):
        files.append(render_run(run, folder / name, progress=partial(show, f"drawing {name}")))
    page = write_report(
        [run], folder / f"{prefix}report.html",
        progress=lambda doing, done, total: show(f"writing the page: {doing}", done, total),
    )  # fmt: skip
    return DemoResult(summary, table, run, [*files, page])


def _simulated_recording(folder: Path, seconds: float, show: Progress) -> Recording:
    """Simulate a recording of three motions, none of which the database contains."""
    from toolkit.body.shape import subject_body
    from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
    from toolkit.simulation.joining import joined
    from toolkit.simulation.simulate import simulate_recording

    subject = subject_body("slim_male", seed=7)
    clips = procedural_clips(SUBJECT_MOTIONS[:3], body=subject, variations=1, seed=0)
    frames = int(seconds * clips[0].frame_rate)
    poses, _ = joined([clip.poses[:frames] for clip in clips])
    motion = replace(clips[0], name="+".join(clip.name for clip in clips), poses=poses)
    return simulate_recording(
        motion, folder / "take.npz", body=subject, sensor="tof", yaw=10.0,
        progress=partial(show, "simulating a recording"),
    )  # fmt: skip


def _real_recording(folder: Path, show: Progress) -> Recording:
    """Fetch the real frames and open a copy of them."""
    from toolkit.datasets.fetch import fetch_data_set
    from toolkit.datasets.registry import data_set_of
    from toolkit.io.files import atomic_path
    from toolkit.recordings.opening import open_upright

    data_set = data_set_of(REAL)
    fetched = fetch_data_set(data_set, progress=show)
    for file in data_set.files:  # copied, so that the run refers to files in the same folder
        inside = Path(file.path).relative_to(data_set.folder)
        with atomic_path(folder / REAL / inside, lasting=False) as temporary:
            shutil.copyfile(fetched / inside, temporary)
    return open_upright(folder / REAL / "images_n40")


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Output folder.")] = Path("demo"),
    real: Annotated[
        bool, typer.Option("--real", help="Download and track 20 real frames of two people (3 MB) instead.")
    ] = False,
) -> None:
    """Run the whole pipeline on bundled motions: simulated recording, track, table, film and a page."""
    from toolkit.app.cli.track import print_done

    start = time.monotonic()
    try:
        with progress_bars() as bars:
            result = run_demo(output, real=real, show=bars)
    except DataError as error:
        raise DataError(f"{error}. Without a network, `depthmocap demo` tracks a simulated recording") from error
    if result.table is not None:
        print_table(result.table.to_rich("simulated recording, compared with its exact joint positions"))
    print_done(result.summary.text(), result.run)
    for path in result.files:
        print_lines(path)
    print_lines(
        f"{time.monotonic() - start:.0f} seconds; open {result.files[-1]} in a browser for the film, the 3-D view and "
        "the plots"
    )
    recording, people = str(result.files[0]), ("--people", "all") if real else ()
    next_commands(
        {
            ("track", recording, *people, "--output", "run"): "with the default poses; then a recording of your own",
            ("info", recording): "describes a recording and names the options that it needs",
        }
    )
