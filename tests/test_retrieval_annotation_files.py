"""Annotation of files: learned and stored classes, keyframe preselection, reports, bad inputs."""

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks._keyframe_corpus import THRESHOLDS, Fold, learn_threshold
from toolkit.body.shape import load_body
from toolkit.io.errors import RetrievalError
from toolkit.mocap.procedural import procedural_clips
from toolkit.output.export.bvh import export_bvh
from toolkit.retrieval.annotation.annotation_report import read_segments, score, write_report
from toolkit.retrieval.annotation.annotator import AS_PUBLISHED, Annotator, MotionClass
from toolkit.retrieval.annotation.classes import learn_classes, load_classes, save_classes
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery
from toolkit.retrieval.search.find import preselect
from toolkit.retrieval.workflow.annotate import annotate_motions
from toolkit.retrieval.workflow.learn import learn_templates
from toolkit.retrieval.workflow.motions import load_motion

NAMES = ("squat", "kick_front", "wave")


@pytest.fixture(scope="module")
def matrices() -> dict[str, list[FeatureMatrix]]:
    """Return features of four variations each of three procedural motions."""
    body = load_body("neutral")
    return {
        name: [
            replace(relational_features(from_poses(clip.poses, body, clip.frame_rate, clip.name)), name=f"{name} {i}")
            for i, clip in enumerate(procedural_clips([name], body=body, variations=4, seed=1))
        ]
        for name in NAMES
    }


@pytest.fixture(scope="module")
def classes(matrices: dict[str, list[FeatureMatrix]]) -> list[MotionClass]:
    return learn_classes({name: clips[:-1] for name, clips in matrices.items()}, threshold=0.08)


@pytest.fixture(scope="module")
def document(matrices: dict[str, list[FeatureMatrix]]) -> tuple[FeatureMatrix, list[Segment]]:
    """Return the last variation of each motion, one after the other, with half a second of noise between."""
    rng = np.random.default_rng(0)
    columns, segments, now = [], [], 0
    for name, clips in matrices.items():
        columns += [rng.random((40, 15)) < 0.5, clips[-1].values]
        segments.append(Segment((now + 15) / 30.0, (now + 15 + len(clips[-1])) / 30.0, name))
        now += 15 + len(clips[-1])
    return FeatureMatrix("document", np.concatenate(columns, axis=1)), segments


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, str]:
    """Write two variations each of two motions as BVH files."""
    folder, body = tmp_path_factory.mktemp("clips"), load_body("neutral")
    written = {}
    for name in NAMES[:2]:
        for i, clip in enumerate(procedural_clips([name], body=body, variations=2)):
            export_bvh(path := folder / f"{name}_{i}.bvh", body, clip.poses, clip.frame_rate)
            written[path] = name
    return written


def test_held_out_motions_are_labelled(
    classes: list[MotionClass], document: tuple[FeatureMatrix, list[Segment]]
) -> None:
    features, truth = document
    annotation = Annotator(classes).annotate(features)
    scores = score(annotation, truth)
    assert scores["segments"].recall == 1.0 and scores["frames"].f > 0.8


def test_classes_are_read_as_they_were_written(classes: list[MotionClass], tmp_path: Path) -> None:
    save_classes(tmp_path / "classes.npz", classes)
    for read, written in zip(load_classes(tmp_path / "classes.npz"), classes, strict=True):
        assert (read.label, read.threshold) == (written.label, written.threshold)
        np.testing.assert_array_equal(read.template.values, written.template.values)
        np.testing.assert_array_equal(read.template.weights, written.template.weights)


def test_the_learned_threshold_finds_the_motions_and_leaves_the_rest(
    matrices: dict[str, list[FeatureMatrix]], document: tuple[FeatureMatrix, list[Segment]]
) -> None:
    some = learn_classes({name: clips[:2] for name, clips in matrices.items()})
    labelled: Any = SimpleNamespace(features=document[0], segments=document[1])
    threshold = learn_threshold([Fold(some, [labelled])])
    assert threshold in THRESHOLDS.tolist()
    annotated = Annotator([replace(c, threshold=threshold) for c in some]).annotate(document[0])
    assert score(annotated, document[1])["frames"].f > 0.7


def test_preselection_keeps_the_widened_hits_of_a_query_and_all_frames_of_a_class_without_one() -> None:
    values = np.zeros((40, 50), dtype=bool)
    values[19, 20:23] = True
    query = KeyframeQuery((Keyframe.of({"F20": 1}),), (), 2, 4, "squat")
    index = KeyframeIndex.build([FeatureMatrix("d", values)])
    assert preselect(index, [query, query], ("squat", "wave")) == [{"squat": [(17, 29)], "wave": [(0, 50)]}]
    with pytest.raises(RetrievalError, match="unknown class 'squat'"):
        preselect(index, [query], ("wave",))


def test_a_report_holds_table_picture_and_page(
    classes: list[MotionClass], document: tuple[FeatureMatrix, list[Segment]], tmp_path: Path
) -> None:
    features, truth = document
    annotation = Annotator(classes).annotate(features)
    scores = write_report(annotation, tmp_path, truth)
    rows = list(csv.DictReader((tmp_path / "segments.csv").read_text().splitlines()))
    assert list(rows[0]) == ["start", "end", "label", "score"] and len(rows) == len(annotation.segments)
    assert scores["frames"].f > 0.5
    assert (tmp_path / "annotation.png").read_bytes()[:4] == b"\x89PNG"
    page = (tmp_path / "report.html").read_text()
    assert all(word in page for word in ("squat", "over frames", "data:image/png;base64", "right"))
    read = read_segments(tmp_path / "segments.csv")
    assert [(s.label, round(s.start, 2)) for s in read] == [(s.label, round(s.start, 2)) for s in annotation.segments]


def test_motion_files_become_report_folders(files: dict[Path, str], tmp_path: Path) -> None:
    classes = learn_templates(files)
    paths = list(files)
    several = annotate_motions(paths, classes, tmp_path / "all")
    assert sorted(folder.name for folder in (tmp_path / "all").iterdir()) == sorted(path.stem for path in paths)
    for path, done in zip(paths, several, strict=True):
        assert files[path] in {segment.label for segment in done.annotation.segments}
    (tmp_path / "truth.csv").write_text(f"start,end,label\n0,1,{files[paths[0]]}\n")
    one = annotate_motions(paths[:1], classes, tmp_path / "one", truth=tmp_path / "truth.csv", threshold=0.1)
    assert (tmp_path / "one" / "segments.csv").is_file() and one[0].scores["segments"].recall == 1.0


def test_templates_as_published_decide_by_the_rules_and_the_threshold_of_the_thesis(
    files: dict[Path, str], tmp_path: Path
) -> None:
    classes, path = learn_templates(files), next(iter(files))
    strict = [replace(c, threshold=0.01) for c in classes]
    (done,) = annotate_motions([path], strict, tmp_path / "published", as_published=True)
    told = Annotator([replace(c, threshold=0.13) for c in classes], AS_PUBLISHED)
    expected = told.annotate(relational_features(load_motion(path)))
    assert list(done.annotation.segments) == list(expected.segments)
    assert told.settings.overlap == 1.0 and told.settings.visible == 0.0
