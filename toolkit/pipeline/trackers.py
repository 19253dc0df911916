"""A tracker from its settings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from toolkit.config import load_settings, setting_of
from toolkit.database.database import PoseDatabase
from toolkit.errors import UsageError
from toolkit.tracking.guide import Guide
from toolkit.tracking.protocol import Tracker, TrackerSettings
from toolkit.tracking.registry import DEFAULT, registered


def load_tracker(
    config: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    database: str | Path | None = None,
    max_poses: int | None = None,
    guide: Guide | None = None,
    body: str | Path | None = None,
) -> Tracker:
    """The tracker that the settings name, `hybrid` if they name none.

    Parameters
    ----------
    config, overrides : settings, see `config.load_settings`; `baak2013` is the hybrid tracker as in the paper
    database : file of the pose database, for trackers that look poses up
    max_poses : use only the first poses of the database
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
        return _guided(_embodied(registration.build(settings, None, ""), body), guide)
    if database is None:
        raise UsageError(f"the tracker {name!r} looks poses up; name a pose database")
    poses = PoseDatabase.load(database)
    poses = poses if max_poses is None else poses.limited(max_poses)
    return _guided(_embodied(registration.build(settings, poses, str(database)), body), guide)


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
