"""Search for keyframes against all hits, and keyframes of a query."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion.keyframe_search import UNBOUNDED, keyframe_search
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery
from toolkit.retrieval.search.find import HitRanges, find, matching_segments

Segments = list[tuple[int, int]]
EXAMPLE: list[Segments] = [[(3, 4), (6, 7)], [(1, 2), (4, 6), (9, 10)], [(1, 3), (5, 8), (11, 12), (14, 15)]]


def search(lists: list[Segments], bounds: list[tuple[int, int]], document_starts: list[int]) -> Segments:
    offsets = np.cumsum([0, *map(len, lists)])
    starts = np.array([a for segments in lists for a, _ in segments], np.int64)
    ends = np.array([b for segments in lists for _, b in segments], np.int64)
    minimum, maximum = (np.array([b[i] for b in bounds], np.int64) for i in (0, 1))
    return [
        (int(a), int(b)) for a, b in keyframe_search(starts, ends, offsets, minimum, maximum, np.array(document_starts))
    ]


def union_of_all_matches(lists: list[Segments], bounds: list[tuple[int, int]], document_starts: list[int]) -> Segments:
    """Return all hits frame by frame, Eq. 3.2 and 3.3, grouped to matches, Eq. 3.7; overlapping matches are joined."""
    owner = [{n: s for s, (a, b) in enumerate(segments) for n in range(a, b + 1)} for segments in lists]

    def hits(prefix: tuple[int, ...]) -> list[tuple[int, ...]]:
        k = len(prefix)
        if k == len(lists):
            return [prefix]
        document = int(np.searchsorted(document_starts, prefix[-1], side="right"))
        least, greatest = bounds[k - 1]
        frames = [n for n in owner[k] if least <= n - prefix[-1] <= greatest and n < document_starts[document]]
        return [hit for n in frames for hit in hits((*prefix, n))]

    ranges: dict[tuple[int, ...], tuple[int, int]] = {}
    for hit in (hit for n in owner[0] for hit in hits((n,))):
        match = tuple(owner[k][n] for k, n in enumerate(hit))
        low, high = ranges.get(match, (hit[0], hit[-1]))
        ranges[match] = min(low, hit[0]), max(high, hit[-1])
    joined: Segments = []
    for low, high in sorted(ranges.values()):
        if joined and low <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined


def test_the_worked_example_is_found_in_an_index() -> None:
    values = np.zeros((40, 16), dtype=bool)
    for row, segments in zip((0, 14, 26), EXAMPLE, strict=True):
        for a, b in segments:
            values[row, a : b + 1] = True
    index = KeyframeIndex.build(
        [FeatureMatrix("filler", np.zeros((40, 9), dtype=bool)), FeatureMatrix("example", values)]
    )
    keyframes = tuple(Keyframe.of({feature: 1}) for feature in ("F1", "F15", "F27"))
    hits = find(index, KeyframeQuery(keyframes, ((2, 6), (3, 8))))
    assert (hits.documents.tolist(), hits.starts.tolist(), hits.stops.tolist()) == ([1], [3], [16])


Case = tuple[list[Segments], list[tuple[int, int]], list[int]]


@st.composite
def searches(draw: st.DrawFn) -> Case:
    document_starts = [0, *itertools.accumulate(draw(st.lists(st.integers(1, 9), min_size=1, max_size=3)))]
    breaks = set(document_starts)
    lists = []
    for _ in range(draw(st.integers(1, 4))):
        segments: Segments = []
        for frame in draw(st.sets(st.integers(0, document_starts[-1] - 1), max_size=14).map(sorted)):
            if segments and segments[-1][1] == frame - 1 and frame not in breaks:
                segments[-1] = segments[-1][0], frame
            else:
                segments.append((frame, frame))
        lists.append(segments)
    bound = st.tuples(st.integers(0, 5), st.one_of(st.integers(0, 6), st.just(UNBOUNDED)))
    bounds = [
        (least, least + more) for least, more in draw(st.lists(bound, min_size=len(lists) - 1, max_size=len(lists) - 1))
    ]
    return lists, bounds, document_starts


@settings(max_examples=500, deadline=None)
@given(searches())
def test_the_search_finds_the_union_of_all_hit_relevant_ranges(
    case: tuple[list[Segments], list[tuple[int, int]], list[int]],
) -> None:
    assert search(*case) == union_of_all_matches(*case)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_keyframe_list_holds_the_frames_of_each_document_that_match(seed: int) -> None:
    rng = np.random.default_rng(seed)
    documents = [rng.random((40, rng.integers(1, 30))) < 0.5 for _ in range(3)]
    required = {int(row): int(rng.integers(2)) for row in rng.choice(40, rng.integers(1, 4), replace=False)}
    index = KeyframeIndex.build([FeatureMatrix(str(i), values) for i, values in enumerate(documents)])
    keyframe = Keyframe.of({f"F{row + 1}": value for row, value in required.items()})
    starts, ends = matching_segments(index.words, index.document_starts, keyframe)
    expected, offset = [], 0
    for values in documents:
        inside = np.all([values[row] == value for row, value in required.items()], axis=0)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]])))
        expected += [(offset + int(a), offset + int(b) - 1) for a, b in edges.reshape(-1, 2)]
        offset += values.shape[1]
    assert list(zip(starts.tolist(), ends.tolist(), strict=True)) == expected


def test_a_stiff_query_misses_what_a_soft_one_finds() -> None:
    values = np.zeros((40, 100), dtype=bool)
    values[0, [10, 50]], values[1, [20, 65]] = True, True
    index = KeyframeIndex.build([FeatureMatrix("a", values)])
    keyframes = (Keyframe.of({"F1": 1}), Keyframe.of({"F2": 1}))
    assert find(index, KeyframeQuery(keyframes, ((10, 10),))).starts.tolist() == [10]
    assert find(index, KeyframeQuery(keyframes, ((6, 16),))).starts.tolist() == [10, 50]


def ranges(documents: list[int], starts: list[int], stops: list[int]) -> HitRanges:
    return HitRanges(*(np.array(values, np.int64) for values in (documents, starts, stops)))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 20), st.integers(1, 6)), max_size=12))
def test_a_union_holds_the_frames_of_its_parts_in_as_few_ranges_as_can_be(rows: list[tuple[int, int, int]]) -> None:
    parts = [HitRanges(*(np.array([value]) for value in (d, start, start + size))) for d, start, size in rows]
    none = np.empty(0, np.int64)
    union = HitRanges.union([*parts, HitRanges(none, none, none)])
    frames = {(d, frame) for d, start, size in rows for frame in range(start, start + size)}
    assert union.frames == len(frames)
    ranges = list(zip(union.documents, union.starts, union.stops, strict=True))
    assert frames == {(d, frame) for d, start, stop in ranges for frame in range(start, stop)}
    assert ranges == sorted(ranges)
    assert all(a[0] != b[0] or a[2] < b[1] for a, b in zip(ranges, ranges[1:], strict=False))


KNEE, HAND = Keyframe.of({"F21": 1}), Keyframe.of({"F4": 1, "F3": 0})


def test_a_keyframe_names_its_features() -> None:
    assert KNEE == (1 << 20, 1 << 20) and HAND == (0b1100, 0b1000)
    assert HAND.features == {"F3": 0, "F4": 1}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Keyframe.of({"F41": 1}), "unknown feature 'F41'"),
        (lambda: Keyframe.of({"F1": 2}), "has the value 2"),
        (lambda: Keyframe.of({}), "matches every frame"),
        (lambda: KeyframeQuery(()), "at least one keyframe"),
        (lambda: KeyframeQuery((KNEE, HAND)), "2 keyframes and 0 distances"),
        (lambda: KeyframeQuery((KNEE, HAND), ((3, 2),)), "from 3 to 2 frames"),
    ],
)
def test_a_query_that_cannot_work_is_refused_in_one_sentence(make: object, message: str) -> None:
    with pytest.raises(RetrievalError, match=message) as caught:
        make()  # type: ignore[operator]
    assert "\n" not in str(caught.value)
