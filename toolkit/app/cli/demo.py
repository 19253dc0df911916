"""`depthmocap demo`: the main job on what is bundled, from motions to a film."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from toolkit.app.cli.terminal import say
from toolkit.io.progress import Progress, silent

if TYPE_CHECKING:
    from toolkit.app.pipeline.run_summary import RunSummary
    from toolkit.evaluation.scores import EvaluationTable

SUBJECT, SUBJECT_SEED = "slim_male", 7
"""Whose body is simulated, and the seed of what makes it unlike every body that a tracker can fit."""
MOTIONS = 3
"""Motions of the recording; none of them is in the database."""
SECONDS = 5.0
"""Of each motion."""


class DemoResult(NamedTuple):
    """What the demo made: scores, times, and the files in their order."""

    table: EvaluationTable
    summary: RunSummary
    files: list[Path]


def run_demo(output: str | Path, *, seed: int = 0, seconds: float = SECONDS, show: Progress = silent) -> DemoResult:
    """Record a person unlike any body that is fitted in motions of no database, track, score and draw them.

    Parameters
    ----------
    output : folder of everything that is written; an earlier demo in it is replaced
    seed : of the motions, the noise of the sensor and the subject's variation
    seconds : of each of the motions
    show : told what is going on

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
    subject = subject_body(SUBJECT, seed=SUBJECT_SEED)
    clips = procedural_clips(SUBJECT_MOTIONS[:MOTIONS], body=subject, variations=1, seed=seed)
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


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of everything that is written.")] = Path(
        "demo"
    ),
    seed: Annotated[int, typer.Option(help="Seed of everything random.", min=0)] = 0,
) -> None:
    """Do the main job on bundled motions: simulated recording, track, table, film and a page of it all."""
    from toolkit.app.cli.terminal import next_commands, print_table, progress_bars

    start = time.monotonic()
    with progress_bars() as bars:
        result = run_demo(output, seed=seed, show=bars)
    print_table(result.table.to_rich("simulated recording, compared with its exact truth"))
    say("milliseconds a frame (median): ", result.summary.text())
    for path in result.files:
        say(path)
    seconds = time.monotonic() - start
    say(f"{seconds:.0f} seconds; open {result.files[-1]} in a browser: film, body in three dimensions, errors")
    next_commands(
        {
            ("track", str(output / "take.npz"), "--output", "run"): "with the default poses; then a recording of yours",
            ("info", str(output / "take.npz")): "what a recording holds, and which option would help",
        }
    )
