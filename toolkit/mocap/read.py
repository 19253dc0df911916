"""Reader of motion capture files of any supported format."""

from __future__ import annotations

from pathlib import Path

from toolkit.io.errors import MocapError, os_errors_as
from toolkit.io.files import is_file, is_folder
from toolkit.io.safe_open import open_file
from toolkit.mocap.amass import is_amass, read_amass
from toolkit.mocap.asf_amc import read_amc
from toolkit.mocap.bvh import read_bvh
from toolkit.mocap.clip import Clip
from toolkit.mocap.plausibility import check_clip

MOTION_SUFFIXES = (".bvh", ".amc")
"""Suffixes of motion files; an ASF skeleton is found through its AMC motions. NPZ files are recognised by
`amass.is_amass`."""

FOREIGN_SUFFIXES = (".c3d", ".fbx", ".trc", ".mvnx", ".glb")
"""Suffixes of unsupported motion capture formats."""


def read_clip(path: str | Path) -> Clip:
    """Read one motion file: BVH, AMC (with the ASF beside it) or AMASS, recognised by its content.

    Raises
    ------
    MocapError
        The file is missing, empty, of an unknown format, or damaged.
    """
    file = Path(path)
    if not is_file(file):
        raise MocapError(f"there is no motion file {file}; check the path")
    if file.suffix.lower() in FOREIGN_SUFFIXES:
        raise MocapError(f"{file.name} cannot be read: there is no reader of {file.suffix} files; convert it to BVH")
    if file.suffix.lower() == ".npz":
        return check_clip(read_amass(file))
    with os_errors_as(MocapError, f"cannot read {file}", "check the path"), open_file(file) as stream:
        head = stream.read(4096).decode("latin-1").lstrip("\xef\xbb\xbf \t\r\n")
    if not head:
        raise MocapError(f"{file.name} is empty; copy it again")
    if head.startswith("HIERARCHY"):
        return check_clip(read_bvh(file))
    if ":bonedata" in head.lower() or ":version" in head.lower():
        raise MocapError(f"{file.name} is an ASF skeleton without motion; give one of its AMC files")
    if ":FULLY-SPECIFIED" in head.upper() or file.suffix.lower() == ".amc":
        return check_clip(read_amc(file))
    raise MocapError(f"{file.name} is neither BVH nor AMC nor AMASS; convert it to BVH")


def find_clips(folder: str | Path) -> list[Path]:
    """Return all motion files in a folder and below, sorted; a given file is returned as it is.

    Raises
    ------
    MocapError
        The folder is missing or holds no motion file.
    """
    root = Path(folder)
    if is_file(root):
        return [root]
    if not is_folder(root):
        raise MocapError(f"there is no folder {root}; check the path")
    found = sorted(p for p in root.rglob("*") if p.suffix.lower() in MOTION_SUFFIXES and p.is_file() or is_amass(p))
    if not found:
        raise MocapError(
            f"{root} holds no motion file ({', '.join(MOTION_SUFFIXES)} or AMASS .npz); give a folder with mocap"
        )
    return found
