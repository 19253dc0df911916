"""What a tracker is made of, and the tracker made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.config import load_settings, setting_of
from toolkit.database.database import PoseDatabase
from toolkit.errors import UsageError
from toolkit.files import is_file, sha256_of
from toolkit.tracking.guide import Guide
from toolkit.tracking.protocol import Tracker, TrackerSettings
from toolkit.tracking.registry import DEFAULT, registered


@dataclass(frozen=True)
class TrackerRecipe:
    """What a tracker is made of, see `load_tracker`; None where there is none.

    Attributes
    ----------
    config, overrides : its settings
    database : file of the pose database
    body : file of the person's own body
    sensors : file of the inertial sensors that guide it
    """

    config: str | Path | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)
    database: str | Path | None = None
    body: str | Path | None = None
    sensors: str | Path | None = None

    def build(self, guide: Guide | None = None) -> Tracker:
        """The tracker, guided by what its sensors say; raises as `load_tracker`."""
        return load_tracker(self.config, self.overrides, database=self.database, guide=guide, body=self.body)

    def files(self) -> list[Path]:
        """Those that it is made of: no run may replace one."""
        config = self.config if self.config and is_file(self.config) else None
        return [Path(file) for file in (self.database, config, self.sensors, self.body) if file]

    def digests(self) -> dict[str, Any]:
        """What `RunInfo` says of sensors and body: their SHA-256, empty without."""
        files = {"sensors_sha256": self.sensors, "body_sha256": self.body}
        return {name: sha256_of(file) if file else "" for name, file in files.items()}


def load_tracker(
    config: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    database: str | Path | None = None,
    guide: Guide | None = None,
    body: str | Path | None = None,
) -> Tracker:
    """The tracker that the settings name, `hybrid` if they name none.

    Parameters
    ----------
    config, overrides : settings, see `config.load_settings`; `baak2013` is the hybrid tracker as in the paper
    database : file of the pose database, for trackers that look poses up
    guide : what is known of the frames besides their depth
    body : file of the person's own body; otherwise it is learnt from the recording

    Raises
    ------
    BodyError
        The body's file cannot be read, or holds a body of another mesh.
    DatabaseError
        The database cannot be read or belongs to another body or format version.
    SettingsError
        There is no such tracker, or a setting is unknown or wrong.
    UsageError
        The tracker needs a database and none was given, or it takes no guide or no body.
    """
    settings = tracker_settings(config, overrides)
    name = setting_of("tracker", config, overrides) or DEFAULT
    registration = registered(name)
    if not registration.needs_database:
        tracker = registration.build(settings, None, "")
    elif database is None:
        raise UsageError(f"the tracker {name!r} looks poses up; name a pose database")
    else:
        tracker = registration.build(settings, PoseDatabase.load(database), str(database))
    return _guided(_embodied(tracker, body), guide)


def tracker_settings(config: str | Path | None = None, overrides: Mapping[str, Any] | None = None) -> TrackerSettings:
    """The settings of the tracker that they name, `hybrid` without a name; raises SettingsError as `load_tracker`."""
    registration = registered(setting_of("tracker", config, overrides) or DEFAULT)
    settings: TrackerSettings = load_settings(registration.settings, config, overrides)
    return settings


def needs_database(config: str | Path | None = None, overrides: Mapping[str, Any] | None = None) -> bool:
    """Whether the tracker that the settings name looks poses up; raises as `load_tracker`."""
    return registered(setting_of("tracker", config, overrides) or DEFAULT).needs_database


def _embodied(tracker: Tracker, body: str | Path | None) -> Tracker:
    if body is None:
        return tracker
    from toolkit.body.personal import load_body_file
    from toolkit.tracking.protocol import TakesBody

    own = load_body_file(body)
    if not isinstance(tracker, TakesBody):
        raise UsageError(f"the tracker {tracker.settings.tracker!r} takes no body; leave --body out")
    tracker.know(own)
    return tracker


def _guided(tracker: Tracker, guide: Guide | None) -> Tracker:
    if guide is None:
        return tracker
    from toolkit.hybrid.tracker import HybridTracker

    if not isinstance(tracker, HybridTracker):
        raise UsageError(f"the tracker {tracker.settings.tracker!r} takes no inertial sensors; use the hybrid one")
    tracker.guide = guide
    return tracker
