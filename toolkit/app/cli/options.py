"""Options of several verbs, and option groups: a verb takes a dataclass, and each field becomes an option."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from toolkit.io.errors import UsageError

if TYPE_CHECKING:
    from toolkit.app.pipeline.image_joints import JointChoice


MOST_FRAMES = 1_000_000_000
"""Maximum frame number (one year at 30 Hz)."""

Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="Run folder written by `depthmocap track`.", show_default=False)
]
Output = Annotated[Path, typer.Option("--output", "-o", help="What is written.", show_default=False)]
MovedRecording = Annotated[Path | None, typer.Option(help="New location of the recording, if it was moved.")]
FirstFrame = Annotated[int, typer.Option("--from", help="First frame.", max=MOST_FRAMES)]
Seed = Annotated[int, typer.Option(help="Random seed.", min=0)]
SettingOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Setting by its dotted name, for example sensing.segment=person."),
]
LabelTable = Annotated[Path | None, typer.Option(help="CSV file with the columns clip, label and optionally person.")]
Motions = Annotated[
    list[Path],
    typer.Argument(
        metavar="MOTION...", help="BVH, AMC and AMASS files, run folders, or folders of clips.", show_default=False
    ),
]


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Return `count` numbers separated by commas.

    Raises
    ------
    UsageError
        The text has another number of values, or a value is no number.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise UsageError(f"{option} is {text!r}; give {count} numbers separated by commas")
    return values


def given(**options: Any) -> dict[str, Any]:
    """Return the options that were given, which are those that are not None."""
    return {name: value for name, value in options.items() if value is not None}


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
        from toolkit.app.pipeline.image_joints import JointChoice

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


def spread(verb: Callable[..., None]) -> Callable[..., None]:
    """Return `verb` with each dataclass parameter replaced by its fields, for the option parser.

    >>> @dataclass(frozen=True)  # doctest: +SKIP
    ... class Where:
    ...     distance: Annotated[float, typer.Option(help="Metres.")] = 3.0
    >>> @spread  # doctest: +SKIP
    ... def look(where: Where) -> None: ...  # depthmocap look --distance 2
    """
    hints = get_type_hints(verb, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters: list[Parameter] = []
    for parameter in inspect.signature(verb).parameters.values():
        if (group := groups.get(parameter.name)) is None:
            parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[parameter.name]))
        else:
            parameters += _parameters(group)

    @wraps(verb)
    def flat(**options: Any) -> None:
        for name, group in groups.items():
            options[name] = group(**{field.name: options.pop(field.name) for field in fields(group)})
        verb(**options)

    del flat.__wrapped__
    flat.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    flat.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters} | {"return": None}
    return flat


def _parameters(group: Any) -> list[Parameter]:
    kinds = get_type_hints(group, include_extras=True)
    return [
        Parameter(
            field.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if field.default is MISSING else field.default,
            annotation=kinds[field.name],
        )
        for field in fields(group)
    ]
