"""One body in front of one camera, with all parts of a fit."""

from collections.abc import Sequence

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.fitting.priors import PoseTerm
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import PairTerm
from toolkit.sensing.camera import Camera


def back_projected(depth: np.ndarray, intrinsics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) of the pixels with depth (H, W) > 0, camera frame, metres, and their flat indices (N,)."""
    v, u = np.nonzero(depth > 0)
    z = depth[v, u].astype(np.float64)
    fx, fy, cx, cy = intrinsics
    return np.stack([(u - cx) * z / fx, (v - cy) * z / fy, z], axis=1), v * depth.shape[1] + u


def vertex_jacobian(body: Body, pose: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the derivative of chosen vertices by the pose, fourth-order central differences: float64 (V, 3, P)."""
    out = np.empty((len(vertices), 3, len(pose)))
    for entry, change in enumerate(1e-3 * np.eye(len(pose))):
        near, far = (
            body.vertex_positions(pose + k * change) - body.vertex_positions(pose - k * change) for k in (1, 2)
        )
        out[:, :, entry] = (8.0 * near - far)[vertices] / 12e-3
    return out


def whole_image(placed: PlacedBody) -> tuple[np.ndarray, np.ndarray]:
    """Return depth and triangle of a drawn body in the whole image: (H, W) each, 0 and -1 outside of it."""
    shape, (part, numbers, intrinsics) = placed.placer.camera.shape, placed.drawn
    left, top = np.rint(placed.placer.intrinsics[2:] - intrinsics[2:]).astype(int)
    window = slice(top, top + part.shape[0]), slice(left, left + part.shape[1])
    depth, triangle = np.zeros(shape), np.full(shape, -1, dtype=np.int32)
    depth[window], triangle[window] = part, numbers
    return depth, triangle


class Fit:
    """Objective and refiner of one body."""

    def __init__(
        self,
        body: Body,
        camera: Camera,
        rotation: np.ndarray,
        settings: FittingSettings,
        priors: Sequence[PoseTerm] = (),
    ) -> None:
        self.body, self.placer = body, Placer(body, camera, rotation)
        self.objective = Objective(self.placer, settings, priors)
        self.refiner = Refiner(self.placer, settings, priors)

    def refine(
        self, pose: np.ndarray, scene: Scene, *, terms: Sequence[PairTerm] = (), iterations: int | None = None
    ) -> np.ndarray:
        return self.refiner.refine(self.body, pose, scene, terms=terms, iterations=iterations)

    def compare(self, pose: np.ndarray, scene: Scene, bound: float = np.inf) -> Comparison:
        return self.objective.compare(self.body, pose, scene, bound)

    def distance(self, pose: np.ndarray, scene: Scene) -> float:
        return self.compare(pose, scene).distance

    def confidence(self, pose: np.ndarray, scene: Scene) -> np.ndarray:
        return self.objective.confidence(self.compare(pose, scene), self.body.joint_positions(pose))
