"""The verbs `depthmocap index`, `depthmocap search` and `depthmocap learn`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.app.cli.options import LabelTable, Motions, Output, Seed, spread
from toolkit.app.cli.terminal import print_lines, print_table, progress_bars

if TYPE_CHECKING:
    from toolkit.retrieval.annotation.measures import Scores
    from toolkit.retrieval.search.find import Match
    from toolkit.retrieval.workflow.motions import Tag
    from toolkit.retrieval.workflow.search_files import SearchReport


Index = Annotated[
    Path, typer.Argument(metavar="INDEX", help="Index written by `depthmocap index`.", show_default=False)
]


def index(
    output: Output,
    motions: Motions,
    workers: Annotated[int, typer.Option(help="Number of reading processes; does not change the result.", min=1)] = 1,
) -> None:
    """Index motions by their relational features, for `depthmocap search`."""
    from toolkit.retrieval.workflow.index import index_motions

    with progress_bars() as bars:
        made = index_motions(motions, output, workers=workers, progress=bars)
    print_lines(f"{output}: {len(made)} motions, {made.duration / 60:.1f} minutes, {made.frames} frames at 30 Hz")


@dataclass(frozen=True)
class ByExample:
    """Options for a search by example."""

    by_example: Annotated[Path | None, typer.Option(help="Example clip; replaces a query file.")] = None
    start: Annotated[float, typer.Option("--from", help="Start of the example, seconds.")] = 0.0
    end: Annotated[float | None, typer.Option("--to", help="End of the example, seconds.", show_default="its end")] = (
        None
    )


@dataclass(frozen=True)
class Film:
    """Options for a film of the hits."""

    play: Annotated[
        Path | None, typer.Option(metavar="FILM", help="Film (.mp4, .webm) of the example and the first results.")
    ] = None
    mocap: Annotated[list[Path] | None, typer.Option(help="For --play: the indexed files and folders. Repeatable.")] = (
        None
    )


@spread
def search(
    index: Index,
    example: ByExample,
    film: Film,
    queries: Annotated[Path | None, typer.Option(help="Query file written by `depthmocap learn` or by hand.")] = None,
    classes: Annotated[
        Path | None,
        typer.Option(help="Motion model of `depthmocap learn`; finds its classes, most probable first."),
    ] = None,
    label: Annotated[list[str] | None, typer.Option(help="Only these queries or classes.")] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            help="Maximum cost: 0 (equal) to 1 (opposite) by example, 1 minus probability by classes.",
            show_default="0.2, 0.8",
        ),
    ] = None,
    limit: Annotated[
        int, typer.Option(help="Number of results per query that are shown, and by example also written.", min=1)
    ] = 20,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File for all results (.csv).")] = None,
) -> None:
    """Find motions in an index by an example, a motion model or keyframe queries."""
    from toolkit.io.errors import UsageError
    from toolkit.io.files import check_output

    if sum(way is not None for way in (queries, example.by_example, classes)) != 1:
        raise UsageError("search needs one of --by-example, --classes and --queries; give exactly one")
    if (film.play is None) != (not film.mocap):
        raise UsageError("--play and --mocap (the indexed files and folders) belong together; give both or neither")
    for written in filter(None, (output, film.play)):
        check_output(written, [path for path in (index, queries, example.by_example, classes) if path is not None])
    if example.by_example is None:
        reports = _labelled(index, queries, classes, label, threshold)
    else:
        reports = [_alike(index, example.by_example, example, limit, threshold)]
    if output is not None:
        from toolkit.retrieval.workflow.search_files import save_matches

        save_matches(output, reports)
    for report in reports:
        _show(report, limit)
    played = 5  # maximum number of results in a film
    if film.play is not None:
        ranked = sorted((match for report in reports for match in report.matches), key=lambda match: match.cost)
        _play(film.play, ranked[:played], film.mocap or [], example)


def _labelled(
    index: Path, queries: Path | None, classes: Path | None, labels: list[str] | None, threshold: float | None
) -> list[SearchReport]:
    """Search with a motion model or a query file; return one report per label."""
    from toolkit.retrieval.annotation.model import MotionModel
    from toolkit.retrieval.index.keyframe_index import KeyframeIndex
    from toolkit.retrieval.keyframes.query import choose_labels, load_queries
    from toolkit.retrieval.workflow.search_files import by_class, by_keyframes

    opened = KeyframeIndex.open(index)
    if classes is not None:
        given = {} if threshold is None else {"doubt": threshold}
        return by_class(opened, MotionModel.load(classes), labels, **given)
    return by_keyframes(opened, choose_labels(load_queries(queries or Path()), labels))


def _alike(index: Path, clip: Path, example: ByExample, limit: int, threshold: float | None) -> SearchReport:
    """Search for motions similar to a part of a clip."""
    from toolkit.retrieval.index.keyframe_index import KeyframeIndex
    from toolkit.retrieval.search.example import search_example
    from toolkit.retrieval.workflow.search_files import SearchReport, cut_example

    piece = cut_example(clip, example.start, example.end)
    # Default maximum cost of a result by example: 99 % of other people's performances cost less than 0.18, half of
    # the chance hits less than 0.17.
    example_cost = 0.2
    matches = search_example(KeyframeIndex.open(index), piece, limit, example_cost if threshold is None else threshold)
    return SearchReport(piece.name, tuple(matches))


def _play(film: Path, matches: list[Match], mocap: list[Path], example: ByExample) -> None:
    """Write a film of the example and of the hits."""
    from toolkit.output.rendering.motions import film_of_motions
    from toolkit.retrieval.workflow.motions import load_motion
    from toolkit.retrieval.workflow.search_files import stretches

    titled = []
    if example.by_example is not None:
        motion = load_motion(example.by_example)
        rate = motion.frame_rate
        stop = len(motion) if example.end is None else round(example.end * rate)
        titled.append((f"example\n{example.by_example.stem}", motion.sliced(round(example.start * rate), stop)))
    for match, motion in zip(matches, stretches(matches, mocap), strict=True):
        titled.append((f"{match.document}\n{match.start:.1f} to {match.end:.1f} s", motion))
    if titled:
        print_lines(film_of_motions(film, titled))


def _show(report: SearchReport, limit: int) -> None:
    from rich.table import Table

    title = f"{report.label or 'query'}: {len(report.matches)} results"
    ranked = report.share is None
    if report.share is not None:
        title += f", {100 * report.share:.1f} % of the data"
    table = Table("motion", "from", "to", *(["cost"] if ranked else []), title=title, title_justify="left")
    for match in report.matches[:limit]:
        cost = [f"{match.cost:.3f}"] if ranked else []
        table.add_row(match.document, f"{match.start:.2f} s", f"{match.end:.2f} s", *cost)
    print_table(table)


@dataclass(frozen=True)
class KeyframeLearning:
    """Options for learning keyframe queries."""

    label: Annotated[list[str] | None, typer.Option(help="Keyframes: learn only these classes.")] = None
    alternatives: Annotated[
        int, typer.Option(help="Keyframes: queries per class; a motion has to match one of them.", min=1)
    ] = 1
    tight: Annotated[
        bool,
        typer.Option(
            "--tight",
            help="Keyframes: tighten the queries, so that less data is left; hits mark the middle of a motion.",
        ),
    ] = False
    runs: Annotated[int, typer.Option(help="Keyframes: genetic runs per class.", min=1)] = 100
    workers: Annotated[int, typer.Option(help="Number of processes; does not change the result.", min=1)] = 1


@spread
def learn(
    clips: Motions,
    output: Output,
    keyframes: KeyframeLearning,
    labels: LabelTable = None,
    others: Annotated[
        list[Path] | None, typer.Option(help="Clips of no class, used as additional counterexamples.")
    ] = None,
    templates: Annotated[
        bool, typer.Option("--templates", help="Learn the motion templates of the thesis instead of a motion model.")
    ] = False,
    seed: Seed = 0,
) -> None:
    """Learn motions from cut clips. OUTPUT.npz is a motion model for `depthmocap annotate`, with a table of its
    accuracy on left-out people; with --templates it holds motion templates. OUTPUT.json holds keyframe queries for
    `depthmocap search`.

    The class of a clip is the name of its folder, or comes from the clip's name if all clips are in one folder.
    """
    from toolkit.retrieval.workflow.learn import learn_templates
    from toolkit.retrieval.workflow.motions import find_motions, tags_of

    tags = tags_of(find_motions(clips), labels)
    classes = {file: tag.label for file, tag in tags.items()}
    if templates:
        with progress_bars() as bars:
            learned = learn_templates(classes, output, bars)
        print_lines(
            f"{output}: {len(learned)} classes ({', '.join(c.label for c in learned)}) from {len(classes)} clips"
        )
    elif output.suffix.lower() == ".npz":
        _learn_model(tags, output, others or [], seed)
    else:
        _learn_queries(classes, output, keyframes, others or [], seed)


def _learn_queries(
    classes: dict[Path, str], output: Path, keyframes: KeyframeLearning, others: list[Path], seed: int
) -> None:
    import numpy as np
    from rich.table import Table

    from toolkit.retrieval.learning.queries import LearningSettings
    from toolkit.retrieval.workflow.learn import learn_queries

    with progress_bars() as bars:
        learned = learn_queries(
            classes, output, np.random.default_rng(seed), labels=keyframes.label, others=others,
            settings=LearningSettings(runs=keyframes.runs), alternatives=keyframes.alternatives, tight=keyframes.tight,
            workers=keyframes.workers,
            progress=lambda _, done, total: bars("genetic runs", done, total),
        )  # fmt: skip
    table = Table("class", "keyframes", "precision", "recall", "F (beta 2)", title=f"{output}: on the training clips")
    for name, result in learned.items():
        quality = result.training
        numbers = (f"{value:.3f}" for value in (quality.precision, quality.recall, quality.fitness))
        table.add_row(name, str(len(result.individual.placed)), *numbers)
    print_table(table)


def _learn_model(tags: dict[Path, Tag], output: Path, others: list[Path], seed: int) -> None:
    import numpy as np
    from rich.table import Table

    from toolkit.retrieval.annotation.measures import Scores
    from toolkit.retrieval.workflow.learn import learn_model

    with progress_bars() as bars:
        learned = learn_model(tags, output, np.random.default_rng(seed), others=others, progress=bars)
    several = len(learned.people) > 1
    who = (
        "each person annotated by a model of the other people"
        if several
        else "each half annotated by a model of the other half"
    )
    table = Table("class", "clips", "F frames", "F segments", "found", "right", title=f"{output}: {who}")
    nothing = Scores(0, 0, 0, 0)
    totals = [nothing, nothing]
    for label, count in learned.clips.items():
        frames, segments = (
            sum((getattr(part, name).get(label, nothing) for part in learned.left_out), nothing)
            for name in ("frames", "segments")
        )
        totals = [totals[0] + frames, totals[1] + segments]
        table.add_row(label, str(count), *_scores_shown(frames, segments))
    table.add_row("all", str(sum(learned.clips.values())), *_scores_shown(*totals))
    if learned.left_out:
        print_table(table)
    else:
        print_lines(f"{output}: {len(learned.clips)} classes of one clip each; no clip could be left out for a test")
    if not several:
        print_lines("The clips name no performer, so the table does not cover other people; see --labels.")
    for first, second, ratio in learned.alike:
        print_lines(
            f"{first} is hard to distinguish from {second}: the distance is only {ratio:.2f} times "
            "the distance to its own clips."
        )
    if not others:
        print_lines(
            "Without --others the model has only its own classes and labels all similar motions as one of them;"
        )
        print_lines("add motions of no class, for example walking, sitting, standing.")


def _scores_shown(frames: Scores, segments: Scores) -> tuple[str, ...]:
    return f"{frames.f:.2f}", f"{segments.f:.2f}", f"{segments.recall:.2f}", f"{segments.precision:.2f}"
