"""Settings of the particle filter of an upper body (Lopez-Mendez 2011, 2)."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import constant


@dataclass(frozen=True)
class ParticleSettings:
    """Parameters in which the paper's filter, ours, and the filter of first poses differ.

    Attributes
    ----------
    count : particles in each of the three layers (64 in the paper's online figure, 256 in its reported one)
    alpha : fraction of the arm particles that diffuse (Eq. 6), in [0, 1]; rejected proposals add to it; 1 is the plain
        filter
    trunk_columns, arm_columns : maximum width in pixels of the images for trunk and arm costs; a hand has 8 pixels
        across at 1.4 m
    alternate : exchange the order of the arms in each frame; in the paper the right arm is always second
    looks : number of swivel samples of a candidate arm that are scored against the frame, for one arm per frame; every
        second aimed arm is drawn by these costs, because an arm folded the wrong way cannot reach the target in small
        steps. 0 = the paper's draw without scores
    power : exponent of the distance in `f` of Eq. 5 (2 in the paper, which is worse for first poses in rooms)
    floor : minimum weight of a candidate (`f` of Eq. 5), so that a raised hand is proposed to a hanging arm
    held : share that a candidate counts that the other hand holds, or both arms take the same hand
    fine : factor of the diffusion of every second pair of particles; one particle does not diffuse, because people
        mostly move slowly
    """

    count: int = 64
    alpha: float = constant(0.5)
    trunk_columns: int = constant(80)
    arm_columns: int = constant(160)
    alternate: bool = constant(True)
    looks: int = constant(8)
    power: float = constant(1.0)
    floor: float = constant(0.3)
    held: float = constant(0.05)
    fine: float = constant(0.3)

    def __post_init__(self) -> None:
        for name in ("count", "trunk_columns", "arm_columns"):
            if getattr(self, name) < 1:
                raise SettingsError(f"particles.{name} is {getattr(self, name)}; give at least 1")
        if not self.power > 0.0:
            raise SettingsError(f"particles.power is {self.power}; give more than 0")
        if self.looks < 0:
            raise SettingsError(f"particles.looks is {self.looks}; give 0 for none, or a number of swivels")
        for name in ("alpha", "floor", "held", "fine"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise SettingsError(f"particles.{name} is {getattr(self, name)}; it is a fraction and lies in [0, 1]")
