"""From motions to an index."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from toolkit.files import check_output
from toolkit.retrieval.features.relational import relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.workflow.motions import find_motions, load_motion


def index_motions(
    paths: Sequence[str | Path],
    output: str | Path,
    *,
    add: bool = False,
    progress: Callable[[str, int, int], None] | None = None,
) -> KeyframeIndex:
    """Index motions and write the index, whole or not at all.

    Parameters
    ----------
    paths : clips, run folders, folders of clips
    output : the index file
    add : add to the index that `output` is, instead of writing a new one
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
    for number, file in enumerate(files, start=1):
        documents.append(relational_features(load_motion(file)))
        if progress is not None:
            progress("features", number, len(files))
    index = KeyframeIndex.build(documents) if before is None else before.added(documents)
    index.save(output)
    return index
