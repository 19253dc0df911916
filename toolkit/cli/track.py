"""`depthmocap track`."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.groups import spread
from toolkit.cli.guiding import Guiding
from toolkit.cli.options import SettingOption, given
from toolkit.cli.reading import Joints, Reading, SegmentOption, people_of
from toolkit.cli.terminal import say
from toolkit.errors import UsageError

if TYPE_CHECKING:
    from toolkit.pipeline import ManifestRow, TrackerRecipe


@dataclass(frozen=True)
class Tracking:
    """Which tracker is built, as it is typed."""

    database: Annotated[
        Path | None,
        typer.Option("--database", "-d", help="Pose database.", show_default="the one of the package"),
    ] = None
    body: Annotated[Path | None, typer.Option(help="The person's own, of `depthmocap body scan`.")] = None
    config: Annotated[str, typer.Option(help="Settings: a YAML file or the name of a shipped one.")] = "hybrid"
    settings: SettingOption = None
    online: Annotated[
        bool, typer.Option("--online", help="One pass, each frame done with as it comes, as for a live camera.")
    ] = False
    segment: SegmentOption = None
    subject: Annotated[
        str | None,
        typer.Option(help="Who is meant among several people: only, largest or nearest.", show_default="only"),
    ] = None

    def overrides(self) -> dict[str, Any]:
        """Settings that are not the configuration's, by their dotted names."""
        from toolkit.config import parse_overrides, setting_of
        from toolkit.tracking.registry import DEFAULT

        sensing = given(segment=self.segment, subject=self.subject)
        found = {f"sensing.{name}": value for name, value in sensing.items()} | parse_overrides(self.settings or [])
        # Other trackers know one pass only.
        if self.online and (setting_of("tracker", self.config, found) or DEFAULT) == DEFAULT:
            found["passes"] = 1
        return found

    def recipe(self, sensors: Path | None = None) -> TrackerRecipe:
        """What the tracker is made of."""
        from toolkit.pipeline import TrackerRecipe

        return TrackerRecipe(self.config, self.overrides(), self._poses(), self.body, sensors)

    def _poses(self) -> Path | None:
        """The database named, or that of the package; None for a tracker that looks no poses up, which is said."""
        from toolkit.database.default import default_database_path
        from toolkit.pipeline.trackers import needs_database

        if not needs_database(self.config, self.overrides()):
            if self.database is not None:
                say(f"{self.database} is not used: this tracker looks no poses up", file=sys.stderr)
            return None
        return self.database or default_database_path()


@dataclass(frozen=True)
class Folders:
    """What becomes of run folders that are there already, and of many recordings, as it is typed."""

    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a finished run.")] = False
    resume: Annotated[bool, typer.Option("--resume", help="Continue a killed or interrupted run.")] = False
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="So many processes share the recordings; finished runs are left alone, manifest.jsonl lists all.",
        ),
    ] = None

    def keep_finished(self, runs: list[Path]) -> None:
        """Refuse to replace a finished run without --overwrite; a batch looks at each of them itself."""
        from toolkit.runs import PEOPLE_FILE
        from toolkit.track import PARTIAL_FILE, TRACK_FILE

        if self.overwrite or self.resume or self.workers:
            return
        for run in runs:
            finished = (run / TRACK_FILE).exists() and not (run / PARTIAL_FILE).exists()
            if finished or (run / PEOPLE_FILE).exists():
                raise UsageError(
                    f"{run} holds a finished run; add --overwrite to replace it, or choose another --output"
                )


@spread
def track(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING...", show_default=False)],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Run folder; several recordings go to OUTPUT/<stem>.", show_default=False),
    ],
    tracking: Tracking,
    people: Annotated[
        str, typer.Option(metavar="all|N", help="Follow several people, each in OUTPUT/person_NN.")
    ] = "1",
    joints: Joints = Joints(),
    guiding: Guiding = Guiding(),
    folders: Folders = Folders(),
    reading: Reading = Reading(),
) -> None:
    """Track the person in depth recordings and write what was found into run folders."""
    from toolkit.pipeline import run_folders, tracker_settings, unreadable

    options, choice = reading.options(), joints.choice(len(recordings))
    how = {"people": people_of(people), "reader_options": options, "joints": choice}
    runs = list(run_folders(recordings, output).values())
    folders.keep_finished(runs)
    tracker_settings(tracking.config, tracking.overrides())
    for path, reason in unreadable(recordings, options).items():  # before anything costs time
        say(f"depthmocap: {path}: {reason}; the others are tracked", file=sys.stderr)
    if folders.workers:
        _track_batch(recordings, output, tracking, guiding, folders, how)
        return
    found = _track_each(recordings, output, tracking, guiding, folders.resume, how)
    from toolkit.cli.terminal import next_commands

    if not found:
        next_commands({("info", str(recordings[0])): "what the recording holds, and which option would help"})
        return
    next_commands(
        {
            ("report", str(output), "--output", "report.html"): "one page: film, body in three dimensions, plots",
            ("evaluate", str(output)): "error, where the recording knows the truth; time; states",
            ("export", str(runs[0]), "--output", "motion.glb"): "for Blender, Unity, browsers; also .bvh, .trc, .csv",
        }
    )


def _track_each(
    recordings: list[Path], output: Path, tracking: Tracking, guiding: Guiding, resume: bool, how: dict[str, Any]
) -> bool:
    """One recording after the other; whether a person was tracked. Exit code 1 where one is not done."""
    from toolkit.ahead import compile_beside
    from toolkit.cli.terminal import doing_words, progress_bars

    compile_beside()
    from toolkit.pipeline import track_recordings
    from toolkit.runs import PEOPLE_FILE, load_people

    guide, watcher = guiding.guide(recordings), guiding.watcher(recordings)
    with progress_bars() as bars:
        recipe, preparing = tracking.recipe(guiding.inertial), doing_words("compiling")
        bars(preparing, 0, 1)
        tracker = recipe.build(guide)
        bars(preparing, 1, 1)
        report = track_recordings(
            recordings,
            tracker,
            output,
            resume=resume,
            progress=lambda name, doing, done, total: bars(f"{name}: {doing_words(doing)}", done, total),
            watcher=watcher,
            made_of=recipe,
            **how,
        )
    for summary in report.done:
        say(summary.text())
        if (summary.run / PEOPLE_FILE).exists():
            say(load_people(summary.run).text())
    for path, reason in report.failed.items():
        say(f"depthmocap: {path}: {reason}", file=sys.stderr)
    if report.failed or report.interrupted:
        raise typer.Exit(1)
    return any(summary.states["tracked"] for summary in report.done)


def _track_batch(
    recordings: list[Path], output: Path, tracking: Tracking, guiding: Guiding, folders: Folders, how: dict[str, Any]
) -> None:
    """Many recordings in processes of their own."""
    from toolkit.cli.terminal import progress_bars
    from toolkit.pipeline import track_many

    if guiding.guide(recordings) or guiding.watcher(recordings):
        raise UsageError("sensors and events belong to one recording; leave --workers out")
    with progress_bars() as bars:
        rows = track_many(
            recordings, tracking.recipe(), output, workers=folders.workers,
            overwrite=folders.overwrite, progress=bars, **how,
        )  # fmt: skip
    _print_rows(rows)


def _print_rows(rows: list[ManifestRow]) -> None:
    """A line for each recording of a batch; exit code 1 where one is not done."""
    from toolkit.pipeline.manifest import DONE

    for row in rows:
        if row.status == DONE:
            say(row.text)
        else:
            say(f"depthmocap: {row.recording}: {row.status}: {row.reason or row.text}", file=sys.stderr)
    if any(row.status != DONE for row in rows):
        raise typer.Exit(1)
