"""Axes of limbs from the track and from inertial sensors (thesis, Fig. 7.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.calibrate import CalibrationSequence
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.distance import measured_limb, worlds_of
from toolkit.output.rendering.overlay import draw_line
from toolkit.sensing.camera import Camera


@dataclass(frozen=True, eq=False)
class LimbAxes:
    """Axes of L limbs over T frames, camera frame.

    Attributes
    ----------
    limbs : their names
    origins : float64 (T, L, 3), metres, the middles of the limbs
    tracked, measured : float64 (T, L, 3, 3), the columns are the axes by track and by sensors; NaN where unknown
    """

    limbs: tuple[str, ...]
    origins: np.ndarray
    tracked: np.ndarray
    measured: np.ndarray

    def draw(self, image: np.ndarray, camera: Camera, frame: int) -> None:
        """Draw the axes of a frame on an RGB image: tracked ones thin, measured ones bold."""
        length = 0.14  # length of a drawn axis, metres
        colors = ((200, 40, 40), (40, 150, 60), (40, 80, 200))  # RGB colours of x, y and z
        for rotations, thickness in ((self.measured, 4), (self.tracked, 1)):
            for origin, rotation in zip(self.origins[frame], rotations[frame], strict=True):
                if not np.isfinite(rotation).all():
                    continue
                pixels = camera.project(np.stack([origin, *(origin + length * rotation.T)]))
                for end, color in zip(pixels[1:], colors, strict=True):
                    draw_line(image, pixels[0], end, color, thickness)


def limb_axes(calibration: Calibration, take: CalibrationSequence, level_rotation: np.ndarray) -> LimbAxes:
    """Return the axes of each limb with a calibrated sensor; `level_rotation` is R_level_camera, (3, 3)."""
    worlds = worlds_of(calibration, take)
    limbs = tuple(s.name for s in take.sensors if s.name in calibration.usable and s.name in worlds)
    tracked, measured = [], []
    for limb in limbs:
        said, known = measured_limb(limb, take, worlds[limb], calibration.mounting(limb))
        tracked.append(quat.matrices(take.motion.orientation(limb)))
        measured.append(np.where(known[:, None, None], quat.matrices(said), np.nan))
    origins = np.stack([take.motion.middle(limb) for limb in limbs], axis=1)
    turn = level_rotation.T
    return LimbAxes(
        limbs,
        origins @ level_rotation,
        np.einsum("ij,tljk->tlik", turn, np.stack(tracked, axis=1)),
        np.einsum("ij,tljk->tlik", turn, np.stack(measured, axis=1)),
    )
