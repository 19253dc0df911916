"""Keyframe query files in JSON, also for manual editing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from toolkit.io.errors import RetrievalError
from toolkit.io.files import save_json
from toolkit.io.yaml_reader import read_json
from toolkit.retrieval.features.relational import feature_fingerprint
from toolkit.retrieval.keyframes.query import KeyframeQuery, keyframes_at_once

QUERY_VERSION: int = 1


def save_queries(path: str | Path, queries: Sequence[KeyframeQuery]) -> None:
    """Write queries with the fingerprint of their features.

    A query is `{"label", "keyframes": [{"F20": 1, ...}, ...], "distances": [[least, greatest or null], ...], "lead",
    "tail"}`, distances, lead and tail in frames at 30 Hz.
    """
    content = [
        {
            "label": query.label,
            "keyframes": [dict(keyframe.values) for keyframe in query.keyframes],
            "distances": [list(bounds) for bounds in query.bounds],
            "lead": query.lead,
            "tail": query.tail,
        }
        for query in queries
    ]
    save_json(path, {"version": QUERY_VERSION, "features": feature_fingerprint(), "queries": content})


def load_queries(path: str | Path) -> list[KeyframeQuery]:
    """Read queries; a keyframe may name features of several sets, and `features` is optional.

    Raises
    ------
    RetrievalError
        The file is missing, no query file, of another version or feature definition, or has unknown features.
    """
    path = Path(path)
    content = read_json(path, RetrievalError, "write queries with `depthmocap learn`")
    if not isinstance(content, dict) or not isinstance(content.get("queries"), list):
        raise RetrievalError(f"{path} has no list of queries; write one with `depthmocap learn`")
    if content.get("version") != QUERY_VERSION:
        raise RetrievalError(
            f"{path} has queries of version {content.get('version')}, not {QUERY_VERSION}; make them again"
        )
    if content.get("features", feature_fingerprint()) != feature_fingerprint():
        raise RetrievalError(
            f"{path} has queries about other feature definitions ({content['features']}, here {feature_fingerprint()})"
            "; learn them again"
        )
    return [_query(entry, path) for entry in content["queries"]]


def _query(entry: dict[str, Any], path: Path) -> KeyframeQuery:
    longest_motion = 10**6  # largest number of frames at 30 Hz, nine hours
    try:
        groups = [keyframes_at_once(dict(keyframe)) for keyframe in entry["keyframes"]]
        distances = [(int(a), None if b is None else int(b)) for a, b in entry.get("distances", [])]
        if any(not 0 <= n <= longest_motion for pair in distances for n in pair if n is not None):
            raise ValueError(f"a distance is not in 0 to {longest_motion} frames")
        lead, tail, label = int(entry.get("lead", 0)), int(entry.get("tail", 0)), str(entry.get("label", ""))
        if not (0 <= lead <= longest_motion and 0 <= tail <= longest_motion):
            raise ValueError(f"lead or tail is not in 0 to {longest_motion} frames")
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise RetrievalError(
            f"a query in {path} is incomplete ({error!r}); give keyframes as feature: value and "
            "distances as [least, greatest]"
        ) from error
    if len(distances) != len(groups) - 1 or not all(groups):
        raise RetrievalError(
            f"query {label!r} in {path} has {len(groups)} keyframes and {len(distances)} distances; "
            "give one distance less than keyframes, and no empty keyframe"
        )
    bounds: list[tuple[int, int | None]] = []
    for k, group in enumerate(groups):
        bounds.extend([distances[k - 1]] if k else [])
        bounds.extend([(0, 0)] * (len(group) - 1))
    return KeyframeQuery(tuple(keyframe for group in groups for keyframe in group), tuple(bounds), lead, tail, label)


def choose_labels(queries: Sequence[KeyframeQuery], labels: Sequence[str] | None) -> list[KeyframeQuery]:
    """Return the queries with these labels, in their order; all without labels.

    Raises
    ------
    RetrievalError
        No query has one of the labels.
    """
    if not labels:
        return list(queries)
    known = {query.label for query in queries}
    for label in labels:
        if label not in known:
            raise RetrievalError(f"no query for the label {label!r}; there are: {', '.join(sorted(known)) or 'none'}")
    return [query for label in labels for query in queries if query.label == label]
