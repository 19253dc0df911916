"""Identities: people numbered, left out, expected back, gone and restored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sensing_scenes import KINECT
from toolkit.io.checkpoint import plain, restore
from toolkit.io.errors import TrackError
from toolkit.people.evidence import Evidence
from toolkit.people.known_people import PATIENCE, KnownPeople, match_heads
from toolkit.people.sighting import PredictedBody
from toolkit.people.view import CoarseCamera
from toolkit.sensing.sensing_settings import SensingSettings

LENS = CoarseCamera(KINECT, np.array([0.0, -1.0, 0.0]), SensingSettings())
HEAD = np.array([0.0, 0.4, -3.0])
ASIDE = np.array([1.2, 0.4, -3.0])
LATER = PATIENCE + 4.0


def met(known: KnownPeople, place: np.ndarray, timestamp: float = 0.0) -> int:
    """Return the number of a person who enters with the head at a place (3,)."""
    back = known.expected_back(timestamp)
    return known.meet(place, place - (0.0, 0.7, 0.0), 0.5, timestamp, back)


def walked_out(known: KnownPeople) -> None:
    """Return identities in which the first person left the image at time 0 and is missing in the next frame."""
    known.keep(replace(known.people[0], head=np.array([1.6, 0.4, -3.0]), velocity=np.array([3.0, 0.0, 0.0])))
    known.end_frame(0.5)


def test_people_are_numbered_in_order_and_an_excess_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    known = KnownPeople(LENS, most=2)
    with caplog.at_level("WARNING"):
        assert [met(known, HEAD + (x, 0.0, 0.0)) for x in (-1.0, 0.0, 1.0, 0.5)] == [1, 2, 0, 0]
    assert [person.id for person in known.people] == [1, 2]
    assert len(caplog.records) == 1 and "raise --people" in caplog.text


def test_a_person_is_present_as_long_as_there_is_patience_and_absent_then() -> None:
    known = KnownPeople(LENS, most=2)
    met(known, HEAD)
    assert [person.id for person in known.present(PATIENCE, {})] == [1]
    assert known.present(PATIENCE + 0.01, {}) == [] and known.expected_back(PATIENCE) == []


def test_who_comes_back_keeps_the_number_and_comes_back_once() -> None:
    known = KnownPeople(LENS, most=3)
    met(known, HEAD)
    back = known.expected_back(LATER)
    places = (HEAD + (0.3, 0.0, 0.0), HEAD - (0.3, 0.0, 0.0))
    numbers = [known.meet(place, place, 0.5, LATER, back) for place in places]
    assert numbers == [1, 2] and back == []
    assert known.people[0].last == LATER and not known.people[0].velocity.any()


def test_a_predicted_body_gives_stature_and_head() -> None:
    known, vertices = KnownPeople(LENS, most=2), np.zeros((3, 3))
    met(known, HEAD)
    met(known, ASIDE)
    bodies = {
        1: PredictedBody(vertices, np.zeros((0, 3), dtype=np.int32), 1.7, np.array([0.1, -0.4, 3.0])),
        2: PredictedBody(vertices, np.zeros((0, 3), dtype=np.int32), 1.6),
    }
    first, second = known.present(0.1, bodies)
    assert (first.stature, second.stature) == (1.7, 1.6)
    np.testing.assert_allclose(first.body_head, [0.1, 0.4, -3.0], atol=1e-9)
    assert np.isnan(second.body_head).all()
    assert known.people[0].stature == 0.0, "what is known changes with the frame, not before"


def test_who_walks_out_of_the_image_is_gone_and_who_is_hidden_within_it_is_not() -> None:
    known = KnownPeople(LENS, most=2)
    met(known, HEAD)
    known.end_frame(0.5)
    assert not known.people[0].gone
    walked_out(known)
    assert known.people[0].gone


@pytest.mark.parametrize(("aside", "gone"), [(1.5, True), (1.3, False)], ids=["half outside", "inside"])
def test_a_person_at_the_border_is_gone_so_that_the_next_to_enter_there_is_another(aside: float, gone: bool) -> None:
    known, place = KnownPeople(LENS, most=3), np.array([aside, 0.4, -3.0])
    met(known, place)
    known.end_frame(0.2)
    (person,) = known.present(0.4, {})
    assert person.gone == gone
    assert match_heads([person], [place - (0.6, 0.0, 0.0)], 0.4) == ({} if gone else {0: 0})


@pytest.mark.parametrize(
    ("others", "score", "most", "expected"),
    [(0, 0.0, 4, [1]), (1, 0.0, 4, []), (1, -30.0, 4, [1]), (1, 0.0, 2, [1])],
    ids=["alone", "of several", "beside furniture", "no more are told apart"],
)
def test_who_went_out_is_expected_back_unless_another_may_come(
    others: int, score: float, most: int, expected: list[int]
) -> None:
    known = KnownPeople(LENS, most)
    met(known, HEAD)
    for _ in range(others):
        met(known, ASIDE - (2.4, 0.0, 0.0))
    walked_out(known)
    for other in known.people[1:]:
        known.keep(replace(other, last=LATER, evidence=Evidence(10 if score else 0, score=score)))
    assert [person.id for person in known.expected_back(LATER)] == expected


def test_people_are_there_and_back_as_arrays() -> None:
    known, other = KnownPeople(LENS, most=3), KnownPeople(LENS, most=3)
    restore(other, plain(known), "people")
    assert other.people == []
    met(known, HEAD)
    met(known, ASIDE, 0.2)
    known.keep(known.people[1].with_sample(score=1.5, moved=1.0, timestamp=0.3))
    restore(other, plain(known), "people")
    np.testing.assert_equal(plain(other), plain(known))
    assert [person.evidence for person in other.people] == [Evidence(), Evidence(1, 1.5, 1)]


@pytest.mark.parametrize("numbers", [[1, 1], [2, 1], [1, 3]])
def test_people_who_are_not_numbered_in_order_are_refused(numbers: list[int]) -> None:
    known = KnownPeople(LENS, most=3)
    met(known, HEAD)
    met(known, ASIDE)
    with pytest.raises(TrackError, match="not numbered 1, 2"):
        rows = plain(known)["people"]
        restore(known, {"people": [row | {"id": n} for row, n in zip(rows, numbers, strict=True)]}, "people")
