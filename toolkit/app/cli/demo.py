"""The verb `depthmocap demo`: the whole pipeline on bundled motions or on downloaded real frames."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from toolkit.app.cli.terminal import next_commands, print_lines
from toolkit.io.errors import DataError, UsageError
from toolkit.io.progress import Progress, silent

if TYPE_CHECKING:
    from toolkit.app.pipeline.run_summary import RunSummary
    from toolkit.evaluation.scores import EvaluationTable
    from toolkit.tracks.runs import People

REAL = "two-people"
"""Data set of the real demo."""


class DemoResult(NamedTuple):
    """Result of the demo: scores, times and the written files in order."""

    table: EvaluationTable
    summary: RunSummary
    files: list[Path]


class RealDemoResult(NamedTuple):
    """Result of the real demo: summary, people, and the written files in order."""

    summary: RunSummary
    people: People
    files: list[Path]


def run_demo(output: str | Path, *, seed: int = 0, seconds: float = 5.0, show: Progress = silent) -> DemoResult:
    """Simulate a recording of motions outside the database, track it, score it and draw it.

    Parameters
    ----------
    output : folder of all files; replaces an earlier demo
    seed : seed of the motions, the sensor noise and the subject's shape
    seconds : duration of each motion
    show : called with each step

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    from toolkit.app.cli.terminal import doing_words
    from toolkit.app.pipeline import TrackerRecipe, track_recording
    from toolkit.body.shape import subject_body
    from toolkit.database.default import default_database_path
    from toolkit.evaluation.evaluate import evaluate_runs
    from toolkit.evaluation.score_report import write_evaluation
    from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
    from toolkit.output.rendering.film import render_run
    from toolkit.output.report.page import write_report
    from toolkit.simulation.joining import joined
    from toolkit.simulation.simulate import simulate_recording

    folder = Path(output)
    run = folder / "run"
    (run / "track.partial").unlink(missing_ok=True)
    subject = subject_body("slim_male", seed=7)
    motions = 3  # motions of the recording; the database contains none of them
    clips = procedural_clips(SUBJECT_MOTIONS[:motions], body=subject, variations=1, seed=seed)
    frames = int(seconds * clips[0].frame_rate)
    poses, _ = joined([clip.poses[:frames] for clip in clips])
    motion = replace(clips[0], name="+".join(clip.name for clip in clips), poses=poses)
    recording = simulate_recording(
        motion, folder / "take.npz", body=subject, sensor="tof", yaw=10.0, seed=seed,
        progress=partial(show, "simulating a recording"),
    )  # fmt: skip
    tracker = TrackerRecipe(database=default_database_path()).build()
    summary = track_recording(
        recording, tracker, run, progress=lambda name, doing, done, total: show(doing_words(doing), done, total)
    )
    table = evaluate_runs([run], progress=lambda name, done, total: show("evaluating", done, total))
    files = [recording.path, run, *write_evaluation(table, folder)]
    for name in ("film.webm", "contact_sheet.png"):
        doing = f"drawing the {Path(name).stem.replace('_', ' ')}"
        files.append(render_run(run, folder / name, progress=partial(show, doing)))
    page = folder / "report.html"
    files.append(
        write_report([run], page, progress=lambda doing, done, total: show(f"writing the page: {doing}", done, total))
    )
    return DemoResult(table, summary, files)


def run_real_demo(output: str | Path, *, data: str | Path | None = None, show: Progress = silent) -> RealDemoResult:
    """Download 20 real depth frames of two men in a room, track both, and draw the film and the page.

    Parameters
    ----------
    output : folder of all files; replaces an earlier demo
    data : data folder; `toolkit.datasets.folder.data_folder()` if None
    show : called with the work that is done

    Raises
    ------
    DataError
        The frames are not in the data folder and cannot be downloaded.
    OutputError
        The folder cannot be written.
    """
    from toolkit.app.cli.terminal import doing_words
    from toolkit.app.pipeline import TrackerRecipe, track_recording
    from toolkit.database.default import default_database_path
    from toolkit.datasets.fetch import fetch_data_set
    from toolkit.datasets.registry import data_set_of
    from toolkit.io.files import atomic_path
    from toolkit.output.rendering.film import render_run
    from toolkit.output.report.page import write_report
    from toolkit.recordings.opening import open_upright
    from toolkit.tracks import PARTIAL_FILE
    from toolkit.tracks.runs import load_people

    folder, data_set = Path(output), data_set_of(REAL)
    fetched = fetch_data_set(data_set, data, progress=show)
    frames, run = folder / REAL, folder / "real_run"
    for file in data_set.files:  # copied, so that the run refers to files in the same folder
        inside = Path(file.path).relative_to(data_set.folder)
        with atomic_path(frames / inside, lasting=False) as temporary:
            shutil.copyfile(fetched / inside, temporary)
    for unfinished in run.rglob(PARTIAL_FILE):
        unfinished.unlink()
    summary = track_recording(
        open_upright(frames / "images_n40"), TrackerRecipe(database=default_database_path()).build(), run, people=None,
        progress=lambda name, doing, done, total: show(doing_words(doing), done, total),
    )  # fmt: skip
    files = [frames, run]
    for name in ("real_film.webm", "real_contact_sheet.png"):
        files.append(render_run(run, folder / name, progress=partial(show, f"drawing {name}")))
    page = write_report(
        [run], folder / "real_report.html",
        progress=lambda doing, done, total: show(f"writing the page: {doing}", done, total),
    )  # fmt: skip
    return RealDemoResult(summary, load_people(run), [*files, page])


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Output folder.")] = Path("demo"),
    seed: Annotated[int | None, typer.Option(help="Random seed.", min=0, show_default="0")] = None,
    real: Annotated[
        bool, typer.Option("--real", help="Download and track 20 real frames of two people (3 MB) instead.")
    ] = False,
    data: Annotated[
        Path | None, typer.Option(help="With --real: data folder.", show_default="that of `data where`")
    ] = None,
) -> None:
    """Run the whole pipeline on bundled motions: simulated recording, track, table, film and a page."""
    start = time.monotonic()
    if real:
        if seed is not None:
            raise UsageError("--seed belongs to the simulated demo; leave it out with --real")
        page = _demo_real(output, data)
    else:
        if data is not None:
            raise UsageError("--data belongs to --real; add it or leave --data out")
        page = _demo_simulated(output, seed or 0)
    print_lines(
        f"{time.monotonic() - start:.0f} seconds; open {page} in a browser for the film, the 3-D view and the plots"
    )
    recording = output / REAL / "images_n40" if real else output / "take.npz"
    people = ("--people", "all") if real else ()
    next_commands(
        {
            (
                "track",
                str(recording),
                *people,
                "--output",
                "run",
            ): "with the default poses; then a recording of your own",
            ("info", str(recording)): "describes a recording and names the options that it needs",
        }
    )


def _demo_simulated(output: Path, seed: int) -> Path:
    """Run the simulated demo, print its results and return the page."""
    from toolkit.app.cli.terminal import print_table, progress_bars

    with progress_bars() as bars:
        result = run_demo(output, seed=seed, show=bars)
    print_table(result.table.to_rich("simulated recording, compared with its exact joint positions"))
    print_lines("milliseconds a frame (median): ", result.summary.text())
    for path in result.files:
        print_lines(path)
    return result.files[-1]


def _demo_real(output: Path, data: Path | None) -> Path:
    """Run the real demo, print its results and return the page."""
    from toolkit.app.cli.terminal import progress_bars

    try:
        with progress_bars() as bars:
            result = run_real_demo(output, data=data, show=bars)
    except DataError as error:
        raise DataError(f"{error}. Without a network, `depthmocap demo` tracks a simulated recording") from error
    print_lines(result.summary.text())
    print_lines(result.people.text())
    for path in result.files:
        print_lines(path)
    return result.files[-1]
