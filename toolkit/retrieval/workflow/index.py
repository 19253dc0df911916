"""From motions to an index."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from pathlib import Path

from toolkit.io.files import check_output
from toolkit.io.workers import end_with
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.workflow.motions import find_motions, load_motion


def index_motions(
    paths: Sequence[str | Path],
    output: str | Path,
    *,
    add: bool = False,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> KeyframeIndex:
    """Index motions and write the index, whole or not at all.

    Parameters
    ----------
    paths : clips, run folders, folders of clips
    output : the index file
    add : add to the index that `output` is, instead of writing a new one
    workers : processes that read; they do not change the result
    progress : told what is done, how many motions are read, and how many there are

    Raises
    ------
    RetrievalError
        Two motions of one name, or an index to add to that does not fit.
    UsageError
        `output` would replace a motion.
    """
    before = KeyframeIndex.open(output) if add else None
    files = find_motions(paths)
    check_output(output, files)
    documents = []
    with (
        ProcessPoolExecutor(workers, initializer=end_with, initargs=(os.getpid(),))
        if workers > 1
        else nullcontext() as pool
    ):
        read = map(_read, files) if pool is None else pool.map(_read, files)
        for number, features in enumerate(read, start=1):
            documents.append(features)
            if progress is not None:
                progress("features", number, len(files))
    index = KeyframeIndex.build(documents) if before is None else before.added(documents)
    index.save(output)
    return index


def _read(file: Path) -> FeatureMatrix:
    return relational_features(load_motion(file))


def remove_motions(names: Sequence[str], output: str | Path) -> KeyframeIndex:
    """Take motions out of an index file.

    Raises
    ------
    RetrievalError
        A name is not in the index, or nothing would be left.
    """
    index = KeyframeIndex.open(output).without(names)
    index.save(output)
    return index
