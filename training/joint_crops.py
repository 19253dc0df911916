"""Draw depth crops of simulated people, the training data of the joint network.

    python -m training.joint_crops OUT.npz COUNT SEED [--held]

OUT.npz holds N crops of 128 x 128 pixels of 25 mm at the depth of the person:

- depth : uint16 (N, 128, 128), millimetres, 0 = nothing, 65535 = unobserved (outside the image, or occluded)
- crop : float32 (N, 3), reference depth D in metres and x/z, y/z of the crop's middle; a point projects to the pixel
  `63.5 + (x/z - c) D / 0.025`
- joints : float32 (N, 20, 3), metres, camera frame (x right, y down, z forward), in the order of `skeleton.REPORTED`
- seen : uint8 (N, 20), see `SELF_OCCLUDED`

`--held` draws from every tenth block of 50 poses of the database; without it, from the others.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.database import DEFAULT_DATABASE
from toolkit.database.database import PoseDatabase
from toolkit.kernels import linear
from toolkit.kernels.image import raster
from training.occluders import box, occluder_meshes
from training.sensor import sensed
from training.subjects import (
    ARMS,
    HEAD,
    LEGS,
    THIGHS,
    TORSO,
    draw_body,
    is_seated,
    is_upright,
    row_of,
    thickened,
)

SIZE, PIXEL = 128, 0.025
"""Pixels of a side of a stored crop; metres of a pixel at the reference depth."""
UNOBSERVED = 65535
OUTSIDE, SELF_OCCLUDED, VISIBLE = 0, 1, 2
"""Visibility of a joint: outside the image or behind another object; hidden by the own body; visible."""
MIN_PIXELS = 120
"""Measured pixels below which a crop is dropped."""
BLOCK, BLOCKS = 50, 10
"""Poses of a block, and blocks of which one is held out: neighbouring poses of a database resemble each other."""
CUTS: dict[str, tuple[str, ...]] = {
    "chest": ("spine", "neck"), "waist": ("pelvis", "spine"), "thighs": ("left_knee", "right_knee", "pelvis"),
    "knees": ("left_knee", "right_knee"), "shins": ("left_ankle", "right_ankle", "left_knee", "right_knee"),
}  # fmt: skip
"""Joints between which the lower border of the image truncates a person."""
LAYERS = {TORSO: 0.06, ARMS: 0.035, LEGS: 0.035, HEAD: 0.03}
"""Largest thickness of clothes and hair, metres."""
DEPTHS = (1.1, 5.0)
"""Metres from the camera to the person."""

_JOINTS = list(skeleton.REPORTED)
_DOF_NAMES = np.array([skeleton.JOINT_NAMES[joint] for joint in skeleton.DOF_JOINT])
_ARMS = [
    3 + np.flatnonzero([name in (f"{side}_clavicle", f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist")
                        for name in _DOF_NAMES[3:]]) + 3
    for side in ("left", "right")
]  # fmt: skip


class Crop(NamedTuple):
    """One training example; fields as in the module's docstring."""

    depth: np.ndarray
    crop: np.ndarray
    joints: np.ndarray
    seen: np.ndarray


class Surface(NamedTuple):
    """A mesh in the camera frame: vertices (V, 3), metres, and faces int64 (F, 3)."""

    vertices: np.ndarray
    faces: np.ndarray


class CropView(NamedTuple):
    """The pinhole camera of a crop: focal length and principal point, pixels."""

    focal: float
    centre: np.ndarray

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Project points (N, 3) to pixels (N, 2)."""
        return points[:, :2] / points[:, 2:] * self.focal + self.centre

    def inverse_depth(self, surfaces: list[Surface]) -> np.ndarray:
        """Return the inverse depth (128, 128) of the nearest surface, 0 where there is none."""
        nearest = np.zeros((SIZE, SIZE))
        for surface in surfaces:
            projected = np.empty(surface.vertices.shape)
            camera = np.array([self.focal, self.focal, *self.centre])
            raster.project(np.ascontiguousarray(surface.vertices), camera, projected)
            inverse, triangle = np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE), dtype=np.int32)
            raster.rasterise(projected, surface.faces, inverse, triangle)
            nearest = np.maximum(nearest, inverse)
        return nearest


class CropPainter:
    """Draws crops of single people from the poses of a database.

    Parameters
    ----------
    poses : float (N, P), canonical
    rng : source of all randomness
    held : draw from the held-out blocks instead of the training blocks
    """

    def __init__(self, poses: np.ndarray, rng: np.random.Generator, held: bool = False) -> None:
        is_held = (np.arange(len(poses)) // BLOCK) % BLOCKS == 0
        self._poses, self._rng = poses[is_held == held], rng
        self._space = ShapeSpace.load()
        self._faces = self._space.faces.astype(np.int64)
        body = self._space.body()
        self._seated = is_seated(self._poses, body)
        self._upright = np.flatnonzero(is_upright(self._poses, body))

    def draw(self) -> Crop | None:
        """Draw the next crop; None where too little of the person is in it."""
        rng = self._rng
        body = draw_body(self._space, 0.1, rng)
        pose, yaw = self._pose()
        vertices, joints = body.vertex_positions(pose), body.joint_positions(pose)
        if rng.random() < 0.75:
            vertices = self._clothed(body, vertices)
        distance = np.exp(rng.uniform(*np.log(DEPTHS)))
        elevation = rng.normal(0, 0.1) if rng.random() < 0.6 else rng.uniform(-0.25, 0.9)
        middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        root = np.array([0.0, -np.sin(elevation), -np.cos(elevation)]) * distance - middle
        root[0] += rng.uniform(-0.35, 0.35) * distance

        own = [Surface(vertices + root, self._faces), *self._attached(vertices, root)]
        foreign = []
        if rng.random() < 0.25:
            meshes = occluder_meshes(self._poses, self._space, root, yaw, vertices, rng)
            foreign = [Surface(mesh.vertices, mesh.faces.astype(np.int64)) for mesh in meshes]
        tilt = -elevation * rng.uniform(0.6, 1.1) + rng.normal(0, 0.08)
        angles = [rng.normal(0, 0.04), rng.normal(0, 0.15), tilt]
        turn = Rotation.from_euler("zyx", angles).as_matrix()

        def in_camera(points: np.ndarray) -> np.ndarray:
            return linear.rotated(points * [1.0, -1.0, -1.0], turn.T)

        own = [Surface(in_camera(s.vertices), s.faces) for s in own]
        foreign = [Surface(in_camera(s.vertices), s.faces) for s in foreign]
        joints = in_camera(joints + root)
        if own[0].vertices[:, 2].min() < 0.25 or joints[:, 2].min() < 0.3:
            return None
        return self._rendered(own, foreign, joints)

    def _pose(self) -> tuple[np.ndarray, float]:
        """Return a pose (P,) at the origin, half of them with the arms of other poses, and its yaw in radians."""
        rng = self._rng
        upright = len(self._upright) > 0 and rng.random() < 0.45
        row = int(rng.choice(self._upright)) if upright else row_of(self._seated, 0.25, rng)
        pose = self._poses[row].astype(np.float64)
        if rng.random() < 0.5:
            for arm in _ARMS:
                if rng.random() < 0.7:
                    pose[arm] = self._poses[rng.integers(len(self._poses))][arm]
        pose[6:] += rng.normal(0, 0.06, len(pose) - 6)
        pose = np.clip(pose, *skeleton.POSE_LIMITS.T)
        yaw = rng.uniform(-1.3, 1.3) if rng.random() < 0.4 else rng.uniform(-np.pi, np.pi)
        turn = Rotation.from_rotvec([0, yaw, 0])
        if rng.random() < 0.06:  # lying, falling, upside down
            turn = Rotation.random(random_state=int(rng.integers(2**31)))
        pose[skeleton.ROOT_POSITION] = 0
        pose[skeleton.ROOT_ROTATION] = (turn * Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION])).as_rotvec()
        return pose, yaw

    def _clothed(self, body: Body, vertices: np.ndarray) -> np.ndarray:
        """Return the vertices (V, 3) with clothes that stand off the skin by up to 8 cm."""
        rng = self._rng
        layers = {parts: rng.uniform(0, most) * rng.random() for parts, most in LAYERS.items()}
        if rng.random() < 0.12:  # a coat or a skirt
            layers[THIGHS] = rng.uniform(0.02, 0.08)
        return thickened(body, vertices, self._faces, layers)

    def _attached(self, vertices: np.ndarray, root: np.ndarray) -> list[Surface]:
        """Return objects that a segmentation leaves in a person's mask: floor, an object at hand."""
        rng, found = self._rng, []
        if rng.random() < 0.25:
            floor = vertices[:, 1].min()
            feet = vertices[vertices[:, 1] < floor + 0.15].mean(axis=0)
            size = (rng.uniform(0.3, 1.4), 0.02, rng.uniform(0.3, 1.4))
            found.append(box(root + [feet[0], floor - 0.01, feet[2]], size, rng.uniform(0, 3)))
        if rng.random() < 0.15:
            place = vertices[rng.integers(len(vertices))] * rng.uniform(0.9, 1.1)
            found.append(box(root + place, tuple(rng.uniform(0.05, 0.45, 3)), rng.uniform(0, 3)))
        return [Surface(mesh.vertices, mesh.faces.astype(np.int64)) for mesh in found]

    def _rendered(self, own: list[Surface], foreign: list[Surface], joints: np.ndarray) -> Crop | None:
        """Render the person's surfaces and the objects before them, as a sensor measures them."""
        rng, body = self._rng, own[0].vertices
        reference = float(np.median(body[:, 2]))
        middle = np.median(body[:, :2] / body[:, 2:], axis=0)
        focal = reference / PIXEL
        view = CropView(focal, 0.5 * (SIZE - 1) - focal * middle)
        inverse = view.inverse_depth(own)
        pixels = view.pixels(joints)
        blocked = view.inverse_depth(foreign)
        alone = view.inverse_depth(own[:1])
        depth = sensed(np.where(blocked > inverse, 0.0, inverse), rng)
        if rng.random() < 0.6:
            depth[(blocked > 1.0 / (reference + 0.1)) & (depth == 0)] = UNOBSERVED
        outside = self._outside(pixels)
        depth[outside] = UNOBSERVED
        if ((depth > 0) & (depth < UNOBSERVED)).sum() < MIN_PIXELS:
            return None
        u, v = np.clip(np.rint(pixels).astype(int), 0, SIZE - 1).T
        inside = (np.rint(pixels) >= 0).all(axis=1) & (np.rint(pixels) < SIZE).all(axis=1)
        inside &= ~outside[v, u] & (blocked[v, u] <= 1 / joints[:, 2])
        surface = 1.0 / np.maximum(alone[v, u], 1e-6)
        near_surface = (surface > joints[:, 2] - 0.16) | (alone[v, u] == 0)
        seen = np.where(inside, np.where(near_surface, VISIBLE, SELF_OCCLUDED), OUTSIDE)
        return Crop(depth, np.array([reference, *middle]), joints, seen)

    def _outside(self, pixels: np.ndarray) -> np.ndarray:
        """Return bool (128, 128): outside an image whose borders truncate a third of the people.

        Most other people have a border near them, up to 1.2 m from their outermost joints.
        """
        rng = self._rng
        left, right, top, bottom = -1.0, float(SIZE), -1.0, float(SIZE)
        if rng.random() < 0.7:
            space = rng.uniform(0.1, 1.2, 4) / PIXEL
            (left, top), (right, bottom) = pixels.min(axis=0) - space[:2], pixels.max(axis=0) + space[2:]
        if rng.random() < 0.3:
            v = pixels[[_row(name) for name in CUTS[rng.choice(list(CUTS))]], 1]
            bottom = rng.uniform(v.min(), v.max())
            if rng.random() < 0.3:
                side = rng.integers(3)
                low = np.quantile(pixels[:, 0 if side < 2 else 1], [0.1, 0.4, 0.6, 0.9])
                if side == 0:
                    left = rng.uniform(low[0], low[1])
                elif side == 1:
                    right = rng.uniform(low[2], low[3])
                else:
                    top = rng.uniform(low[0], low[1])
        rows, columns = np.ogrid[:SIZE, :SIZE]
        return (columns < left) | (columns > right) | (rows < top) | (rows > bottom)


def draw_crops(poses: np.ndarray, count: int, seed: int, held: bool = False) -> dict[str, np.ndarray]:
    """Draw `count` crops of canonical poses (N, P): arrays as in the module's docstring."""
    painter, crops = CropPainter(poses, np.random.default_rng(seed), held), list[Crop]()
    while len(crops) < count:
        crop = painter.draw()
        if crop is not None:
            crops.append(crop)
    types = {"depth": np.uint16, "crop": np.float32, "joints": np.float32, "seen": np.uint8}
    return {name: np.stack([getattr(crop, name) for crop in crops]).astype(kind) for name, kind in types.items()}


def _row(name: str) -> int:
    return _JOINTS.index(name)


def main() -> None:
    """Draw crops and store them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--held", action="store_true", help="of the held-out poses")
    options = parser.parse_args()
    start = time.perf_counter()
    poses = PoseDatabase.load(DEFAULT_DATABASE).poses.astype(np.float64)
    crops = draw_crops(poses, options.count, options.seed, options.held)
    np.savez(options.out, **crops)
    print(f"{options.out}: {len(crops['depth'])} crops in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
