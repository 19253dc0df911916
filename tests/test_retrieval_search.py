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
from toolkit.retrieval.keyframes.query import (
    SET_FEATURES,
    Keyframe,
    KeyframeQuery,
    keyframes_at_once,
    keyframes_of_column,
)
from toolkit.retrieval.search.find import HitRanges, find

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
    keyframes = [
        Keyframe(name, ((feature, 1),)) for name, feature in (("upper", "F1"), ("lower", "F15"), ("mixed", "F27"))
    ]
    hits = find(index, KeyframeQuery(tuple(keyframes), ((2, 6), (3, 8))))
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


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 999999), st.booleans())
def test_leaving_out_segments_far_from_the_rarest_keyframe_changes_no_hit(seed: int, sparse: bool) -> None:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(5, 60, size=4)
    rows = [np.cumsum(rng.random((40, n)) < 0.15, axis=1) % (9 if sparse else 2) == 1 for n in lengths]
    index = KeyframeIndex.build([FeatureMatrix(str(i), row) for i, row in enumerate(rows)])
    keyframes, bounds = [], []
    for _ in range(rng.integers(1, 5)):
        name = str(rng.choice(list(SET_FEATURES)))
        chosen = rng.choice(SET_FEATURES[name], rng.integers(1, 3), replace=False)
        keyframes.append(Keyframe(name, tuple((str(feature), int(rng.integers(2))) for feature in chosen)))
        least = int(rng.integers(4))
        bounds.append((least, None if rng.random() < 0.2 else least + int(rng.integers(7))))
        if rng.random() < 0.4:
            bounds[-1] = (0, 0)
    query = KeyframeQuery(tuple(keyframes), tuple(bounds[1:]))
    lists = [index.keyframe_list(keyframe) for keyframe in keyframes]
    whole = [list(zip(starts.tolist(), ends.tolist(), strict=True)) for starts, ends in lists]
    numbers = [(least, UNBOUNDED if greatest is None else greatest) for least, greatest in query.bounds]
    hits = find(index, query)
    first = index.document_starts[hits.documents]
    found = list(zip((hits.starts + first).tolist(), (hits.stops + first - 1).tolist(), strict=True))
    assert found == search(whole, numbers, index.document_starts.tolist())


def test_several_keyframes_at_one_position_constrain_the_same_frame() -> None:
    rng = np.random.default_rng(0)
    values = rng.random((40, 400)) < 0.5
    index = KeyframeIndex.build([FeatureMatrix("noise", values)])
    column = np.full(40, -1, np.int8)
    column[[1, 8, 16, 30]] = 1, 0, 1, 1
    keyframes = keyframes_of_column(column)
    hits = find(index, KeyframeQuery(keyframes, ((0, 0),) * (len(keyframes) - 1)))
    expected = np.flatnonzero(values[1] & ~values[8] & values[16] & values[30])
    frames = np.concatenate([np.arange(a, b) for a, b in zip(hits.starts, hits.stops, strict=True)])
    assert np.array_equal(frames, expected) and len(expected) > 5


def test_a_stiff_query_misses_what_a_soft_one_finds() -> None:
    values = np.zeros((40, 100), dtype=bool)
    values[0, [10, 50]], values[1, [20, 65]] = True, True
    index = KeyframeIndex.build([FeatureMatrix("a", values)])
    keyframes = [Keyframe("upper", (("F1", 1),)), Keyframe("upper", (("F2", 1),))]
    assert find(index, KeyframeQuery(tuple(keyframes), ((10, 10),))).starts.tolist() == [10]
    assert find(index, KeyframeQuery(tuple(keyframes), ((6, 16),))).starts.tolist() == [10, 50]


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


KNEE = Keyframe("lower", (("F21", 1),))
HAND = Keyframe("upper", (("F4", 1), ("F3", 0)))


def test_a_condition_on_several_sets_becomes_one_keyframe_per_set() -> None:
    frames = keyframes_at_once({"F40": 1, "F1": 0, "F15": 1})
    assert [(k.feature_set, k.values) for k in frames] == [
        ("upper", (("F1", 0),)),
        ("lower", (("F15", 1),)),
        ("mixed", (("F40", 1),)),
    ]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Keyframe("arms", (("F1", 1),)), "unknown feature set 'arms'"),
        (lambda: Keyframe("upper", (("F41", 1),)), "unknown feature 'F41'"),
        (lambda: keyframes_at_once({"knee": 1}), "unknown feature 'knee'"),
        (lambda: Keyframe("upper", (("F20", 1),)), "F20 is not in the set 'upper'"),
        (lambda: Keyframe("upper", (("F1", 2),)), "has the value 2"),
        (lambda: Keyframe("upper", ()), "matches every frame"),
        (lambda: KeyframeQuery(()), "at least one keyframe"),
        (lambda: KeyframeQuery((KNEE, HAND)), "need 1 distances"),
        (lambda: KeyframeQuery((KNEE, HAND), ((3, 2),)), "from 3 to 2 frames"),
        (lambda: KeyframeQuery((KNEE,), lead=-1), "lead -1"),
    ],
)
def test_a_query_that_cannot_work_is_refused_in_one_sentence(make: object, message: str) -> None:
    with pytest.raises(RetrievalError, match=message) as caught:
        make()  # type: ignore[operator]
    assert "\n" not in str(caught.value)
