"""Training views of people in furnished rooms, and of rooms without people: what a person is and what is not.

Cameras stand anywhere in a room, 0.5 to 2.5 m above its floor. Furniture stands around people, touches them, and
stands before and behind them; they sit on chairs and hold things. Most images are whole; some are cut out, of a person
with the furniture that touches them, or of furniture alone, as a wrong segmentation leaves them. Sensors lose glass,
black, far and grazing surfaces, and what lies in the projector's shadow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from database_builder.views import (
    FOCAL,
    HEIGHTS,
    CroppedView,
    ViewSettings,
    body_labels,
    draw_body,
    draw_mesh,
    joints_in_view,
    project_level,
    row_of,
    sensed,
    turned_pose,
)
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.kernels.learning import forest
from toolkit.kernels.linear import rotated, times
from toolkit.simulation.interiors.mesh import Mesh, cushion, joined, moved, slab
from toolkit.simulation.interiors.pieces import BLACK, DARK, PIECES, PLAIN, SEATS, Part, Piece, shifted
from toolkit.simulation.interiors.room import KINDS, Room, furnished

NO_PERSON = 2 * len(skeleton.JOINT_NAMES)
"""Label of a pixel that is of no person, after those of `body_labels`."""
VIEWS_OF_ROOM = 6
"""Images that are taken in a room before the next is furnished."""
NEAREST, FARTHEST = 0.8, 5.5
"""Metres from the camera to the person whom an image shows."""
STEEPEST_ROW = 1.8
"""Slope of the lowest row of a camera that looks down."""
TOUCHING = ("chair", "office_chair", "table", "desk", "shelf", "sofa", "curtain", "coat_stand", "column", "partition",
            "plant", "boxes", "bag", "floor_lamp", "stool", "door")  # fmt: skip
"""What is moved up to a person."""
TOUCHED, COMPANY, HOLDING = 0.6, 0.35, 0.2
"""Shares of people to whom furniture is moved up, whom others stand about, and who hold something."""
SUBJECT, OTHER, SHELL = -2, -3, -1
"""Owners of pixels that are no piece of furniture: the person whom the image shows, other people, the walls."""


@dataclass(frozen=True, eq=False)
class RoomView(CroppedView):
    """What a level camera sees of a room, or of what was cut out of it; attributes as of `CroppedView`, and

    owner : int32 (H, W), `SUBJECT`, `OTHER`, `SHELL` or the number of a piece of furniture
    """

    owner: np.ndarray

    @property
    def no_person(self) -> np.ndarray:
        """Bool (H, W): pixels that show furniture or walls."""
        return np.asarray(self.owner >= SHELL)


@dataclass(frozen=True, eq=False)
class LevelCamera:
    """A level camera in a room.

    place : (3,), metres, floor plan; heading : radians, where it looks, about +y from +z
    tilt : radians, downwards; view : (2,) half its angles of view, radians, across and down
    """

    place: np.ndarray
    heading: float
    tilt: float
    view: np.ndarray

    def to_level(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 3) of the floor plan in the camera's level frame."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return rotated(points - self.place, np.array([[-cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, -cosine]]))

    def borders(self) -> tuple[np.ndarray, tuple[int, int]]:
        """Image coordinates of the first pixel, and height and width, of the level image that holds what it sees."""
        side = FOCAL * np.tan(self.view[0]) / np.cos(self.tilt)
        top, bottom = FOCAL * np.tan(self.tilt + self.view[1] * np.array([-1.0, 1.0]))
        low = np.floor([-side, top])
        high = np.ceil([side, min(bottom, STEEPEST_ROW * FOCAL)])
        return low, (int(high[1] - low[1]), int(high[0] - low[0]))


@dataclass(frozen=True, eq=False)
class RoomPerson:
    """A person in a room: body, surface (V, 3) and joints (20, 3) on the floor plan, facing, and who sits."""

    body: Body
    vertices: np.ndarray
    joints: np.ndarray
    yaw: float
    sits: bool


class RoomPainter:
    """Draws views of rooms; every few of them show the same room.

    Parameters
    ----------
    poses : float (N, P), canonical
    sits : bool (N,), which of them sit
    settings : what the images show
    """

    def __init__(self, poses: np.ndarray, sits: np.ndarray, settings: ViewSettings) -> None:
        self._poses, self._sits, self._settings = poses, sits, settings
        self._space = ShapeSpace.load()
        self._faces = self._space.faces.astype(np.int64)
        self.labels = body_labels(self._space.body())
        self._room: Room | None = None
        self._left = 0

    def label_image(self, view: RoomView) -> np.ndarray:
        """int64 (H, W): label of the part of the subject that a pixel shows, elsewhere `NO_PERSON`."""
        labels = self.labels[self._faces[view.triangle, 0]]
        return np.where(view.owner == SUBJECT, labels, NO_PERSON)

    def draw(self, rng: np.random.Generator) -> RoomView:
        """The next view."""
        if self._room is None or self._left == 0:
            self._room, self._left = furnished(str(rng.choice(list(KINDS))), rng), VIEWS_OF_ROOM
        self._left -= 1
        room = self._room
        people: list[RoomPerson] = []
        extra: list[Piece] = []
        middle = _seen_middle(room, rng)
        camera_at = self._place(rng, room.low + [0.3, 0, 0.3], room.high - [0.3, 0, 0.3])
        if rng.random() >= self._settings.room.empty:
            distance = rng.uniform(NEAREST, FARTHEST)
            at = _within(room, camera_at, distance, rng)
            people.append(self._person(at, rng))
            middle = 0.5 * (people[0].vertices.min(axis=0) + people[0].vertices.max(axis=0))
            extra = self._around(people[0], rng)
            if rng.random() < COMPANY:
                for _ in range(rng.integers(1, 4)):
                    beside = _within(room, at, rng.uniform(0.35, 2.5), rng)
                    people.append(self._person(beside, rng))
        camera = _camera(camera_at, middle, rng)
        near = [camera_at[[0, 2]][None], *(person.joints[:, [0, 2]] for person in people)]
        return self._drawn(room, np.concatenate(near), people, extra, camera, rng)

    def _place(self, rng: np.random.Generator, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        return rng.uniform(np.minimum(low, high), np.maximum(low, high)) * (1, 0, 1) + [0.0, rng.uniform(*HEIGHTS), 0.0]

    def _person(self, at: np.ndarray, rng: np.random.Generator) -> RoomPerson:
        """A person of any size and pose with their feet on the floor, at x and z of `at`."""
        body = draw_body(self._space, self._settings.small, rng)
        row = row_of(self._sits, self._settings.seated, rng)
        pose, yaw = turned_pose(self._poses[row], 1.0, rng)
        vertices, joints = body.vertex_positions(pose), body.joint_positions(pose)
        move = np.array([at[0], -vertices[:, 1].min(), at[2]])
        return RoomPerson(body, vertices + move, joints + move, yaw, bool(self._sits[row]))

    def _around(self, person: RoomPerson, rng: np.random.Generator) -> list[Piece]:
        """What a person sits on, sits at, touches and holds, on the floor plan."""
        pieces: list[Piece] = []
        pelvis = person.joints[skeleton.REPORTED.index("pelvis")]
        seat = float(person.vertices[person.body.part == 0, 1].min())
        if person.sits and 0.2 < seat < 0.7:
            maker = PIECES[str(rng.choice(SEATS))]
            chosen = maker(rng, seat)  # type: ignore[call-arg]
            pieces.append(shifted(chosen, pelvis[0], 0.0, pelvis[2], person.yaw + rng.normal(0.0, 0.1)))
            if rng.random() < 0.5:
                kind = str(rng.choice(["desk", "table"]))
                pieces.append(_moved_up(PIECES[kind](rng), pelvis, rng.uniform(0.2, 0.45), person.yaw, np.pi, rng))
        if rng.random() < TOUCHED:
            for kind in rng.choice(TOUCHING, rng.integers(1, 3)):
                gap = rng.uniform(0.1, 0.4)
                pieces.append(_moved_up(PIECES[str(kind)](rng), pelvis, gap, rng.uniform(-np.pi, np.pi), None, rng))
        if rng.random() < HOLDING:
            pieces.append(_held(person.joints, rng))
        return pieces

    def _drawn(
        self, room: Room, near: np.ndarray, people: list[RoomPerson], extra: list[Piece], camera: LevelCamera,
        rng: np.random.Generator,
    ) -> RoomView:  # fmt: skip
        """Everything in one image, as a sensor measures it."""
        surfaces = room.surfaces(near, rng.uniform(0.1, 0.35))
        count = int(surfaces.piece.max(initial=-1)) + 1
        parts = [(part, count + number) for number, piece in enumerate(extra) for part in piece]
        meshes = [surfaces.mesh, *(part.mesh for part, _ in parts), *(Mesh(p.vertices, self._faces) for p in people)]
        owner = np.concatenate([
            surfaces.piece, *(np.full(len(part.mesh.faces), number) for part, number in parts),
            *(np.full(len(self._faces), OTHER if k else SUBJECT) for k in range(len(people))),
        ])  # fmt: skip
        reflectance = np.concatenate([
            surfaces.reflectance, *(np.full(len(part.mesh.faces), part.reflectance) for part, _ in parts),
            *(_clothes(person.body, rng)[self._faces[:, 0]] for person in people),
        ])  # fmt: skip
        whole = joined(meshes)
        level, faces = camera.to_level(whole.vertices), whole.faces.astype(np.int64)
        corner, shape = camera.borders()
        inverse, triangle = draw_mesh(project_level(level), faces, corner, shape)
        owners = np.where(triangle >= 0, owner[triangle], SHELL).astype(np.int32)
        cosine = _cosines(level, faces, triangle, corner)
        depth = lossy(inverse, cosine, reflectance[triangle], rng)
        window = np.array([0, shape[1] - 1, 0, shape[0] - 1], dtype=np.int32)
        joints, in_view = np.zeros((len(skeleton.REPORTED), 3)), np.zeros(len(skeleton.REPORTED), dtype=bool)
        if people:
            joints = camera.to_level(people[0].joints)
            in_view = joints_in_view(joints, corner, window, np.where(owners == SUBJECT, 0.0, inverse))
        if rng.random() < self._settings.room.cut:
            depth = _cut_out(depth, owners, rng)
        first = int((owner == SUBJECT).argmax()) if people else 0
        body_face = np.where(owners == SUBJECT, triangle - first, 0).astype(np.int32)
        return RoomView(depth, window, in_view, body_face, corner, joints, owners)


def _seen_middle(room: Room, rng: np.random.Generator) -> np.ndarray:
    """What a camera looks at in an empty room: mostly a piece of furniture."""
    if not room.standing or rng.random() < 0.2:
        return np.asarray(rng.uniform(room.low, room.high) * (1.0, 0.6, 1.0))
    piece = room.standing[rng.integers(len(room.standing))]
    points = np.concatenate([part.mesh.vertices for part in piece.parts])
    return np.asarray(points.mean(axis=0))


def _within(room: Room, at: np.ndarray, distance: float, rng: np.random.Generator) -> np.ndarray:
    """A place (3,) at about this horizontal distance from another, inside the walls, metres, y = 0."""
    low, high = room.low + 0.3, room.high - 0.3
    angles = rng.uniform(-np.pi, np.pi, 12)
    places = at + distance * np.stack([np.sin(angles), np.zeros(12), np.cos(angles)], axis=1)
    inside = ((places >= low) & (places <= high))[:, [0, 2]].all(axis=1)
    place = places[inside.argmax()]
    return np.clip(place, np.minimum(low, high), np.maximum(low, high)) * (1, 0, 1)


def _camera(place: np.ndarray, target: np.ndarray, rng: np.random.Generator) -> LevelCamera:
    """A camera at a place that sees a target somewhere in its image."""
    view = rng.uniform((0.42, 0.34), (0.66, 0.56))
    away = target - place
    heading = np.arctan2(away[0], away[2]) + rng.uniform(-0.8, 0.8) * view[0]
    tilt = np.arctan2(-away[1], max(float(np.hypot(away[0], away[2])), 0.3)) + rng.normal(0.0, 0.4) * view[1]
    return LevelCamera(place, float(heading), float(np.clip(tilt, -0.35, 0.8)), view)


def _moved_up(
    piece: Piece, to: np.ndarray, gap: float, angle: float, yaw: float | None, rng: np.random.Generator
) -> Piece:
    """A piece whose nearest side is `gap` metres from a place, in the direction `angle`; `yaw` against it, or any."""
    turn = angle + (rng.uniform(-np.pi, np.pi) if yaw is None else yaw + rng.normal(0.0, 0.15))
    standing = shifted(piece, yaw=turn)
    direction = np.array([np.sin(angle), 0.0, np.cos(angle)])
    near = min(float(times(part.mesh.vertices, direction).min()) for part in standing)
    place = to + (gap - near) * direction
    return shifted(standing, place[0], 0.0, place[2])


def _held(joints: np.ndarray, rng: np.random.Generator) -> Piece:
    """A box between the hands, a tablet in one of them, or a bag that hangs from it."""
    hands = joints[[skeleton.REPORTED.index(f"{side}_wrist") for side in ("left", "right")]]
    hand, yaw = hands[rng.integers(2)], rng.uniform(-np.pi, np.pi)
    kind = rng.integers(3)
    if kind == 0:
        size = rng.uniform((0.2, 0.12, 0.15), (0.5, 0.4, 0.4))
        mesh, at = slab((0.0, 0.0, 0.0), size), hands.mean(axis=0)
    elif kind == 1:
        mesh, at = (
            slab((0.0, 0.05, 0.0), (rng.uniform(0.15, 0.3), rng.uniform(0.2, 0.32), 0.02), rng.uniform(0, 1)),
            hand,
        )
    else:
        size = rng.uniform((0.2, 0.25, 0.1), (0.45, 0.5, 0.25))
        mesh, at = cushion((0.0, -0.5 * size[1] - 0.1, 0.0), size, rng, 0.1), hand
    return [Part(moved(mesh, at[0], at[1], at[2], yaw), float(rng.choice([PLAIN, DARK, BLACK])))]


def _clothes(body: Body, rng: np.random.Generator) -> np.ndarray:
    """Reflectance (V,) of a person's hair, skin, shirt and trousers; any but the skin may be nearly black."""
    hair, shirt, trousers = rng.choice([PLAIN, 0.35, DARK, BLACK], 3, p=[0.4, 0.25, 0.2, 0.15])
    names = np.array(skeleton.JOINT_NAMES)[body.part]
    legs = np.char.endswith(names, "hip") | np.char.endswith(names, "knee") | (names == "root")
    bare = np.char.endswith(names, "wrist") | (names == "cervical")
    out = np.where(legs, trousers, np.where(bare, PLAIN, shirt))
    top = (names == "cervical") & (body.vertices[:, 1] > np.quantile(body.vertices[names == "cervical", 1], 0.6))
    return np.where(top, hair, out)


def _cosines(level: np.ndarray, faces: np.ndarray, triangle: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Cosine between ray and surface (H, W), 0 where nothing is."""
    corners = level[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    height, width = triangle.shape
    x = (np.arange(width) + corner[0])[None] / FOCAL
    y = (np.arange(height) + corner[1])[:, None] / FOCAL
    along = normals[triangle, 0] * x - normals[triangle, 1] * y - normals[triangle, 2]
    return np.where(triangle >= 0, np.abs(along) / np.sqrt(1.0 + x * x + y * y), 0.0)


def _cut_out(depth: np.ndarray, owners: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The depth of a person (if there is one) or of a piece of furniture, often with what touches it, alone.

    What was nearer than that is unobserved or, if the source does not say what stands there, nothing.
    """
    import cv2

    kept = owners == SUBJECT
    if kept.sum() < 60 or rng.random() < 0.3:
        kinds, sizes = np.unique(owners[owners >= 0], return_counts=True)
        large = kinds[sizes > 60]
        if not len(large):
            return depth
        kept = owners == rng.choice(large)
    z = depth.astype(np.float32) * 0.001
    measured = z[kept & (z > 0)]
    middle = float(np.median(measured)) if len(measured) else 2.0
    if rng.random() < 0.7:
        # What lies within a step of it, in the image and in depth, and is neither wall nor floor, is taken along.
        reach = max(3, int(rng.uniform(0.1, 0.7) * FOCAL / middle))
        grown = cv2.dilate(kept.astype(np.uint8), np.ones((reach, reach), np.uint8)).astype(bool)
        kept = kept | (grown & (np.abs(z - middle) < rng.uniform(0.2, 0.8)) & (owners != SHELL))
    before = forest.UNOBSERVED if rng.random() < 0.6 else 0
    rest = np.where((z > 0) & (z < middle - 0.15), before, 0)
    return np.where(kept, depth, rest).astype(np.uint16)


def lossy(inverse: np.ndarray, cosine: np.ndarray, reflectance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """uint16 millimetres of a room (H, W): `sensed`, without what gives too little light back and what lies in shadow.

    inverse : 1/m, 0 where nothing is; cosine : between ray and surface; reflectance : share of light given back
    """
    z = 1.0 / np.maximum(inverse, 1e-6)
    amplitude = reflectance * cosine / z**2
    dimmest = np.exp(rng.uniform(np.log(5e-4), np.log(0.012))) * rng.lognormal(0.0, 0.3, z.shape)
    lost = (amplitude < dimmest) | (cosine < rng.uniform(0.0, 0.2)) | (z > rng.uniform(3.5, 10.0))
    lost |= z < rng.choice([0.3, 0.5, 0.8])
    if rng.random() < 0.5:
        lost |= _in_shadow(inverse) if rng.random() < 0.5 else _in_shadow(inverse[:, ::-1])[:, ::-1]
    return sensed(np.where(lost, 0.0, inverse), rng)


def _in_shadow(inverse: np.ndarray) -> np.ndarray:
    """Bool (H, W): what a projector 7.5 cm to the right of the camera does not light."""
    column = np.arange(inverse.shape[1]) - 0.075 * FOCAL * inverse
    blocking = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(column > blocking + 0.5)
