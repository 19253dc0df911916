"""Body from views of a T-pose."""

import numpy as np
import pytest

from tests.support.subjects import LEVEL, camera_for, draw
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.scan_fit import Scan, ScanView, fit_scan
from toolkit.io.errors import BodyError
from toolkit.sensing.cloud import Cloud

CAMERA = camera_for(8000)
TURNS = (0.0, 90.0, 180.0, 270.0)


def view(body: Body, degrees: float, arms: float = 0.0) -> ScanView:
    """Return a view of a person with stretched arms, or lowered by an angle, rotated to the left."""
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[:3], pose[4] = (0.03, -0.1, -2.8), np.radians(degrees + 4.0)
    pose[skeleton.POSE_NAMES.index("left_shoulder_rz")] = -arms
    pose[skeleton.POSE_NAMES.index("right_shoulder_rz")] = arms
    depth = draw(body, pose, CAMERA, np.random.default_rng(int(degrees)))
    return ScanView(Cloud.from_depth(depth, CAMERA, LEVEL), float(np.radians(degrees)))


@pytest.fixture(scope="module")
def person() -> Body:
    """Return a body with a belly outside the shape space."""
    space = ShapeSpace.load()
    plain = space.body([0.6, -0.8, 0.7, 0.5])
    belly = np.exp(-((plain.vertices - [0.0, 0.12, 0.1]) ** 2).sum(axis=1) / (2 * 0.08**2))
    return space.body(plain.shape, offsets=0.02 * belly)


@pytest.fixture(scope="module")
def scan(person: Body) -> Scan:
    """Return the scan of the person."""
    return fit_scan([view(person, degrees) for degrees in TURNS])


def test_a_person_is_found_to_half_a_centimetre(person: Body, scan: Scan) -> None:
    off = ((scan.body.vertices - person.vertices) * person.normals).sum(axis=1)
    assert np.median(np.abs(off)) < 0.005
    assert np.median(np.linalg.norm(scan.body.joints - person.joints, axis=1)) < 0.015
    assert scan.residual < 0.005 and scan.seen.mean() > 0.6


def test_offsets_know_what_the_shape_space_does_not(person: Body, scan: Scan) -> None:
    assert person.offsets is not None and scan.body.offsets is not None
    out = person.offsets > 0.01
    without = ShapeSpace.load().body(scan.body.shape)

    def off(body: Body) -> float:
        return float(np.abs(((body.vertices - person.vertices) * person.normals).sum(axis=1))[out].mean())

    assert off(scan.body) < off(without)


def test_views_that_cannot_be_of_one_person_in_a_t_pose_are_refused(person: Body) -> None:
    front, side = view(person, 0.0), view(person, 90.0)
    child = ShapeSpace.load().body(ShapeSpace.load().typical(1.2))
    empty = ScanView(Cloud.from_depth(np.zeros(CAMERA.shape, dtype=np.float32), CAMERA, LEVEL), 0.0)
    for views, said in (
        ([front], "from 1 view"),
        ([front, empty], "view 2 shows no person"),
        ([front, view(child, 90.0)], "people of"),
        ([view(person, 0.0, arms=1.3), view(person, 90.0, arms=1.3)], "arms span"),
        ([side, view(person, 270.0)], "arms span"),
    ):
        with pytest.raises(BodyError, match=said):
            fit_scan(views)
