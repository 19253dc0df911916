"""Shape space of the body, and bodies made from it.

People sampled over MakeHuman's gender, age (from about eight years), weight, muscle, height and proportions were
brought into the T-pose. A principal component analysis of tracker vertices, joints and sites gives K = 10 components
(`scripts/make_body_assets.py`). Size is part of the space: the first component is mostly body height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body, vertex_normals
from toolkit.io.errors import BodyError
from toolkit.kernels import linear

CHILD = 2.4
"""Size (first coefficient) of the smallest people of the shape space's population."""
ASSETS = Path(__file__).parent / "assets"
CLOTHES = (
    ("cervical",),
    ("root", "lumbar", "thorax", "left_clavicle", "right_clavicle"),
    ("left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    ("left_hip", "right_hip"),
    ("left_knee", "right_knee"),
    ("left_ankle", "right_ankle"),
)
"""Joints whose skin is covered by hair, shirts, sleeves, trousers and shoes; each row is a component."""


@dataclass(frozen=True, eq=False)
class ShapeSpace:
    """Linear shape space: mean + coefficients @ basis, coefficients in standard deviations of the population.

    Attributes
    ----------
    mean : float64 (V + 18 + 5, 3), metres: vertices, joints, sites
    basis : float64 (K, V + 18 + 5, 3), metres per standard deviation: orthogonal components of the population, then
        one outward displacement of the skin by 1 cm for each of `CLOTHES`, without joints
    faces, skin_joints, skin_weights, end_effectors : as in `Body`
    variance : float64 (K,), fraction of the population's variance that each component explains
    named : coefficients (K,) of each named body
    """

    mean: np.ndarray
    basis: np.ndarray
    faces: np.ndarray
    skin_joints: np.ndarray
    skin_weights: np.ndarray
    end_effectors: np.ndarray
    variance: np.ndarray
    named: dict[str, np.ndarray]

    @staticmethod
    @cache
    def load() -> ShapeSpace:
        """Return the shipped shape space (read once).

        Raises
        ------
        BodyError
            The assets are missing or were made for another joint tree.
        """
        data = _read_asset("tracker.npz")
        mean, faces = data["mean"].astype(np.float64), data["faces"].astype(np.int32)
        skin_joints, skin_weights = data["skin_joints"].astype(np.int64), _unit_rows(data["skin_weights"])
        clothes = _clothes(mean, faces, skin_joints, skin_weights)
        return ShapeSpace(
            mean=mean,
            basis=np.concatenate([data["basis"].astype(np.float64), clothes]),
            faces=faces,
            skin_joints=skin_joints,
            skin_weights=skin_weights,
            end_effectors=data["end_effectors"],
            variance=np.concatenate([data["variance"], np.zeros(len(clothes))]),
            named=dict(zip(data["names"].tolist(), data["shapes"], strict=True)),
        )

    @property
    def size(self) -> int:
        """Number of components, K."""
        return len(self.basis)

    def at(self, vertices: np.ndarray) -> ShapeSpace:
        """Return the space restricted to the skin vertices `vertices` (N,), without faces and end effectors."""
        rows = np.concatenate([vertices, np.arange(len(self.skin_joints), len(self.mean))])
        return replace(
            self,
            mean=self.mean[rows],
            basis=self.basis[:, rows],
            faces=self.faces[:0],
            skin_joints=self.skin_joints[vertices],
            skin_weights=self.skin_weights[vertices],
            end_effectors=self.end_effectors[:0],
        )

    def body(
        self,
        coefficients: Sequence[float] | np.ndarray | None = None,
        scale: float = 1.0,
        name: str = "body",
        offsets: np.ndarray | None = None,
    ) -> Body:
        """Return the body of up to K coefficients (standard deviations; missing ones are 0), scaled by `scale`.

        `offsets` (V,), metres before scaling, move its vertices outwards along their normals.

        Raises
        ------
        BodyError
            There are more than K coefficients or other than V offsets, one is not finite, or the scale is not positive.
        """
        shape = _padded(coefficients, self.size)
        points = self.mean + linear.combined(shape, self.basis)
        vertices, joints, sites = _split(points)
        if offsets is not None:
            offsets = np.asarray(offsets, dtype=np.float64)
            if offsets.shape != (len(vertices),) or not np.isfinite(offsets).all():
                raise BodyError(f"offsets of shape {offsets.shape} do not fit {len(vertices)} vertices; scan again")
            vertices = vertices + offsets[:, None] * vertex_normals(vertices, self.faces)
        body = Body(
            name, vertices, self.faces, self.skin_joints, self.skin_weights, joints, sites, self.end_effectors, shape,
            offsets=offsets,
        )  # fmt: skip
        return body if scale == 1.0 else body.scaled(scale)

    def typical(self, stature: float) -> np.ndarray:
        """Return the coefficients (K,) of the average person of a stature, 0.66 to 2.1 m.

        Other statures are clipped to this range.
        """
        statures, shapes = self._growth
        return np.array([np.interp(-stature, -statures, column) for column in shapes.T])

    def childhood(self, size: float) -> np.ndarray:
        """Return the toddler component of a size (first coefficient): (K,), zeros for sizes up to `CHILD`."""
        shape = np.zeros(self.size)
        # Direction in the shape space, per standard deviation of size, from a child of eight years to a toddler: large
        # head, short legs. Fitted on MakeHuman's people from one to eight years (residual 12 instead of 20 mm).
        growth = (1.0, -0.06, 0.41, 0.54, 0.46, 0.18, 0.26, 0.19, -0.75, -1.46)
        shape[: len(growth)] = max(size - CHILD, 0.0) * np.array(growth)
        return shape

    @cached_property
    def _growth(self) -> tuple[np.ndarray, np.ndarray]:
        """Statures (N,), metres, decreasing, and coefficients (N, K) of average people of these statures."""
        size_limits = (-3.6, 7.2)  # first coefficients of people of 2.1 m and of 0.66 m
        sizes = np.linspace(*size_limits, 33)
        shapes = np.array([self.childhood(size) for size in sizes])
        shapes[:, 0] += np.minimum(sizes, CHILD)
        return np.array([self.body(shape).height for shape in shapes]), shapes

    def project(self, body: Body) -> np.ndarray:
        """Return the coefficients (K,) of the body of this space closest to `body` (least squares over all points).

        Raises
        ------
        BodyError
            `body` has another number of vertices than the bodies of this space.
        """
        if body.vertices.shape != (len(self.skin_joints), 3):
            raise BodyError(
                f"body {body.name!r} has {len(body.vertices)} vertices, the shape space {len(self.skin_joints)}; "
                "project a body that was made by ShapeSpace.body"
            )
        change = np.concatenate([body.vertices, body.joints, body.sites]) - self.mean
        return np.linalg.lstsq(self.basis.reshape(self.size, -1).T, change.ravel(), rcond=None)[0]


def _clothes(mean: np.ndarray, faces: np.ndarray, skin_joints: np.ndarray, skin_weights: np.ndarray) -> np.ndarray:
    """Return the clothing components, (6, V + 18 + 5, 3): outward along the normals, hands uncovered."""
    normals = vertex_normals(mean[: len(skin_joints)], faces)
    out = np.zeros((len(CLOTHES), *mean.shape))
    thickness = 0.01  # metres per standard deviation; the population of the shape space is naked and bald
    for component, names in zip(out, CLOTHES, strict=True):
        carriers = [skeleton.JOINT_NAMES.index(name) for name in names]
        covered = (skin_weights * np.isin(skin_joints, carriers)).sum(axis=1)
        component[: len(skin_joints)] = thickness * covered[:, None] * normals
    return out


@cache
def load_body(name: str = "neutral") -> Body:
    """Load a tracker body by its name, such as neutral, slim_male, heavy_female or child.

    Raises
    ------
    BodyError
        There is no body of this name; the message lists those that exist.
    """
    space = ShapeSpace.load()
    return space.body(_named(space.named, name), name=name)


def subject_body(shape: str | Sequence[float] | np.ndarray, *, seed: int | None = None) -> Body:
    """Return a subject for simulated recordings: MakeHuman's full skin (13,380 vertices) with its finest rig.

    A subject has 20 components; the tracker's space contains the first 10. With a `seed` it also has local deformations
    outside any shape space: MakeHuman's own (belly, shoulders, hips, calves, limb lengths, ...) by random amounts, and
    smooth bumps of clothing up to 12 mm.

    Parameters
    ----------
    shape : name of a body, or up to 20 coefficients in standard deviations
    seed : seed of the local deformations; None for a subject without them

    Raises
    ------
    BodyError
        The name is unknown, or there are too many or not finite coefficients.
    """
    data = _subjects()
    named = dict(zip(data["names"].tolist(), data["shapes"], strict=True))
    coefficients = _padded(_named(named, shape) if isinstance(shape, str) else shape, len(data["basis"]))
    quantum = float(data["quantum"])
    points = data["mean"] + quantum * linear.combined(coefficients, data["basis"])
    faces, count = data["faces"].astype(np.int32), len(data["skin_joints"])
    if seed is not None:
        rng = np.random.default_rng(seed)
        points += quantum * linear.combined(rng.uniform(-0.5, 0.6, len(data["local"])), data["local"])
        points[:count] += _bumps(points[:count], faces, rng)
    vertices, joints, sites = _split(points)
    return Body(
        shape if isinstance(shape, str) else "subject",
        vertices,
        faces,
        data["skin_joints"].astype(np.int64),
        _unit_rows(data["skin_weights"]),
        joints,
        sites,
        tip_vertices(vertices, sites),
        coefficients,
    )


def tip_vertices(vertices: np.ndarray, sites: np.ndarray) -> np.ndarray:
    """Return the vertices at the fingertips, toe tips and crown, int64 (5,), ordered as `skeleton.END_EFFECTORS`.

    `vertices` (V, 3) and `sites` (5, 3) are those of a T-pose, metres.
    """
    x, y, z = vertices.T
    below = y < sites[3, 1] + 0.1
    return np.array(
        [
            np.argmax(x),
            np.argmax(-x),
            np.argmax(np.where(below & (x > 0), z, -np.inf)),
            np.argmax(np.where(below & (x < 0), z, -np.inf)),
            np.argmax(y),
        ],
        dtype=np.int64,
    )


def _bumps(skin: np.ndarray, faces: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw offsets (V, 3) along the normals: Gaussian bumps, 4 to 12 cm wide, at random points below the neck."""
    corners = skin[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = vertex_normals(skin, faces)
    area = np.linalg.norm(face_normals, axis=1) * (corners[..., 1].mean(axis=1) < np.quantile(skin[:, 1], 0.95) - 0.3)
    bumps = 40  # number of bumps and dents of a subject's clothes
    centres = corners[rng.choice(len(faces), bumps, p=area / area.sum())].mean(axis=1)
    width, height = rng.uniform(0.02, 0.06, bumps), rng.uniform(-0.006, 0.012, bumps)
    distance = np.linalg.norm(skin[:, None] - centres, axis=2)
    return linear.times(np.exp(-0.5 * (distance / width) ** 2), height).clip(-0.008, 0.012)[:, None] * normals


def _split(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, joints (the root exactly at the origin) and sites of one row of a shape space."""
    vertices, joints, sites = np.split(points, [-len(skeleton.JOINTS) - len(skeleton.SITES), -len(skeleton.SITES)])
    joints[0] = 0.0
    return vertices, joints, sites


def _unit_rows(weights: np.ndarray) -> np.ndarray:
    wide = weights.astype(np.float64)
    return wide / wide.sum(axis=1, keepdims=True)


def _padded(coefficients: Sequence[float] | np.ndarray | None, size: int) -> np.ndarray:
    given = np.zeros(0) if coefficients is None else np.atleast_1d(np.asarray(coefficients, dtype=np.float64))
    if given.ndim != 1 or len(given) > size or not np.isfinite(given).all():
        raise BodyError(f"shape coefficients {given.tolist()} do not fit; give at most {size} finite numbers")
    return np.concatenate([given, np.zeros(size - len(given))])


def _named(named: dict[str, np.ndarray], name: str) -> np.ndarray:
    if name not in named:
        raise BodyError(f"no body is called {name!r}; there are: {', '.join(named)}")
    return named[name]


@cache
def _subjects() -> dict[str, np.ndarray]:
    return _read_asset("subjects.npz")


def _read_asset(file: str) -> dict[str, np.ndarray]:
    path = ASSETS / file
    if not path.exists():
        raise BodyError(f"the body asset {file} is missing; run scripts/make_body_assets.py")
    with np.load(path) as archive:
        data = {key: archive[key] for key in archive.files}
    if str(data["fingerprint"]) != skeleton.fingerprint():
        raise BodyError(f"the body asset {file} belongs to another joint tree; run scripts/make_body_assets.py")
    return data
