"""`depthmocap annotate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli.groups import spread
from toolkit.cli.options import LabelTable, Motions, Pattern, Seed
from toolkit.cli.retrieval import cautions
from toolkit.cli.terminal import say

if TYPE_CHECKING:
    from toolkit.progress import Progress
    from toolkit.retrieval.annotation.annotator import MotionClass
    from toolkit.retrieval.annotation.model import MotionModel
    from toolkit.retrieval.workflow.annotate import AnnotatedFile
    from toolkit.retrieval.workflow.motions import Tag


Examples = Annotated[
    list[Path] | None,
    typer.Option(
        help="Cut clips to learn a motion model from, as `depthmocap learn` does, without its check. Repeatable."
    ),
]
Others = Annotated[
    list[Path] | None,
    typer.Option(
        help="Motions of no class: what the examples are not to be mistaken for.",
    ),
]
Events = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|-", help="Replay a run (classes learned with --templates): one JSON line for each motion."
    ),
]


@dataclass(frozen=True)
class Learning:
    """What classes are learned from, as it is typed."""

    examples: Examples = None
    others: Others = None
    pattern: Pattern = None
    labels: LabelTable = None
    templates: Annotated[
        bool, typer.Option("--templates", help="Learn motion templates (the thesis's way) from the examples instead.")
    ] = False
    seed: Seed = 0


@spread
def annotate(
    motions: Motions,
    learning: Learning,
    events: Events = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder of the reports; not needed with --events.")
    ] = None,
    classes: Annotated[
        Path | None, typer.Option(help="Motion model by `depthmocap learn`, or classes of an earlier call.")
    ] = None,
    queries: Annotated[
        Path | None, typer.Option(help="Keyframe queries by `depthmocap learn`, for the search for templates.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="True segments (CSV: start, end, label), or a folder with one file per motion.")
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(help="Largest cost of a template: share of features that differ.", show_default="its own, 0.13"),
    ] = None,
    as_published: Annotated[
        bool, typer.Option("--as-published", help="Templates decide by the thesis's own rules, at a cost below 0.07.")
    ] = False,
) -> None:
    """Cut motions into segments and label them: CSV, JSON, a picture and a page for each. Or replay them as events."""
    from toolkit.cli.terminal import progress_bars
    from toolkit.errors import UsageError
    from toolkit.retrieval.keyframes.query_file import load_queries
    from toolkit.retrieval.workflow.annotate import annotate_motions, load_wanted
    from toolkit.retrieval.workflow.motions import find_motions, tags_of

    if events is not None:
        _replay(motions, events, classes, queries)
        if output is None:
            return
    if output is None:
        raise UsageError("annotate needs --output for its reports, or --events")
    if (classes is None) == (learning.examples is None):
        raise UsageError("annotate needs one of --classes and --examples; give exactly one")
    with progress_bars() as bars:
        if classes is not None:
            wanted = load_wanted(classes)
        else:
            clips = find_motions(learning.examples or [])
            tags, learned = tags_of(clips, learning.pattern, learning.labels), output / "classes.npz"
            wanted = (
                _templates(tags, learned, bars)
                if learning.templates
                else _model(tags, learned, learning.others or [], learning.seed, bars)
            )
        done = annotate_motions(
            motions, wanted, output, queries=load_queries(queries) if queries else (), truth=truth,
            threshold=threshold, as_published=as_published, progress=bars,
        )  # fmt: skip
    _show(done)


def _templates(tags: dict[Path, Tag], output: Path, progress: Progress) -> list[MotionClass]:
    """The thesis's classes, learned from examples and written."""
    from toolkit.retrieval.annotation.classes import save_classes
    from toolkit.retrieval.workflow.annotate import classes_from_clips

    wanted = classes_from_clips({path: tag.label for path, tag in tags.items()}, progress=progress)
    save_classes(output, wanted)
    return wanted


def _model(tags: dict[Path, Tag], output: Path, others: list[Path], seed: int, progress: Progress) -> MotionModel:
    """A motion model, learned from examples and written."""
    import numpy as np

    from toolkit.retrieval.workflow.learn import learn_model

    learned = learn_model(tags, output, np.random.default_rng(seed), others=others, check=False, progress=progress)
    counts = ", ".join(f"{label} ({count})" for label, count in learned.clips.items())
    say(f"classes: {counts}", *cautions(learned, others), sep="\n")
    return learned.model


def _show(done: list[AnnotatedFile]) -> None:
    """A table of what was annotated."""
    from rich.table import Table

    from toolkit.cli.terminal import print_table

    table = Table("motion", "segments", "F frames", "F segments", "report")
    for file in done:
        scores = [f"{file.scores[name].f:.2f}" if file.scores else "" for name in ("frames", "segments")]
        table.add_row(file.annotation.name, str(len(file.annotation.segments)), *scores, str(file.folder))
    print_table(table)


def _replay(motions: list[Path], events: str, classes: Path | None, queries: Path | None) -> None:
    """Events of one run."""
    from toolkit.errors import UsageError
    from toolkit.retrieval.annotation.classes import load_classes
    from toolkit.retrieval.keyframes.query_file import load_queries
    from toolkit.retrieval.workflow.events import replay, write_events

    if classes is None or len(motions) != 1:
        raise UsageError("--events replays one run with --classes; name one run folder and the class file")
    wanted = load_queries(queries) if queries else ()
    write_events(replay(motions[0], load_classes(classes), wanted), events)
