from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from toolkit.app.cli.motion_verbs import annotate as annotate_verb
from toolkit.app.cli.retrieval import index as index_verb
from toolkit.app.cli.retrieval import learn as learn_verb
from toolkit.app.cli.retrieval import search as search_verb
from toolkit.io.errors import RetrievalError, UsageError
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery, choose_labels, load_queries, save_queries
from toolkit.retrieval.search.example import search_example
from toolkit.retrieval.workflow.index import index_motions
from toolkit.retrieval.workflow.motions import load_motion, tags_of
from toolkit.retrieval.workflow.search_files import by_keyframes, cut_example, save_matches

KICK = KeyframeQuery((Keyframe.of({"F1": 1, "F21": 1}), Keyframe.of({"F40": 0})), ((2, None),), 3, 8, "kick")


def documents(seed: int = 0) -> list[FeatureMatrix]:
    """Return three documents of slowly changing features."""
    rng = np.random.default_rng(seed)
    return [FeatureMatrix(f"doc{i}", np.repeat(rng.random((40, 20)) < 0.4, 5, axis=1)) for i in range(3)]


# files


def test_queries_come_back_from_their_file(tmp_path: Path) -> None:
    other = KeyframeQuery((Keyframe.of({"F15": 0, "F16": 1}),), label="wait")
    save_queries(tmp_path / "queries.json", [KICK, other])
    loaded = load_queries(tmp_path / "queries.json")
    assert loaded == [KICK, other] and [query.label for query in loaded] == ["kick", "wait"]
    assert choose_labels(loaded, ["wait"]) == [other] and choose_labels(loaded, None) == loaded


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing like it", "no JSON"),
        ("[1, 2]", "it is a list; it must be names with values"),
        ('{"version": 9, "queries": []}', "version 9, not 1"),
        ('{"version": 1, "features": "abc", "queries": []}', "other feature definitions .abc"),
        ('{"version": 1, "queries": [{"keyframes": [{"F77": 1}]}]}', "unknown feature 'F77'"),
        ('{"version": 1, "queries": [{"keyframes": [{"F1": 3}]}]}', "has the value 3"),
        ('{"version": 1, "queries": [{"frames": []}]}', r"queries\[0\] lacks keyframes"),
        ('{"version": 1, "queries": [{"keyframes": ["F1"]}]}', "must be names with values"),
        ('{"version": 1, "queries": [{"keyframes": [{"F1": 1}], "distances": [["a", 1]]}]}', "must be a whole number"),
        ('{"version": 1, "queries": [{"keyframes": [{"F1": 1}, {"F2": 1}]}]}', "2 keyframes and 0 distances"),
        ('{"version": 1, "queries": [{"keyframes": [{"F1": 1}, {}], "distances": [[0, 1]]}]}', "matches every frame"),
        ('{"version": 1, "queries": [{"keyframes": [{"F1": 1}, {"F2": 1}], "distances": [[3, 1]]}]}', "from 3 to 1"),
    ],
)
def test_a_query_file_that_cannot_be_used_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "queries.json"
    path.write_text(text)
    with pytest.raises(RetrievalError, match=message) as caught:
        load_queries(path)
    assert "\n" not in str(caught.value)


def test_a_label_stands_for_all_its_alternatives() -> None:
    first, second = (KeyframeQuery((Keyframe.of({name: 1}),), label="hop") for name in ("F1", "F2"))
    other = KeyframeQuery((Keyframe.of({"F3": 1}),), label="kick")
    assert choose_labels([first, other, second], ["hop"]) == [first, second]


def test_results_are_written_as_csv(tmp_path: Path) -> None:
    query = KeyframeQuery((Keyframe.of({"F1": 1}),), label="up")
    (report,) = by_keyframes(KeyframeIndex.build(documents()), [query])
    assert len(report.matches) > 3 and report.share is not None and report.share < 1.0
    save_matches(tmp_path / "hits.csv", [report])
    rows = list(csv.DictReader((tmp_path / "hits.csv").read_text().splitlines()))
    assert [row["document"] for row in rows] == [match.document for match in report.matches]
    assert float(rows[0]["end"]) == pytest.approx(report.matches[0].end, abs=1e-4) and rows[0]["label"] == "up"
    with pytest.raises(UsageError, match="'hits.txt'"):
        save_matches(tmp_path / "hits.txt", [report])


# labels


def test_labels_come_from_folders_names_or_a_table(tmp_path: Path) -> None:
    files = [tmp_path / "kick" / "bd_kick_1.bvh", tmp_path / "wave" / "bd_wave_7.bvh"]
    assert [tag.label for tag in tags_of(files).values()] == ["kick", "wave"]
    table = tmp_path / "labels.csv"
    table.write_text("clip,label\nbd_kick_1,foot\nbd_wave_7,hand\n")
    assert [tag.label for tag in tags_of(files, table=table).values()] == ["foot", "hand"]


def test_ambiguous_labels_are_rejected(tmp_path: Path) -> None:
    files, table = [tmp_path / "bd_kick_1.bvh"], tmp_path / "labels.csv"
    with pytest.raises(RetrievalError, match="there is no file"):
        tags_of(files, table=table)
    table.write_text("name,class\nx,y\n")
    with pytest.raises(RetrievalError, match="no columns clip and label"):
        tags_of(files, table=table)
    table.write_text("clip,label\nother,y\n")
    with pytest.raises(RetrievalError, match="bd_kick_1.bvh has no label in"):
        tags_of(files, table=table)


# real motions and the commands


@pytest.fixture(scope="module")
def squats(data_folder: Path) -> list[Path]:
    folder = data_folder / "mocap" / "hdm05"
    return sorted(folder.glob("HDM_bd_squat1Reps_00*.amc"))[:4] + sorted(folder.glob("HDM_bd_kickLFront*.amc"))[:4]


@pytest.mark.data("hdm05")
def test_an_index_has_the_clips_in_order(squats: list[Path], tmp_path: Path) -> None:
    path = tmp_path / "motions.index"
    steps: list[tuple[str, int, int]] = []
    made = index_motions(squats[:2], path, progress=lambda *step: steps.append(step))
    assert made.names == tuple(file.stem for file in squats[:2]) == KeyframeIndex.open(path).names
    assert steps[-1] == ("features", 2, 2)


@pytest.mark.data("hdm05")
def test_an_example_from_a_clip_ranks_its_own_class_first(squats: list[Path], tmp_path: Path) -> None:
    index = index_motions(squats, tmp_path / "motions.index")
    example = cut_example(squats[0], 0.1, load_motion(squats[0]).duration - 0.1)
    own = {file.stem for file in squats[:4]}
    best = search_example(index, example, limit=4)
    assert best[0].document == squats[0].stem and best[0].cost == pytest.approx(0.0, abs=1e-6)
    assert {match.document for match in best} == own


@pytest.mark.data("hdm05")
def test_the_commands_index_learn_and_search(squats: list[Path], tmp_path: Path) -> None:
    import typer

    app = typer.Typer()
    for name, verb in (("index", index_verb), ("search", search_verb), ("learn", learn_verb)):
        app.command(name)(verb)

    def run(*arguments: object) -> str:
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == 0, result.output
        return result.output

    index, queries, hits = tmp_path / "motions.index", tmp_path / "queries.json", tmp_path / "hits.csv"
    assert "8 motions" in run("index", *squats, "--output", index)
    labels = tmp_path / "labels.csv"
    labels.write_text("clip,label\n" + "".join(f"{file.stem},{file.stem.split('_')[2]}\n" for file in squats))
    assert "1.000" in run("learn", *squats, "--labels", labels, "--runs", 2, "--output", queries)
    assert "squat1Reps" in run("search", index, "--queries", queries, "--label", "squat1Reps", "--output", hits)
    rows = list(csv.DictReader(hits.read_text().splitlines()))
    assert {row["document"] for row in rows} >= {file.stem for file in squats[:4]}
    assert squats[0].stem in run("search", index, "--by-example", squats[0], "--from", 0.1, "--to", 0.9)
    film = tmp_path / "hits.webm"
    run("search", index, "--by-example", squats[0], "--limit", 2, "--play", film, "--mocap", squats[0].parent)
    capture = cv2.VideoCapture(str(film))
    frames = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    assert frames >= 30 * load_motion(squats[0]).duration and capture.read()[1].std() > 5.0
    with pytest.raises(UsageError, match="exactly one"):
        run("search", index)
    with pytest.raises(UsageError, match="--play and --mocap"):
        run("search", index, "--by-example", squats[0], "--play", film)


@pytest.mark.data("hdm05")
def test_the_commands_learn_and_annotate_label_a_flat_folder(squats: list[Path], tmp_path: Path) -> None:
    import typer

    app = typer.Typer()
    for name, verb in (
        ("learn", learn_verb), ("annotate", annotate_verb), ("index", index_verb), ("search", search_verb),
    ):  # fmt: skip
        app.command(name)(verb)

    def run(*arguments: object) -> str:
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        assert result.exit_code == 0, (result.output, result.exception)
        return result.output

    model, labels = tmp_path / "motions.npz", tmp_path / "labels"
    shown = run("learn", *squats, "--output", model)
    assert "kickLFront" in shown and "name no performer" in shown and "Without --others" in shown
    run("annotate", squats[1], "--classes", model, "--output", labels)
    (row,) = list(csv.DictReader((labels / "segments.csv").read_text().splitlines()))
    assert row["label"] == "squat1Reps" and float(row["score"]) >= 0.5
    assert "2 classes" in run("learn", *squats, "--templates", "--output", tmp_path / "classes.npz")
    run("annotate", squats[1], "--classes", tmp_path / "classes.npz", "--output", labels)
    assert "squat1Reps" in (labels / "segments.csv").read_text()
    index = tmp_path / "motions.index"
    run("index", *squats[:2], "--output", index)
    hits = tmp_path / "hits.csv"
    assert "squat1Reps" in run("search", index, "--classes", model, "--label", "squat1Reps", "-o", hits)
    rows = list(csv.DictReader(hits.read_text().splitlines()))
    assert {row["document"] for row in rows} == {file.stem for file in squats[:2]}
    assert all(float(row["cost"]) <= 0.9 for row in rows) and float(rows[0]["cost"]) < 0.5
    assert "1 motions" in run("index", squats[0], "--output", index)
