"""Indexing of motion files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from toolkit.io.files import check_output
from toolkit.io.workers import task_of
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.workflow.motions import find_motions, load_motion


def index_motions(
    paths: Sequence[str | Path],
    output: str | Path,
    *,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> KeyframeIndex:
    """Index motions and write the index, atomically.

    Parameters
    ----------
    paths : clips, run folders, folders of clips
    output : the index file
    workers : number of reading processes, without effect on the result
    progress : callback with the operation, the number of motions read, and their total

    Raises
    ------
    RetrievalError
        Two motions have the same name.
    UsageError
        `output` would replace a motion.
    """
    from joblib import Parallel, delayed

    files = find_motions(paths)
    check_output(output, files)
    documents = []
    for features in Parallel(n_jobs=workers, return_as="generator")(delayed(task_of(_read))(file) for file in files):
        documents.append(features)
        if progress is not None:
            progress("features", len(documents), len(files))
    index = KeyframeIndex.build(documents)
    index.save(output)
    return index


def _read(file: Path) -> FeatureMatrix:
    return relational_features(load_motion(file))
