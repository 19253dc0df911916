"""The verb `depthmocap simulate`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from toolkit.app.cli.options import Output, numbers, spread
from toolkit.app.cli.terminal import print_lines, progress_bars
from toolkit.io.errors import UsageError

if TYPE_CHECKING:
    from toolkit.simulation.person import SimulatedPerson
    from toolkit.simulation.simulate import CaptureSettings

PEOPLE = "People (an option given once holds for all people, otherwise once for each CLIP)"
ROOM = "Room"

T = TypeVar("T")


@dataclass(frozen=True)
class SubjectOptions:
    """Options for the recorded people."""

    body: Annotated[
        list[str] | None,
        typer.Option(help="Name of a body, or shape coefficients, for example 1.0,-0.5.", rich_help_panel=PEOPLE),
    ] = None
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Z",
            help="Mean position: metres to the right in the image and towards the camera.",
            show_default="in a row, one metre apart",
            rich_help_panel=PEOPLE,
        ),
    ] = None
    yaw: Annotated[
        list[float] | None,
        typer.Option(help="Angle by which a person is turned to their left, degrees.", rich_help_panel=PEOPLE),
    ] = None
    enters: Annotated[
        list[float] | None, typer.Option(help="Time of the person's first frame, seconds.", rich_help_panel=PEOPLE)
    ] = None
    furniture: Annotated[
        list[str] | None,
        typer.Option(help="chair, stool, desk, table, crate or none, separated by commas.", rich_help_panel=PEOPLE),
    ] = None
    seated: Annotated[
        bool, typer.Option("--seated", help="Convert the clips to seated motions.", rich_help_panel=PEOPLE)
    ] = False

    def people(self, clips: list[Path]) -> list[SimulatedPerson]:
        """Return one person for each clip.

        Raises
        ------
        UsageError
            An option has another number of values than there are people, or cannot be parsed.
        """
        from toolkit.simulation.person import SimulatedPerson

        count = len(clips)
        row = [(float(i) - 0.5 * (count - 1), 0.0) for i in range(count)]
        columns: dict[str, Sequence[Any]] = {
            "body": each(self.body, count, "--body", "neutral"),
            "at": row if self.at is None else each([_place(text) for text in self.at], count, "--at", (0.0, 0.0)),
            "yaw": each(self.yaw, count, "--yaw", 0.0),
            "seated": [self.seated] * count,
            "furniture": [_words(text) for text in each(self.furniture, count, "--furniture", "")],
            "enters": each(self.enters, count, "--enters", 0.0),
        }
        return [
            SimulatedPerson(clip, **{name: values[i] for name, values in columns.items()})
            for i, clip in enumerate(clips)
        ]


@dataclass(frozen=True)
class Viewpoint:
    """Options for camera, room and sensor; see `CaptureSettings`."""

    sensor: Annotated[str, typer.Option(help="tof (176x144) or kinect (320x240).")] = "tof"
    distance: Annotated[float, typer.Option(help="Distance from the camera to the subject, metres.")] = 3.0
    height: Annotated[
        str,
        typer.Option(
            help="Height of the camera above the floor in metres, or neck: the neck height of the first person."
        ),
    ] = "1.0"
    tilt: Annotated[
        float | None, typer.Option(help="Degrees downwards.", show_default="aims at the middle of the body")
    ] = None
    cut: Annotated[
        float | None,
        typer.Option(
            help="Lower image border, metres below the first person's neck; replaces the tilt (0.45 is the waist).",
            show_default="the image is not cut",
        ),
    ] = None
    seed: Annotated[int, typer.Option(help="Seed of the sensor noise.", min=0)] = 0
    frame_rate: Annotated[float, typer.Option(help="Frames per second.")] = 30.0
    furnished: Annotated[
        bool, typer.Option("--furnished/--empty", help="Show a room, or only the people.", rich_help_panel=ROOM)
    ] = True
    background: Annotated[
        bool,
        typer.Option("--background/--no-background", help="Store the depth of the empty room.", rich_help_panel=ROOM),
    ] = True
    color: Annotated[
        bool, typer.Option("--color", help="Store colour registered to the depth.", rich_help_panel=ROOM)
    ] = False
    seconds: Annotated[
        float, typer.Option(help="Duration of a recording without people, seconds.", rich_help_panel=ROOM)
    ] = 3.0

    def shot(self) -> CaptureSettings:
        """Return the capture settings; raises UsageError if an option cannot be parsed."""
        from toolkit.simulation.simulate import CaptureSettings

        return CaptureSettings(**{**vars(self), "height": _height(self.height)})


@spread
def simulate(
    output: Output,
    clips: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[CLIP]...", help="BVH or AMC files, one per person; none: an empty room."),
    ] = None,
    view: Viewpoint = Viewpoint(),
    cast: SubjectOptions = SubjectOptions(),
) -> None:
    """Simulate a depth recording with exact joint positions from motions, bodies, furniture and a camera."""
    from toolkit.simulation.simulate import simulate_scene

    people, shot = cast.people(clips or []), view.shot()
    with progress_bars() as bars:
        recording = simulate_scene(people, output, shot, progress=lambda done, total: bars("simulating", done, total))
    size = f"{recording.camera.width}x{recording.camera.height}"
    print_lines(f"{output}: {len(recording)} frames of {size} pixels")


def each(values: Sequence[T] | None, count: int, option: str, default: T) -> list[T]:
    """Return one value per person from the default, one value for all, or one value each.

    Raises
    ------
    UsageError
        The number of values is neither one nor `count`.
    """
    if not values:
        return [default] * count
    if len(values) == 1:
        return list(values) * count
    if len(values) != count:
        raise UsageError(f"{option} was given {len(values)} times for {count} people; give it once, or once for each")
    return list(values)


def _height(text: str) -> float | None:
    """Parse a height in metres; None is the height of the neck."""
    if text == "neck":
        return None
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--height is {text!r}; give metres above the floor, or neck") from None


def _place(text: str) -> tuple[float, float]:
    x, z = numbers(text, 2, "--at")
    return x, z


def _words(text: str) -> tuple[str, ...]:
    return tuple(word for word in text.split(",") if word and word != "none")
