"""Constants of the particle filter of an upper body (Lopez-Mendez 2011, 2)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from toolkit import skeleton
from toolkit.constants import constant
from toolkit.errors import SettingsError
from toolkit.fitting.arms import SIDES


@dataclass(frozen=True)
class ParticleSettings:
    """Constants of the filter, metres and radians; what Lopez-Mendez 2011 leaves open has its reason.

    Attributes
    ----------
    count : particles in each of the three layers: 64 is the paper's online figure, 256 its reported one
    alpha : share of the arm particles that diffuse (Eq. 6), in [0, 1]; refusals make it more; 1 is the plain filter
    trunk_columns, arm_columns : pixels of width, at most, of the images that trunks and arms are weighed in: a trunk
        needs no more, and a hand has 8 pixels across at 1.4 m
    alternate : whether the arms take turns in being the second layer; in the paper the right arm always is
    bases : different trunks that are kept after the first layer: more are seldom left
    spread : metres of a hand about a candidate (`Sigma_e`), which lies on the surface, at tip or knuckles
    smoothness : `lambda` of Eq. 4: an arm may turn by two radians for a candidate
    least : log-probability of Eq. 4 below which an arm is diffused instead: four spreads from the candidate
    swivel : radians of spread about the swivel nearest to the arm before
    looks : swivel samples, all round, of a candidate arm. They are scored against the frame, for either arm in every
        second frame, and every second aimed arm is drawn by its cost: from an arm that is folded the wrong way the
        near ones lead beyond the joint limits; 0 = the paper's draw without scores
    near : metres: a candidate counts exp(-distance / near) as much as one at the hand before (`f` of Eq. 5)
    floor : but at least this share, or a raised hand is never proposed to a hanging arm
    holding : metres: the other hand holds a candidate that is as near as this
    held : share that such a candidate counts, or both arms take the same hand
    root_position : metres by which the root diffuses in a frame at 30 Hz
    root_rotation : radians, 3 degrees, likewise
    spine, neck, clavicle : radians per entry, likewise: they move little within a thirtieth of a second
    shoulder, elbow : radians, likewise: fast arms turn by 6 radians a second
    wrist : radians, likewise
    fine : every second pair of particles diffuses only this share as far, and one not at all: mostly people move slowly
    sharpness : how many times a cost counts in the weights: a mean over pixels is small against what a wrong arm costs
    cap : metres, the largest difference of depths that counts (`d_max`): a limb's width
    depth : cost of a mean squared difference of depths in units of the cap (`lambda_1`)
    silhouette : cost of silhouettes that nowhere agree (`lambda_2`): half of what a missed depth costs
    overlap : cost of squared overlaps in units of the balls' radii (`lambda_3`)
    trunk_margin : metres around the trunk's joints within which it is weighed, at their depth: half a shoulder more
    arm_margin : metres around an arm's joints and its candidates: the box must hold the proposed hands
    """

    count: int = 64
    alpha: float = constant(0.5)
    trunk_columns: int = constant(80)
    arm_columns: int = constant(160)
    alternate: bool = constant(True)
    bases: int = constant(16)
    spread: float = constant(0.03)
    smoothness: float = constant(0.1)
    least: float = constant(-8.0)
    swivel: float = constant(0.5)
    looks: int = constant(8)
    near: float = constant(0.25)
    floor: float = constant(0.3)
    holding: float = constant(0.15)
    held: float = constant(0.05)
    root_position: float = constant(0.02)
    root_rotation: float = constant(0.052)
    spine: float = constant(0.03)
    neck: float = constant(0.1)
    clavicle: float = constant(0.04)
    shoulder: float = constant(0.2)
    elbow: float = constant(0.25)
    wrist: float = constant(0.1)
    fine: float = constant(0.3)
    sharpness: float = constant(3.0)
    cap: float = constant(0.10)
    depth: float = constant(40.0)
    silhouette: float = constant(20.0)
    overlap: float = constant(10.0)
    trunk_margin: float = constant(0.22)
    arm_margin: float = constant(0.15)

    def __post_init__(self) -> None:
        for name in ("count", "trunk_columns", "arm_columns", "bases"):
            if getattr(self, name) < 1:
                raise SettingsError(f"particles.{name} is {getattr(self, name)}; give at least 1")
        if self.looks < 0:
            raise SettingsError(f"particles.looks is {self.looks}; give 0 for none, or a number of swivels")
        if not 0.0 <= self.alpha <= 1.0:
            raise SettingsError(f"particles.alpha is {self.alpha}; it is a share and lies in [0, 1]")
        signed = ("alternate", "count", "alpha", "looks", "trunk_columns", "arm_columns", "bases", "least")
        for name in (field.name for field in fields(self) if field.name not in signed):
            value = getattr(self, name)
            if not (value > 0 or (value == 0 and name not in ("spread", "near", "cap"))):
                raise SettingsError(f"particles.{name} is {value}; spreads, weights and lengths are not negative")

    def diffusion(self) -> np.ndarray:
        """Spread of every pose entry, float64 (P,), per frame at 30 Hz; 0 for the legs."""
        kinds = {"lumbar": self.spine, "thorax": self.spine, "cervical": self.neck}
        kinds |= {
            f"{side}_{name}": getattr(self, name)
            for side in SIDES
            for name in ("clavicle", "shoulder", "elbow", "wrist")
        }
        spread = np.array([kinds.get(name.rpartition("_")[0], 0.0) for name in skeleton.POSE_NAMES])
        spread[skeleton.ROOT_POSITION] = self.root_position
        spread[skeleton.ROOT_ROTATION] = self.root_rotation
        return spread
