"""How a recording is read, and who in it is meant: options of every verb that opens one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.app.cli.options import given, numbers
from toolkit.io.errors import UsageError

if TYPE_CHECKING:
    from toolkit.app.pipeline.joint_choice import JointChoice

SegmentOption = Annotated[
    str | None,
    typer.Option(
        help="How to cut the person out: segmented, background, empty-frames:N, range:NEAR,FAR, person, seed:U,V.",
        show_default="auto",
    ),
]


def _option(help: str, *names: str) -> Any:
    """An option of how a recording is read."""
    return typer.Option(*names, help=help, rich_help_panel="How to read the recording")


@dataclass(frozen=True)
class Reading:
    """What a reader may be told, as it is typed."""

    format: Annotated[
        str | None,
        _option("npz, ros, mkv, record3d, tum, stray, png, utd_mhad, raw or cloud; guessed from the path."),
    ] = None
    intrinsics: Annotated[str | None, _option("fx,fy,cx,cy in pixels, or a JSON file that holds them.")] = None
    mirrored: Annotated[
        bool | None,
        _option("The source shows the scene as a mirror does; its images are flipped.", "--mirrored/--not-mirrored"),
    ] = None
    radial: Annotated[
        bool | None, _option("Pixels hold the distance to the camera instead of the depth along z.", "--radial")
    ] = None
    depth_unit: Annotated[str | None, _option("mm, m, or the metres of one unit.")] = None
    size: Annotated[str | None, _option("Width,height in pixels of raw files.")] = None
    frame_rate: Annotated[float | None, _option("Frames per second of a source without timestamps.")] = None
    up: Annotated[str | None, _option("The vertical x,y,z in the camera frame.")] = None
    background: Annotated[str | None, _option("16-bit PNG of the empty scene.")] = None
    axes: Annotated[
        str | None, _option("camera (x right, y down, z forward) or graphics (y up, z backward), for clouds.")
    ] = None
    rotate: Annotated[
        int | None,
        _option("Degrees (90, 180, 270) by which the images are turned clockwise, for a camera on its side."),
    ] = None
    track: Annotated[str | None, _option("Name of the depth topic or track of a file that holds several.")] = None

    def options(self) -> dict[str, Any]:
        """Those of `ReaderOptions` that were given.

        Raises
        ------
        UsageError
            One cannot be understood.
        """
        return given(
            **vars(self)
            | {
                "intrinsics": intrinsics_of(self.intrinsics),
                "depth_unit": unit_of(self.depth_unit),
                "size": None if self.size is None else size_of(self.size, "--size"),
                "up": None,
                "up_camera": None if self.up is None else numbers(self.up, 3, "--up"),
            }
        )


@dataclass(frozen=True)
class Joints:
    """Where joints in the image come from, as it is typed."""

    joints: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER|colour|depth|none",
            help="Joints in the image: a folder of OpenPose JSON, colour or depth (detect them there), or none.",
            show_default="the recording's, colour, depth",
        ),
    ] = None
    joints_size: Annotated[
        str | None, typer.Option(help="Width,height of the images in which the joints of a folder were found.")
    ] = None

    def choice(self, recordings: int = 1) -> JointChoice:
        """What was chosen for so many recordings.

        Raises
        ------
        UsageError
            A size or a source cannot be understood.
        """
        from toolkit.app.pipeline.joint_choice import JointChoice

        size = None if self.joints_size is None else size_of(self.joints_size, "--joints-size")
        choice = JointChoice(**given(source=self.joints, size=size))
        choice.check(recordings)
        return choice


def people_of(text: str) -> int | None:
    """The option `--people`: a number, or None for all."""
    if text == "all":
        return None
    if not text.isdigit() or int(text) < 1:
        raise UsageError(f"--people is {text!r}; give a number of people, or all")
    return int(text)


def size_of(text: str, option: str) -> tuple[int, int]:
    """A width and height in pixels."""
    width, height = numbers(text, 2, option)
    return int(width), int(height)


def intrinsics_of(text: str | None) -> str | tuple[float, ...] | None:
    """The option `--intrinsics`: four numbers, or the path of a file."""
    return numbers(text, 4, "--intrinsics") if text and "," in text else text


def unit_of(text: str | None) -> str | float | None:
    """The option `--depth-unit`: a name, or a number of metres."""
    try:
        return text if text is None else float(text)
    except ValueError:
        return text
