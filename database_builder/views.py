"""Training views of the joint regressor: people as they are recorded, drawn from the poses of a database.

Recordings show people whole, from the waist up, seated, behind a desk or behind each other, adults and children, with
cameras on tables and under ceilings. A tilted camera sees what a level one at the same place sees,
only in other pixels; the regressor asks its questions in the level frame, so that all views are drawn by level cameras.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from database_builder.occluders import occluder_meshes
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.database.prior import SITUATIONS, situations, variables
from toolkit.io.errors import SettingsError
from toolkit.kernels.image import raster
from toolkit.kernels.learning import forest

FOCAL = 150.0
"""Pixels: half the resolution of a Kinect; questions are in metres, so any other serves as well."""
MARGIN = 2
STATURES = (0.72, 1.3)
"""Metres: children that the population of the shape space knows too little."""
HEIGHTS = (0.5, 2.5)
"""Metres: cameras above the floor."""
STEEPEST = 1.0
"""Slope at which a camera looks down at the middle of a person, at most: 45 degrees."""
CUTS: dict[str, tuple[str, ...]] = {
    "chest": ("spine", "neck"), "waist": ("pelvis", "spine"), "thighs": ("left_knee", "right_knee", "pelvis"),
    "knees": ("left_knee", "right_knee"), "shins": ("left_ankle", "right_ankle", "left_knee", "right_knee"),
}  # fmt: skip
"""Joints between which the lower border of the image cuts a person off."""


@dataclass(frozen=True)
class RoomSettings:
    """What the views of whole rooms show, as shares of these in [0, 1].

    Attributes
    ----------
    empty : no person at all
    cut : cut out: the person with what touches them, or furniture alone
    """

    empty: float = 0.2
    cut: float = 0.25

    def __post_init__(self) -> None:
        _check_shares(vars(self))


@dataclass(frozen=True)
class ViewSettings:
    """What the training views show, as shares of the images in [0, 1].

    Attributes
    ----------
    turned : the person from any side; the others from within 60 degrees of the front
    cut : cut off by the lower border of the image, a few of them by another border too
    hidden : partly behind furniture or another person
    raised : from a camera anywhere from 0.5 to 2.5 m above the floor; the others from about the person's middle
    small : children of 0.72 to 1.3 m
    seated : in a seated pose, where the database has any
    rooms : whole furnished rooms, with and without people; all others show a person alone
    room : what those show
    """

    turned: float = 1.0
    cut: float = 0.25
    hidden: float = 0.2
    raised: float = 0.3
    small: float = 0.1
    seated: float = 0.2
    rooms: float = 0.3
    room: RoomSettings = field(default_factory=RoomSettings)

    def __post_init__(self) -> None:
        _check_shares({name: share for name, share in vars(self).items() if name != "room"})


def _check_shares(shares: dict[str, float]) -> None:
    for name, share in shares.items():
        if not 0.0 <= share <= 1.0:
            raise SettingsError(f"training views: {name} is {share}; it is a share and lies in [0, 1]")


@dataclass(frozen=True, eq=False)
class CroppedView:
    """What a level camera of focal length `FOCAL` sees of one person, cropped.

    Attributes
    ----------
    depth : uint16 (H, W), millimetres, 0 = nothing, `forest.UNOBSERVED` = hidden or outside the image
    window : int32 (4,), first and last column, first and last row of the image, in pixels of the crop
    in_view : bool (20,), joints inside the image with nothing foreign before them
    triangle : int32 (H, W), face of the person's body that a pixel of theirs shows
    corner : (2,), image coordinates of the crop's first pixel
    joints : float64 (20, 3), metres, level frame; zeros without a person
    """

    depth: np.ndarray
    window: np.ndarray
    in_view: np.ndarray
    triangle: np.ndarray
    corner: np.ndarray
    joints: np.ndarray


def body_labels(body: Body) -> np.ndarray:
    """int64 (V,): two labels per joint, which the questions learn to tell apart.

    Parts on the body's midline split into left and right, limbs into the half near the joint and the far half.
    """
    label = np.empty(len(body.vertices), dtype=np.int64)
    for joint, name in enumerate(skeleton.JOINT_NAMES):
        members = body.part == joint
        along = body.vertices[members] - body.joints[joint]
        if name.startswith(("left_", "right_")):
            reach = np.linalg.norm(along, axis=1)
            far = reach > np.median(reach) if members.any() else reach
        else:
            far = along[:, 0] > 0.0
        label[members] = 2 * joint + far
    return label


def is_seated(poses: np.ndarray, body: Body) -> np.ndarray:
    """Bool (N,): in which of canonical poses (N, P) people sit."""
    return np.asarray(situations(variables(poses, body)) == SITUATIONS.index("seated"))


def draw_view(
    poses: np.ndarray, sits: np.ndarray, space: ShapeSpace, settings: ViewSettings, rng: np.random.Generator
) -> CroppedView:
    """One person of canonical `poses` (N, P), who `sits` (N,) or not, of any size, seen as `settings` has it."""
    body = draw_body(space, settings.small, rng)
    pose, yaw = turned_pose(poses[row_of(sits, settings.seated, rng)], settings.turned, rng)
    vertices, joints = body.vertex_positions(pose), body.joint_positions(pose)
    cut, hidden = rng.random() < settings.cut, rng.random() < settings.hidden
    root = _stand(vertices, body.height, rng.random() < settings.raised, cut, rng)
    faces = space.faces.astype(np.int64)

    seen = project_level(vertices + root)
    corner = np.floor(seen[:, :2].min(axis=0)) - MARGIN
    width, height = (np.ceil(seen[:, :2].max(axis=0)) - corner + MARGIN).astype(int)
    inverse, triangle = draw_mesh(seen, faces, corner, (height, width))
    blocked = np.zeros(inverse.shape)
    if hidden:
        for mesh in occluder_meshes(poses, space, root, yaw, vertices, rng):
            before, _ = draw_mesh(project_level(mesh.vertices), mesh.faces.astype(np.int64), corner, (height, width))
            blocked = np.maximum(blocked, before)
    depth = sensed(np.where(blocked > inverse, 0.0, inverse), rng)
    window = image_window(joints + root, corner, (height, width), cut, rng)
    in_view = joints_in_view(joints + root, corner, window, blocked)
    # No person can be seen where something nearer stands, if the source says what stands there; often it says nothing.
    if rng.random() < 0.6:
        depth[(blocked > -1.0 / (root[2] - 0.1)) & (depth == 0)] = forest.UNOBSERVED
    rows, columns = np.ogrid[:height, :width]
    outside = (columns < window[0]) | (columns > window[1]) | (rows < window[2]) | (rows > window[3])
    depth[outside] = forest.UNOBSERVED
    return CroppedView(depth, window, in_view, triangle, corner, joints + root)


def row_of(sits: np.ndarray, share: float, rng: np.random.Generator) -> int:
    """A row of poses who `sits` (N,) in a `share` of all cases, as far as there are both kinds."""
    rows = np.flatnonzero(sits == (rng.random() < share))
    return int(rows[rng.integers(len(rows))] if len(rows) else rng.integers(len(sits)))


def draw_body(space: ShapeSpace, small: float, rng: np.random.Generator) -> Body:
    """A person of the shape space, a child in a share `small` of all cases."""
    coefficients = np.clip(rng.normal(0.0, 0.9, space.size), -2.0, 2.0)
    if rng.random() < small:
        coefficients = 0.6 * coefficients + space.typical(rng.uniform(*STATURES))
    else:
        coefficients[0] = np.clip(1.3 * coefficients[0], -3.4, 2.6)
    return space.body(coefficients)


def turned_pose(pose: np.ndarray, turned: float, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """A canonical pose (facing yaw 0) at the origin, turned about the vertical, and by how much."""
    from scipy.spatial.transform import Rotation

    yaw = rng.uniform(-np.pi, np.pi) if rng.random() < turned else rng.uniform(-np.pi / 3, np.pi / 3)
    out = np.array(pose, dtype=np.float64)
    out[skeleton.ROOT_POSITION] = 0.0
    root = Rotation.from_rotvec([0.0, yaw, 0.0]) * Rotation.from_rotvec(out[skeleton.ROOT_ROTATION])
    out[skeleton.ROOT_ROTATION] = root.as_rotvec()
    return out, yaw


def _stand(vertices: np.ndarray, stature: float, raised: bool, near: bool, rng: np.random.Generator) -> np.ndarray:
    """Where the root stands (3,), level frame: beside the axis of a camera that sees the person, metres."""
    least = 0.55 if near else 1.0
    distance = rng.uniform(least + 0.3 + 0.25 * stature, 2.6 if near else 4.2)
    aside = rng.uniform(-0.35, 0.35) * distance
    if not raised:
        return np.array([aside, rng.uniform(-0.25, 0.25) * distance, -distance])
    floor = vertices[:, 1].min()
    above = rng.uniform(*HEIGHTS) + floor  # of the camera over the root
    down = above - 0.5 * (vertices[:, 1].max() + floor)
    return np.array([aside, -above, -max(distance, down / STEEPEST, least + np.ptp(vertices[:, 2]))])


def project_level(points: np.ndarray) -> np.ndarray:
    """Image coordinates and inverse depth (N, 3) of points (N, 3) in the level frame, seen by a level camera."""
    out = np.empty(points.shape)
    raster.project(points * (1.0, -1.0, -1.0), np.array([FOCAL, FOCAL, 0.0, 0.0]), out)
    return out


def draw_mesh(
    projected: np.ndarray, faces: np.ndarray, corner: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse depth and triangles of a projected mesh in a crop of the image."""
    projected = projected - [corner[0], corner[1], 0.0]
    inverse, triangle = np.empty(shape), np.empty(shape, dtype=np.int32)
    raster.rasterise(projected, faces, inverse, triangle)
    return inverse, triangle


def image_window(
    joints: np.ndarray, corner: np.ndarray, shape: tuple[int, int], cut: bool, rng: np.random.Generator
) -> np.ndarray:
    """Borders of the image in pixels of the crop, int32 (4,): first and last column, first and last row.

    Some of the crop is always inside: each far border leaves a fifth of it, each near one most of what is before the
    far one.
    """
    height, width = shape
    room = FOCAL / -joints[0, 2] * rng.uniform(-0.05, 1.0, 4)  # between the person and each border
    near, far, extent = -room[::2], np.array([width, height]) + room[1::2], np.array([width, height], dtype=float)
    if cut:
        pixels = project_level(joints)[:, :2] - corner
        between = pixels[[skeleton.REPORTED.index(name) for name in CUTS[rng.choice(list(CUTS))]], 1]
        far[1] = min(rng.uniform(between.min(), between.max()), height)
        if rng.random() < 0.25:
            side = rng.integers(3)
            if side == 1:
                far[0] = width - 0.8 * width * rng.random()
            else:
                near[side // 2] = rng.uniform(0.0, 0.35) * extent[side // 2]
    far = np.maximum(far, 0.2 * extent)
    near = np.minimum(near, 0.35 * np.minimum(far, extent))
    return np.rint([near[0], far[0], near[1], far[1]]).astype(np.int32)


def joints_in_view(joints: np.ndarray, corner: np.ndarray, window: np.ndarray, blocked: np.ndarray) -> np.ndarray:
    """Which joints (20, 3), level frame, lie inside the image with nothing foreign before them: bool (20,).

    The image is `window` (4,) of a crop that begins at the pixel `corner`; `blocked` (H, W) is the inverse depth of
    what is foreign in the crop, 0 where nothing is.
    """
    projected = project_level(joints)
    u, v = np.rint(projected[:, :2] - corner).astype(int).T
    inside = (u >= window[0]) & (u <= window[1]) & (v >= window[2]) & (v <= window[3]) & (projected[:, 2] > 0)
    rows, columns = np.clip(v, 0, blocked.shape[0] - 1), np.clip(u, 0, blocked.shape[1] - 1)
    return inside & (blocked[rows, columns] <= projected[:, 2])


def sensed(inverse_depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """uint16 millimetres with noise that grows with depth, coarse steps for half the images, gaps and worn contours."""
    seen = inverse_depth > 0.0
    z = np.where(seen, 1.0 / np.where(seen, inverse_depth, 1.0), 0.0)
    z += rng.normal(0.0, 0.003 * rng.random(), z.shape) * z
    if rng.random() < 0.5:
        step = 0.0028 * z * z
        z = np.where(seen, np.rint(z / np.maximum(step, 1e-6)) * step, 0.0)
    if rng.random() < 0.5:
        import cv2

        worn = cv2.erode(seen.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        seen = np.where(rng.random(seen.shape) < rng.random(), worn, seen)
    seen = seen & (rng.random(seen.shape) > 0.02)
    return np.where(seen, np.rint(z * 1000.0), 0.0).astype(np.uint16)
