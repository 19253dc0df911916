"""Draw depth images of people in furnished rooms, the training data of the person network.

    python -m training.room_images OUT.npz COUNT SEED

OUT.npz holds N images of 160 x 120 pixels of a pinhole camera with a focal length of 142 pixels:

- depth : uint16 (N, 120, 160), millimetres, 0 = no measurement
- owner : int8 (N, 120, 160), number of the person that a pixel shows, `FURNITURE` or `SHELL`
- heads : float32 (N, 8, 3), metres, camera frame (x right, y down, z forward), 0 without a person

Cameras stand mostly near a wall, 0.6 to 2.6 m above the floor. People stand, walk and sit, alone, beside and behind
each other, at desks, with furniture at their sides, in clothes that stand off the skin.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.database import DEFAULT_DATABASE
from toolkit.database.database import PoseDatabase
from toolkit.kernels.image import raster
from toolkit.kernels.linear import rotated
from toolkit.simulation.mesh import Mesh, joined
from training.interiors.pieces import PIECES, SEATS, Part, Piece, shifted
from training.interiors.room import KINDS, Room, furnished
from training.room_pieces import TOUCHING, held, moved_up, reflectances
from training.sensor import lossy
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
    turned_pose,
)

WIDTH, HEIGHT, FOCAL = 160, 120, 142.0
"""Pixels: every fourth of a Kinect."""
FURNITURE, SHELL = -1, -2
"""Owners of pixels that show no person: furniture; floor, walls, ceiling, or nothing."""
COUNTS = (0.10, 0.22, 0.20, 0.14, 0.10, 0.08, 0.06, 0.05, 0.05)
"""Probabilities of 0 to 8 people in an image."""
VIEWS_OF_ROOM = 8
SEATED, AT_DESK, TOUCHED, HIDDEN, HOLDING, CLOTHED = 0.45, 0.6, 0.35, 0.15, 0.2, 0.85
"""Probabilities that a person sits, that a seated one is at a desk, that furniture stands beside a person, that an
occluder stands before, that a person holds something and wears clothes that stand off the skin."""
CUT_OUT = 0.12
"""Probability of an image of people or furniture alone, as a segmentation leaves it."""
MEASURED = 0.3
"""Least measured fraction of an image; the sensor loses dark and far surfaces."""
LAYERS = {TORSO: 0.08, ARMS: 0.05, LEGS: 0.045, HEAD: 0.03}
"""Largest thickness of clothes and hair, metres."""
COAT = 0.3
"""Probability of clothes as thick on the thighs as on the trunk."""

_PELVIS, _HEAD = skeleton.REPORTED.index("pelvis"), skeleton.REPORTED.index("head")


class RoomImage(NamedTuple):
    """One training example; fields as in the module's docstring."""

    depth: np.ndarray
    owner: np.ndarray
    heads: np.ndarray


class RoomPerson(NamedTuple):
    """A person in a room: body, surface (V, 3) and joints (20, 3) on the floor plan, facing, True if seated."""

    body: Body
    vertices: np.ndarray
    joints: np.ndarray
    yaw: float
    sits: bool


class PinholeCamera(NamedTuple):
    """A camera in a room: place (3,), heading in radians, and rotation (3, 3) from the floor plan to the camera."""

    place: np.ndarray
    heading: float
    rotation: np.ndarray


class RoomImagePainter:
    """Draws images of rooms; every `VIEWS_OF_ROOM` of them show the same room.

    Parameters
    ----------
    poses : float (N, P), canonical
    rng : source of all randomness
    """

    def __init__(self, poses: np.ndarray, rng: np.random.Generator) -> None:
        self._poses, self._rng = poses, rng
        self._space = ShapeSpace.load()
        self._faces = self._space.faces.astype(np.int64)
        body = self._space.body()
        self._seated = is_seated(poses, body)
        self._upright = np.flatnonzero(is_upright(poses, body))
        self._room: Room | None = None
        self._left = 0

    def draw(self) -> RoomImage | None:
        """Draw the next image; None where the camera sees hardly anything."""
        rng = self._rng
        if self._room is None or self._left == 0:
            self._room, self._left = furnished(str(rng.choice(list(KINDS))), rng), VIEWS_OF_ROOM
        self._left -= 1
        camera = self._camera(self._room)
        people: list[RoomPerson] = []
        extra: list[Piece] = []
        for _ in range(rng.choice(len(COUNTS), p=COUNTS)):
            at = self._place(self._room, camera, people)
            if at is not None:
                people.append(self._person(at))
                extra += self._around(people[-1])
        return self._rendered(self._room, camera, people, extra)

    def _camera(self, room: Room) -> PinholeCamera:
        """Draw a camera that looks across the room."""
        rng, low, high = self._rng, room.low, room.high
        place = rng.uniform(low + 0.25, high - 0.25)
        if rng.random() < 0.7:
            axis = rng.choice([0, 2])
            gap = rng.uniform(0.2, 0.6)
            place[axis] = low[axis] + gap if rng.random() < 0.5 else high[axis] - gap
        place[1] = rng.uniform(0.6, min(2.6, high[1] - 0.05))
        target = rng.uniform(low + 0.8, np.maximum(high - 0.8, low + 0.9))
        if rng.random() < 0.5:
            target = 0.5 * (target + 0.5 * (low + high))
        away = target - place
        heading = float(np.arctan2(away[0], away[2]))
        down = place[1] - rng.uniform(0.3, 1.5)
        tilt = np.arctan2(down, max(np.hypot(away[0], away[2]), 1.0)) + rng.normal(0.0, 0.1)
        tilt, roll = float(np.clip(tilt, -0.18, 0.8)), rng.normal(0.0, 0.03)
        (sh, st, sr), (ch, ct, cr) = np.sin([heading, tilt, roll]), np.cos([heading, tilt, roll])
        forward, right = np.array([sh * ct, -st, ch * ct]), np.array([-ch, 0.0, sh])
        below = np.cross(forward, right)
        return PinholeCamera(place, heading, np.stack([cr * right + sr * below, cr * below - sr * right, forward]))

    def _place(self, room: Room, camera: PinholeCamera, people: list[RoomPerson]) -> np.ndarray | None:
        """Draw a place on the floor in view, apart from camera and people, or None."""
        rng = self._rng
        if people and rng.random() < 0.4:
            angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.4, 1.2)
            start = people[rng.integers(len(people))].joints[_PELVIS]
        else:
            angle, distance = camera.heading + rng.uniform(-0.6, 0.6), rng.uniform(0.7, 8.0)
            start = camera.place
        at = start + distance * np.array([np.sin(angle), 0.0, np.cos(angle)])
        at = np.clip(at, room.low + 0.25, room.high - 0.25) * (1, 0, 1)
        away = [np.hypot(*(at - other)[[0, 2]]) for other in (camera.place, *(p.joints[_PELVIS] for p in people))]
        return None if away[0] < 0.6 or min(away) < 0.35 else at

    def _person(self, at: np.ndarray) -> RoomPerson:
        """Draw a person with the lowest point on the floor at x and z of `at`."""
        rng = self._rng
        body = draw_body(self._space, 0.12, rng)
        # The database holds as many rare poses as common ones; most people in rooms stand, walk or sit.
        row = int(rng.choice(self._upright)) if rng.random() < 0.4 else row_of(self._seated, SEATED / 0.6, rng)
        pose, yaw = turned_pose(self._poses[row], rng)
        vertices, joints = body.vertex_positions(pose), body.joint_positions(pose)
        if rng.random() < CLOTHED:
            vertices = self._clothed(body, vertices)
        move = np.array([at[0], -vertices[:, 1].min(), at[2]])
        return RoomPerson(body, vertices + move, joints + move, yaw, bool(self._seated[row]))

    def _clothed(self, body: Body, vertices: np.ndarray) -> np.ndarray:
        """Return the vertices (V, 3) with clothes that stand off the skin, for some a coat down to the thighs."""
        layers = {parts: self._rng.uniform(0.0, most) for parts, most in LAYERS.items()}
        if self._rng.random() < COAT:
            layers[THIGHS] = layers[TORSO]
        return thickened(body, vertices, self._faces, layers)

    def _around(self, person: RoomPerson) -> list[Piece]:
        """Draw the seat, the desk, furniture at the side, an occluder, and what the person holds."""
        rng, pieces = self._rng, list[Piece]()
        pelvis = person.joints[_PELVIS]
        seat = float(person.vertices[person.body.part == 0, 1].min())
        if person.sits and 0.2 < seat < 0.7:
            chosen = PIECES[str(rng.choice(SEATS))](rng, seat)  # type: ignore[call-arg]
            pieces.append(shifted(chosen, pelvis[0], 0.0, pelvis[2], person.yaw + rng.normal(0.0, 0.1)))
            if rng.random() < AT_DESK:
                kind = str(rng.choice(["desk", "table"]))
                pieces.append(moved_up(PIECES[kind](rng), pelvis, rng.uniform(0.15, 0.45), person.yaw, np.pi, rng))
        if rng.random() < TOUCHED:
            for kind in rng.choice(TOUCHING, rng.integers(1, 3)):
                gap, angle = rng.uniform(0.1, 0.4), rng.uniform(-np.pi, np.pi)
                pieces.append(moved_up(PIECES[str(kind)](rng), pelvis, gap, angle, None, rng))
        if rng.random() < HOLDING:
            pieces.append(held(person.joints, rng))
        return pieces

    def _hidden_by(self, person: RoomPerson, camera: PinholeCamera) -> Piece:
        """Draw a piece of furniture between a person and the camera."""
        rng = self._rng
        away = camera.place - person.joints[_PELVIS]
        kind = str(rng.choice(TOUCHING))
        angle, gap = float(np.arctan2(away[0], away[2])) + rng.normal(0.0, 0.3), rng.uniform(0.2, 1.0)
        return moved_up(PIECES[kind](rng), person.joints[_PELVIS], gap, angle, None, rng)

    def _rendered(
        self, room: Room, camera: PinholeCamera, people: list[RoomPerson], extra: list[Piece]
    ) -> RoomImage | None:
        """Render everything as a sensor measures it."""
        rng = self._rng
        hidden = [person for person in people if rng.random() < HIDDEN]
        extra = [*extra, *(self._hidden_by(person, camera) for person in hidden)]
        near = np.concatenate([camera.place[[0, 2]][None], *(p.joints[:, [0, 2]] for p in people)])
        surfaces = room.surfaces(near, rng.uniform(0.05, 0.35))
        parts: list[Part] = [part for piece in extra for part in piece]
        meshes = [surfaces.mesh, *(part.mesh for part in parts), *(Mesh(p.vertices, self._faces) for p in people)]
        owner = np.concatenate([
            np.where(surfaces.piece < 0, SHELL, FURNITURE),
            np.full(sum(len(part.mesh.faces) for part in parts), FURNITURE),
            *(np.full(len(self._faces), number) for number in range(len(people))),
        ])  # fmt: skip
        reflectance = np.concatenate([
            surfaces.reflectance, *(np.full(len(part.mesh.faces), part.reflectance) for part in parts),
            *(reflectances(p.body, rng)[self._faces[:, 0]] for p in people),
        ])  # fmt: skip
        whole = joined(meshes)
        points, faces = rotated(whole.vertices - camera.place, camera.rotation.T), whole.faces.astype(np.int64)
        centre = 0.5 * (np.array([WIDTH, HEIGHT]) - 1)
        projected = np.empty(points.shape)
        raster.project(points, np.array([FOCAL, FOCAL, *centre]), projected)
        inverse, triangle = np.empty((HEIGHT, WIDTH)), np.empty((HEIGHT, WIDTH), dtype=np.int32)
        raster.rasterise(projected, faces, inverse, triangle)
        shown = triangle >= 0
        if shown.mean() < 0.5:
            return None
        depth = lossy(
            inverse, _cosines(points, faces, triangle), np.where(shown, reflectance[triangle], 0.0), FOCAL, rng
        )
        if (depth > 0).mean() < MEASURED:
            return None
        owners = np.where(shown, owner[triangle], SHELL).astype(np.int8)
        if rng.random() < CUT_OUT:
            depth = self._cut_out(depth, owners)
        heads = np.zeros((len(COUNTS) - 1, 3), dtype=np.float32)
        for number, person in enumerate(people):
            heads[number] = rotated(person.joints[_HEAD][None] - camera.place, camera.rotation.T)[0]
        return RoomImage(depth, owners, heads)

    def _cut_out(self, depth: np.ndarray, owners: np.ndarray) -> np.ndarray:
        """Return the depth of the people, or of furniture alone, often with surfaces near it in image and depth."""
        rng = self._rng
        people = owners >= 0
        kept = people if people.any() and rng.random() < 0.7 else owners == FURNITURE
        if people.any() and rng.random() < 0.5:
            kept = owners == rng.choice(owners[people])
        if rng.random() < 0.5 and (kept & (depth > 0)).any():
            middle = np.median(depth[kept & (depth > 0)])
            size = max(3, int(rng.uniform(100.0, 700.0) * FOCAL / middle))
            grown = cv2.dilate(kept.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
            kept = kept | (grown & (np.abs(depth - middle) < rng.uniform(200.0, 800.0)) & (owners != SHELL))
        return np.where(kept, depth, 0).astype(np.uint16)


def _cosines(points: np.ndarray, faces: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Return the cosine (H, W) between ray and surface of points in the camera frame, 0 where nothing is."""
    height, width = triangle.shape
    corners = points[faces[np.maximum(triangle, 0)]]
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    x = (np.arange(width) - 0.5 * (width - 1))[None] / FOCAL
    y = (np.arange(height) - 0.5 * (height - 1))[:, None] / FOCAL
    rays = np.stack(np.broadcast_arrays(x, y, 1.0), axis=-1)
    lengths = np.linalg.norm(normals, axis=-1) * np.linalg.norm(rays, axis=-1)
    return np.where(triangle >= 0, np.abs((normals * rays).sum(-1)) / np.maximum(lengths, 1e-12), 0.0)


def draw_images(poses: np.ndarray, count: int, seed: int) -> dict[str, np.ndarray]:
    """Draw `count` images with people in canonical poses (N, P): arrays as in the module's docstring."""
    painter, images = RoomImagePainter(poses, np.random.default_rng(seed)), list[RoomImage]()
    while len(images) < count:
        image = painter.draw()
        if image is not None:
            images.append(image)
    return {name: np.stack([getattr(image, name) for image in images]) for name in RoomImage._fields}


def main() -> None:
    """Draw images and store them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    options = parser.parse_args()
    start = time.perf_counter()
    poses = PoseDatabase.load(DEFAULT_DATABASE).poses.astype(np.float64)
    images = draw_images(poses, options.count, options.seed)
    np.savez(options.out, **images)
    print(f"{options.out}: {len(images['depth'])} images in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
