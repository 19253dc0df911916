import pytest

from toolkit.io.errors import RetrievalError
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery, keyframes_at_once

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
