"""Registry of the trackers by the name in the settings (`tracker:`)."""

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
    """Constructor of a tracker with its settings.

    Attributes
    ----------
    settings : dataclass of its settings
    needs_database : True if it queries a pose database
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
"""Modules that register a tracker of this name when they are imported."""
REGISTERED: dict[str, Registration] = {}


def register(name: str, registration: Registration) -> None:
    """Register a tracker under a name.

    Raises
    ------
    UsageError
        Another tracker has this name.
    """
    if REGISTERED.get(name, registration) != registration:
        raise UsageError(f"a tracker is registered as {name!r} already; choose another name")
    REGISTERED[name] = registration


def registered(name: str) -> Registration:
    """Return the registration of the tracker of this name.

    Raises
    ------
    SettingsError
        There is no tracker of this name.
    """
    if name not in REGISTERED and name in MODULES:
        import_module(MODULES[name])
    if name not in REGISTERED:
        raise SettingsError(f"there is no tracker {name!r}; there are: {', '.join(names())}")
    return REGISTERED[name]


def names() -> list[str]:
    """Return all tracker names, sorted."""
    return sorted(MODULES.keys() | REGISTERED.keys())
