"""Body files (NPZ): coefficients of the shape space and vertex offsets (`depthmocap body scan`)."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.io.archives import Column, check_columns, load_archive, save_archive
from toolkit.io.errors import BodyError

HINT = "scan the person again with `depthmocap body scan`"
COLUMNS = {
    "shape": Column("f", ("coefficients",), -50.0, 50.0),
    "scale": Column("f", (), 0.1, 10.0),
    "offsets": Column("f", ("vertices",), -0.1, 0.1),
    "topology": Column("U", ()),
}


def topology() -> str:
    """Return sixteen hexadecimal digits that identify the mesh, its weights and its joint tree."""
    space = ShapeSpace.load()
    digest = hashlib.sha256(skeleton.fingerprint().encode())
    for array in (space.faces, space.skin_joints, space.skin_weights):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def save_body(body: Body, path: str | Path) -> None:
    """Write a body of the shape space with its offsets.

    Raises
    ------
    BodyError
        The body was not made by the shape space.
    OutputError
        The file cannot be written.
    """
    space = ShapeSpace.load()
    if body.shape.shape != (space.size,) or len(body.vertices) != len(space.skin_joints):
        raise BodyError(f"body {body.name!r} was not made by the shape space and has no file; {HINT}")
    offsets = np.zeros(len(body.vertices)) if body.offsets is None else body.offsets
    save_archive(path, {"shape": body.shape, "scale": body.scale, "offsets": offsets, "topology": topology()})


def load_body_file(path: str | Path) -> Body:
    """Return the body of a file that `save_body` wrote.

    Raises
    ------
    BodyError
        The file is missing or damaged, or holds a body of another mesh.
    """
    values = load_archive(path, BodyError, HINT)
    if missing := sorted(COLUMNS.keys() - values.keys()):
        raise BodyError(f"{path} is no body: it has no {missing[0]}; {HINT}")
    check_columns(values, COLUMNS, BodyError, str(path), HINT)
    if str(values["topology"]) != topology():
        raise BodyError(f"{path} holds a body of another mesh, made by another version; {HINT}")
    return ShapeSpace.load().body(
        values["shape"], float(values["scale"]), name=Path(path).stem, offsets=values["offsets"]
    )
