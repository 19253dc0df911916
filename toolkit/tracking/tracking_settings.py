"""Settings of every tracker with a follower."""

from __future__ import annotations

from typing import Protocol

from toolkit.io.errors import SettingsError


class FollowerSettings(Protocol):
    """Thresholds for empty and lost frames, and smoothing; see `HybridSettings`."""

    @property
    def smallest_person(self) -> int: ...  # noqa: D102
    @property
    def lost_distance(self) -> float: ...  # noqa: D102
    @property
    def patience(self) -> float: ...  # noqa: D102
    @property
    def smoothing(self) -> float: ...  # noqa: D102


def check_seed(seed: int) -> None:
    """Check a seed of random generators.

    Raises
    ------
    SettingsError
        It is negative.
    """
    if seed < 0:
        raise SettingsError(f"seed is {seed}; it is a whole number, at least 0")
