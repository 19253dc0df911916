"""Recipe of a tracker, and its construction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.app.config import load_settings, tracker_name
from toolkit.body.personal import load_body_file
from toolkit.database.database import PoseDatabase
from toolkit.fitting.guide import Guide
from toolkit.io.errors import UsageError
from toolkit.io.files import is_file, sha256_of
from toolkit.tracking.registry import DEFAULT, Registration, registered
from toolkit.tracking.tracker_protocol import AcceptsBody, AcceptsGuide, Tracker
from toolkit.tracking.tracker_settings import TrackerSettings


@dataclass(frozen=True)
class TrackerRecipe:
    """Inputs of a tracker; None where absent.

    Attributes
    ----------
    config, overrides : settings, see `config.load_settings`; the default tracker is `hybrid`
    database : file of the pose database, for trackers with a database lookup
    body : body file of the person; None = estimated from the recording
    sensors : file of the inertial sensors that guide it
    """

    config: str | Path | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)
    database: str | Path | None = None
    body: str | Path | None = None
    sensors: str | Path | None = None

    def build(self, guide: Guide | None = None) -> Tracker:
        """Build the tracker, guided by the inertial sensors if there are any.

        Raises
        ------
        BodyError
            The body file cannot be read, or holds a body of another mesh.
        DatabaseError
            The database cannot be read, or belongs to another body or format version.
        SettingsError
            The tracker is unknown, or a setting is unknown or invalid.
        UsageError
            The tracker needs a database and none was given, or it accepts no guide or no body.
        """
        settings = self.settings()
        if not self.needs_database():
            tracker = self._registration().build(settings, None, "")
        elif self.database is None:
            raise UsageError(f"the tracker {settings.tracker!r} needs a pose database; name one")
        else:
            tracker = self._registration().build(settings, PoseDatabase.load(self.database), str(self.database))
        if self.body is not None:
            own = load_body_file(self.body)
            if not isinstance(tracker, AcceptsBody):
                raise UsageError(f"the tracker {settings.tracker!r} takes no body; leave --body out")
            tracker.set_body(own)
        if guide is not None:
            if not isinstance(tracker, AcceptsGuide):
                raise UsageError(f"the tracker {settings.tracker!r} takes no inertial sensors; use the hybrid one")
            tracker.guide = guide
        return tracker

    def settings(self) -> TrackerSettings:
        """Return the settings of the tracker; raises SettingsError as `build`."""
        settings: TrackerSettings = load_settings(self._registration().settings, self.config, self.overrides)
        return settings

    def needs_database(self) -> bool:
        """Return whether the tracker needs a database; raises SettingsError as `build`."""
        return self._registration().needs_database

    def files(self) -> list[Path]:
        """Return the input files, which no run may replace."""
        config = self.config if self.config and is_file(self.config) else None
        return [Path(file) for file in (self.database, config, self.sensors, self.body) if file]

    def digests(self) -> dict[str, Any]:
        """Return the entries of `RunInfo` for sensors and body: their SHA-256, or nothing."""
        files = {"sensors_sha256": self.sensors, "body_sha256": self.body}
        return {name: sha256_of(file) if file else "" for name, file in files.items()}

    @property
    def tracker(self) -> str:
        """Return the registered name of the tracker; raises SettingsError as `build`."""
        return tracker_name(self.config, self.overrides) or DEFAULT

    def _registration(self) -> Registration:
        return registered(self.tracker)


_WORKER_TRACKERS: dict[str, Tracker] = {}
"""Trackers of this worker process by their recipe."""


def worker_tracker(recipe: TrackerRecipe) -> Tracker:
    """Return the tracker of this worker process, built once."""
    key = repr(recipe)
    if key not in _WORKER_TRACKERS:
        _WORKER_TRACKERS[key] = recipe.build()
    return _WORKER_TRACKERS[key]
