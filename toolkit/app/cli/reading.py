"""Options of each verb that opens a recording: reader options, joint source, people."""

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
        help="Segmentation of the person: segmented, background, empty-frames:N, range:NEAR,FAR, person, seed:U,V.",
        show_default="auto",
    ),
]


def _option(help: str, *names: str) -> Any:
    """Return an option of the panel of reader options."""
    return typer.Option(*names, help=help, rich_help_panel="Reader options")


@dataclass(frozen=True)
class Reading:
    """Options of the readers."""

    format: Annotated[
        str | None,
        _option("npz, npy, utd_mhad, ros, mkv, record3d, tum, stray, png, cloud or raw; default: detected."),
    ] = None
    intrinsics: Annotated[str | None, _option("fx,fy,cx,cy in pixels, or a JSON file with these values.")] = None
    mirrored: Annotated[
        bool | None,
        _option("Flip the images of a mirrored source.", "--mirrored/--not-mirrored"),
    ] = None
    radial: Annotated[
        bool | None, _option("The pixels hold the distance to the camera instead of the depth along z.", "--radial")
    ] = None
    depth_unit: Annotated[str | None, _option("mm, m, or the size of one unit in metres.")] = None
    size: Annotated[str | None, _option("Width,height of raw files in pixels.")] = None
    frame_rate: Annotated[float | None, _option("Frame rate of a source without timestamps, Hz.")] = None
    up: Annotated[str | None, _option("Vertical direction x,y,z in the camera frame.")] = None
    background: Annotated[str | None, _option("16-bit PNG of the empty scene.")] = None
    axes: Annotated[
        str | None, _option("Axes of point clouds: camera (x right, y down, z forward) or graphics (y up, z backward).")
    ] = None
    rotate: Annotated[
        int | None,
        _option("Clockwise rotation of the images in degrees (90, 180, 270), for a rotated camera."),
    ] = None
    track: Annotated[str | None, _option("Name of the depth topic or track in a file with several.")] = None

    def options(self) -> dict[str, Any]:
        """Return the reader options that were given.

        Raises
        ------
        UsageError
            A value is invalid.
        """
        from toolkit.recordings.reader_options import ReaderOptions

        options = vars(self) | {"up_camera": self.up}
        del options["up"]
        return ReaderOptions.from_mapping(given(**options)).given()


@dataclass(frozen=True)
class Joints:
    """Source of the image joints."""

    joints: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER|colour|depth|none",
            help="Image joints: a folder of OpenPose JSON files, colour or depth (run the network), or none.",
            show_default="those of the recording, else colour or depth if the tracker needs joints",
        ),
    ] = None
    joints_size: Annotated[
        str | None, typer.Option(help="Width,height of the images on which the joints of the folder were detected.")
    ] = None

    def choice(self, recordings: int = 1) -> JointChoice:
        """Return the choice for `count` recordings.

        Raises
        ------
        UsageError
            A size or a source cannot be parsed.
        """
        from toolkit.app.pipeline.joint_choice import JointChoice

        size = None
        if self.joints_size is not None:
            width, height = numbers(self.joints_size, 2, "--joints-size")
            size = int(width), int(height)
        choice = JointChoice(**given(source=self.joints, size=size))
        choice.check(recordings)
        return choice


def people_of(text: str) -> int | None:
    """Parse `--people`: a number, or None for all."""
    if text == "all":
        return None
    if not text.isdigit() or int(text) < 1:
        raise UsageError(f"--people is {text!r}; give a number of people, or all")
    return int(text)
