"""Motion tracking in depth recordings: the public Python interface of `toolkit` and `database_builder`.

>>> import depthmocap
>>> track = depthmocap.track("take.npz")  # doctest: +SKIP
>>> track.joints.shape  # doctest: +SKIP
(70, 20, 3)

Names are loaded on first use. `docs/library.md` describes them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from database_builder.build import build_database as build_database
    from depthmocap.step import Pose as Pose
    from depthmocap.step import Tracker as Tracker
    from depthmocap.tracks import Track as Track
    from depthmocap.tracks import evaluate as evaluate
    from depthmocap.tracks import track as track
    from toolkit.body.skeleton import REPORTED
    from toolkit.io.errors import DepthMocapError as DepthMocapError
    from toolkit.io.errors import PlausibilityWarning as PlausibilityWarning
    from toolkit.recordings.opening import open_recording as open_recording

    JOINT_NAMES = REPORTED

_WHERE = {
    "build_database": ("database_builder.build", "build_database"),
    "evaluate": ("depthmocap.tracks", "evaluate"),
    "Pose": ("depthmocap.step", "Pose"),
    "Tracker": ("depthmocap.step", "Tracker"),
    "Track": ("depthmocap.tracks", "Track"),
    "track": ("depthmocap.tracks", "track"),
    "DepthMocapError": ("toolkit.io.errors", "DepthMocapError"),
    "PlausibilityWarning": ("toolkit.io.errors", "PlausibilityWarning"),
    "open_recording": ("toolkit.recordings.opening", "open_recording"),
    "JOINT_NAMES": ("toolkit.body.skeleton", "REPORTED"),
}

__all__ = list(_WHERE)


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"depthmocap has no {name}; it has: {', '.join(_WHERE)}")
    module, inside = _WHERE[name]
    found = globals()[name] = getattr(import_module(module), inside)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
