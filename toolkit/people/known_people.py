"""Identities: tracked people, matched between frames and re-identified when they return."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from toolkit.people.sighting import PredictedBody
from toolkit.people.tracks import GATE, UNKNOWN, KnownPerson
from toolkit.people.view import CoarseCamera

logger = logging.getLogger(__name__)

PATIENCE = 1.0
"""Seconds for which an unseen person is expected at the last place."""
TALLER, SHORTER = 0.08, 0.12  # m by which a returning person may differ: shoes and noise; a bent neck as well
WALK = 2.5  # m/s: the fastest motion of a person out of sight in a room


class KnownPeople:
    """Tracked people of one stream.

    Parameters
    ----------
    coarse : coarse camera of the frames in which they are found
    most : maximum number of tracked people; later ones are left out

    Attributes
    ----------
    people : by rising id
    """

    CHECKPOINT = ("people",)
    people: list[KnownPerson]

    def __init__(self, coarse: CoarseCamera, most: int) -> None:
        self.people = []
        self._coarse, self._most, self._left_out = coarse, most, False

    def present(self, timestamp: float, predicted: Mapping[int, PredictedBody]) -> list[KnownPerson]:
        """Return the people seen within `PATIENCE`, with stature and head of their predicted bodies (by id)."""
        present = [p for p in self.people if timestamp - p.last <= PATIENCE]
        for k, person in enumerate(present):
            if person.id in predicted:
                body = predicted[person.id]
                head = UNKNOWN if body.head is None else self._coarse.to_level(body.head[None])[0]
                present[k] = replace(person, stature=float(body.stature), body_head=head)
        return present

    def expected_back(self, timestamp: float) -> list[KnownPerson]:
        """Return the people out of view who may return: those who left the image, and those unseen for `PATIENCE`.

        In a room of several people a person who left the image is not expected back: the next one to enter is mostly
        another person. With one person, or at the maximum number, any of them may return.
        """
        people = sum(person.evidence.log_odds > 0 for person in self.people)
        others = 1 < people and len(self.people) < self._most
        away = [p for p in self.people if p.gone or timestamp - p.last > PATIENCE]
        return [p for p in away if not (others and p.gone)]

    def keep(self, person: KnownPerson) -> int:
        """Replace the person with the same id and return the id."""
        self.people[person.id - 1] = person
        return person.id

    def meet(
        self,
        place: np.ndarray,
        middle: np.ndarray,
        area: float,
        timestamp: float,
        back: list[KnownPerson],
    ) -> int:
        """Return the id of a person who enters; 0 for one beyond the maximum number.

        Parameters
        ----------
        place : (3,), of the head, level frame, metres
        middle, area : as in `KnownPerson`
        back : those who may come back; who does is taken from the list
        """
        again = re_identified(back, place, timestamp)
        if again is not None:
            back.remove(again)
            return self.keep(replace(again, head=place).seen(place, middle, area, timestamp))
        if len(self.people) < self._most:
            number = len(self.people) + 1
            self.people.append(
                KnownPerson(number, place, np.zeros(3), timestamp, timestamp, float(place[1]), middle, area)
            )
            return number
        if not self._left_out:
            self._left_out = True
            logger.warning(
                "at %.2f s a person came who is left out: %d people are followed already; raise --people to follow "
                "more",
                timestamp,
                self._most,
            )
        return 0

    def end_frame(self, timestamp: float) -> None:
        """Mark people who left the image: unseen in this frame and expected outside or at the border of the image."""
        half_width = 0.25  # m from a head to a shoulder: half of a person whose head is so near the border is outside
        for k, person in enumerate(self.people):
            unseen = person.last < timestamp and not self._coarse.shows(person.expected(timestamp), half_width)
            self.people[k] = replace(person, gone=person.gone or unseen)

    def check_restored(self) -> None:
        """Raise ValueError for people out of order, see `toolkit.io.checkpoint.restore`."""
        if [person.id for person in self.people] != list(range(1, len(self.people) + 1)):
            raise ValueError("its people are not numbered 1, 2, ...")


def assigned(costs: np.ndarray, gates: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs (row, column) of minimum total cost (R, C) below the gate of each row (R,)."""
    from scipy.optimize import linear_sum_assignment

    if costs.size == 0:
        return []
    beyond = costs > gates[:, None]
    rows, columns = linear_sum_assignment(np.where(beyond, 1e3, costs))
    return [(int(r), int(c)) for r, c in zip(rows, columns, strict=True) if not beyond[r, c]]


def match_heads(people: Sequence[KnownPerson], heads: Sequence[np.ndarray], timestamp: float) -> dict[int, int]:
    """Match heads to people: index of the person -> index of the head."""
    if not people or not heads:
        return {}
    expected = np.array([p.expected(timestamp) for p in people])
    costs = np.sqrt(((expected[:, None] - np.array(heads)[None]) ** 2).sum(axis=2))
    return dict(assigned(costs, np.array([p.gate(timestamp) for p in people])))


def re_identified(absent: Sequence[KnownPerson], head: np.ndarray, timestamp: float) -> KnownPerson | None:
    """Return the absent person who may have returned with this head: the one whose height fits best, or None.

    A returning person may sit but is not taller than before, and had enough time to get there.
    """
    best: tuple[float, KnownPerson] | None = None
    for person in absent:
        way = float(np.hypot(head[0] - person.head[0], head[2] - person.head[2]))
        taller = float(head[1]) - person.tallest
        if way > GATE + WALK * (timestamp - person.last) or taller > TALLER:
            continue
        cost = abs(taller) if taller > -SHORTER else SHORTER + 0.01 * way
        if best is None or cost < best[0]:
            best = (cost, person)
    return None if best is None else best[1]
