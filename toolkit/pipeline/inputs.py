"""The files behind a run, besides its recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.files import sha256_of
from toolkit.tracking.protocol import Tracker


@dataclass(frozen=True)
class Inputs:
    """Files that a tracker was made from, besides its database; None where there is none.

    Attributes
    ----------
    settings : of the tracker
    sensors : of the inertial sensors that guide it
    body : of the person's own body
    """

    settings: str | Path | None = None
    sensors: str | Path | None = None
    body: str | Path | None = None

    def digests(self) -> dict[str, Any]:
        """What `RunInfo` says of them: SHA-256 of the sensors and of the body, empty without."""
        files = {"sensors_sha256": self.sensors, "body_sha256": self.body}
        return {name: sha256_of(file) if file else "" for name, file in files.items()}

    def files(self, tracker: Tracker) -> list[Path]:
        """All of them and the tracker's database: no run may replace one."""
        return [Path(file) for file in (tracker.database, self.settings, self.sensors, self.body) if file]


NO_INPUTS = Inputs()
"""A tracker made of its database alone."""
