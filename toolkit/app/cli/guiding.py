"""Options of `track` for inertial sensors and for live motion events."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.io.errors import UsageError

if TYPE_CHECKING:
    from toolkit.app.pipeline.events import EventStream
    from toolkit.tracking.guide import Guide

SENSORS = "Inertial sensors"
EVENTS = "Live labels"


@dataclass(frozen=True)
class SensorGuideOptions:
    """Options for motion classes and inertial sensors."""

    classes: Annotated[
        Path | None, typer.Option(help="Class file written by `depthmocap learn --templates`.", rich_help_panel=EVENTS)
    ] = None
    queries: Annotated[
        Path | None, typer.Option(help="Keyframe queries written by `depthmocap learn`.", rich_help_panel=EVENTS)
    ] = None
    events: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|-",
            help="Write a JSON line when a motion ends; needs one pass (--online).",
            rich_help_panel=EVENTS,
        ),
    ] = None
    inertial: Annotated[
        Path | None,
        typer.Option(help="Canonical file of inertial sensors that guide the tracker.", rich_help_panel=SENSORS),
    ] = None
    calibration: Annotated[
        Path | None,
        typer.Option(
            help="Calibration of the sensors from a run of this recording (calibration.json).", rich_help_panel=SENSORS
        ),
    ] = None

    def watcher(self, recordings: list[Path]) -> EventStream | None:
        """Return the event stream, or None if no events are requested.

        Raises
        ------
        UsageError
            Options contradict each other, or need a single recording.
        """
        if self.events is None:
            if self.classes is not None or self.queries is not None:
                raise UsageError("--classes and --queries need --events; add it, or leave them out")
            return None
        if self.classes is None or len(recordings) != 1:
            raise UsageError("--events needs one recording and --classes; name both")
        from toolkit.app.pipeline.events import EventStream
        from toolkit.retrieval.annotation.classes import load_classes
        from toolkit.retrieval.keyframes.query_file import load_queries

        wanted = load_queries(self.queries) if self.queries else ()
        return EventStream(load_classes(self.classes), wanted, self.events)

    def guide(self, recordings: list[Path]) -> Guide | None:
        """Return the guide of the sensors, or None without sensors; raises as `watcher`."""
        if self.inertial is None and self.calibration is None:
            return None
        if self.inertial is None or self.calibration is None:
            raise UsageError("--inertial and --calibration belong together; give both or neither")
        if len(recordings) != 1:
            raise UsageError(
                f"inertial sensors belong to one recording, not to {len(recordings)}; track the recordings one by one"
            )
        from toolkit.inertial.calibration import Calibration
        from toolkit.inertial.workflow import load_sensors
        from toolkit.tracking.guide import InertialGuide

        sensors = load_sensors(self.inertial)
        return InertialGuide(sensors, Calibration.load(self.calibration), recordings[0].stem)
