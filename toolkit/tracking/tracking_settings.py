"""What the settings of every tracker with a follower hold."""

from __future__ import annotations

from typing import Protocol

from toolkit.io.errors import SettingsError


class FollowerSettings(Protocol):
    """When a frame counts as empty or lost, and what is reported; see `HybridSettings`."""

    @property
    def smallest_person(self) -> int: ...  # noqa: D102
    @property
    def lost_distance(self) -> float: ...  # noqa: D102
    @property
    def patience(self) -> float: ...  # noqa: D102
    @property
    def smoothing(self) -> float: ...  # noqa: D102


def check_seed(seed: int) -> None:
    """A seed is a number that generators take.

    Raises
    ------
    SettingsError
        It is negative.
    """
    if seed < 0:
        raise SettingsError(f"seed is {seed}; it is a whole number, at least 0")
