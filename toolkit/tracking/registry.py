"""The trackers by name: `tracker:` in the settings says which one is built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from toolkit.io.errors import SettingsError, UsageError
from toolkit.tracking.tracker_protocol import Tracker

DEFAULT = "hybrid"


@dataclass(frozen=True)
class Registration:
    """How a tracker is built.

    Attributes
    ----------
    settings : dataclass of its settings
    needs_database : whether it looks poses up
    build : `build(settings, database, database_path)`; the database is None for a tracker that needs none
    """

    settings: type
    needs_database: bool
    build: Callable[[Any, Any, str], Tracker]


MODULES = {
    "baak2013": "toolkit.trackers.baak2013",
    "hybrid": "toolkit.trackers.hybrid.tracker",
    "particles": "toolkit.trackers.lopez2011.tracker",
    "swarm": "toolkit.trackers.qammaz.tracker",
}
"""Modules that register a tracker of this name when they are imported; other trackers are not imported."""
REGISTERED: dict[str, Registration] = {}


def register(name: str, registration: Registration) -> None:
    """Make a tracker known under a name.

    Raises
    ------
    UsageError
        The name is taken.
    """
    if REGISTERED.get(name, registration) != registration:
        raise UsageError(f"a tracker is registered as {name!r} already; choose another name")
    REGISTERED[name] = registration


def registered(name: str) -> Registration:
    """How the tracker of this name is built.

    Raises
    ------
    SettingsError
        There is none.
    """
    if name not in REGISTERED and name in MODULES:
        import_module(MODULES[name])
    if name not in REGISTERED:
        raise SettingsError(f"there is no tracker {name!r}; there are: {', '.join(names())}")
    return REGISTERED[name]


def names() -> list[str]:
    """All trackers, by name."""
    return sorted(MODULES.keys() | REGISTERED.keys())
