from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from toolkit.io.archives import save_archive
from toolkit.io.errors import RetrievalError
from toolkit.retrieval import stored_arrays as stored
from toolkit.retrieval.features.relational import FeatureMatrix, pack
from toolkit.retrieval.index import keyframe_index as index_module
from toolkit.retrieval.index.keyframe_index import KeyframeIndex


def random_document(rng: np.random.Generator, name: str, frames: int) -> FeatureMatrix:
    """Return a document of few changing and many constant features: long runs, as in motions."""
    values = np.zeros((40, frames), dtype=bool)
    for row in rng.choice(40, 8, replace=False):
        values[row] = np.cumsum(rng.random(frames) < 0.2) % 2 == 1
    return FeatureMatrix(name, values)


@pytest.fixture
def documents() -> list[FeatureMatrix]:
    rng = np.random.default_rng(4)
    return [random_document(rng, f"clip{i}", frames) for i, frames in enumerate((40, 1, 75, 33))]


def arrays(index: KeyframeIndex) -> dict[str, np.ndarray]:
    return {name: value for name, value in vars(index).items() if isinstance(value, np.ndarray)}


def same(a: KeyframeIndex, b: KeyframeIndex) -> bool:
    pairs = zip(arrays(a).items(), arrays(b).items(), strict=True)
    return a.names == b.names and all(
        n == m and np.array_equal(x, y) and x.dtype == y.dtype for (n, x), (m, y) in pairs
    )


def test_an_index_holds_the_features_of_every_frame(documents: list[FeatureMatrix]) -> None:
    index = KeyframeIndex.build(documents)
    assert index.frames == 149 and len(index) == 4
    assert np.array_equal(index.words, pack(np.concatenate([document.values for document in documents], axis=1)))


def test_an_index_on_disk_is_the_index_in_memory(documents: list[FeatureMatrix], tmp_path: Path) -> None:
    index = KeyframeIndex.build(documents)
    index.save(tmp_path / "motions.index")
    assert same(index, KeyframeIndex.open(tmp_path / "motions.index"))


def test_an_index_that_cannot_be_built_is_refused(documents: list[FeatureMatrix]) -> None:
    with pytest.raises(RetrievalError, match="no document"):
        KeyframeIndex.build([])
    with pytest.raises(RetrievalError, match="'clip0'"):
        KeyframeIndex.build([documents[0], documents[0]])
    with pytest.raises(RetrievalError, match="'nothing' has no frame"):
        KeyframeIndex.build([FeatureMatrix("nothing", np.zeros((40, 0), dtype=bool))])


def test_an_index_of_other_features_or_another_version_is_refused(
    documents: list[FeatureMatrix], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "motions.index"
    index = KeyframeIndex.build(documents)
    monkeypatch.setattr(stored, "feature_fingerprint", lambda: "0123456789abcdef")
    index.save(path)
    monkeypatch.undo()
    with pytest.raises(RetrievalError, match="other features .0123456789abcdef"):
        KeyframeIndex.open(path)
    monkeypatch.setattr(index_module, "KIND", replace(index_module.KIND, version=0))
    index.save(path)
    monkeypatch.undo()
    with pytest.raises(RetrievalError, match="version 0, not 6"):
        KeyframeIndex.open(path)


def test_a_file_that_is_no_whole_index_is_refused(documents: list[FeatureMatrix], tmp_path: Path) -> None:
    path = tmp_path / "motions.index"
    with pytest.raises(RetrievalError, match="there is no file"):
        KeyframeIndex.open(path)
    path.write_bytes(b"PK something else entirely")
    with pytest.raises(RetrievalError, match="no NPZ file.*build it again"):
        KeyframeIndex.open(path)
    KeyframeIndex.build(documents).save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(RetrievalError, match="build it again"):
        KeyframeIndex.open(path)
    save_archive(path, {"header": np.array("{}"), "words": np.zeros(3, np.uint64)})
    with pytest.raises(RetrievalError, match="is not a keyframe index, it has no document_starts"):
        KeyframeIndex.open(path)
