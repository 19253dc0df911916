"""What variants of the particle filter of an upper body differ in (Lopez-Mendez 2011, 2)."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import constant


@dataclass(frozen=True)
class ParticleSettings:
    """What differs between the paper's filter, ours, and the one of first poses.

    Attributes
    ----------
    count : particles in each of the three layers: 64 is the paper's online figure, 256 its reported one
    alpha : share of the arm particles that diffuse (Eq. 6), in [0, 1]; refusals make it more; 1 is the plain filter
    trunk_columns, arm_columns : pixels of width, at most, of the images that trunks and arms are weighed in: a trunk
        needs no more, and a hand has 8 pixels across at 1.4 m
    alternate : whether the arms take turns in being the second layer; in the paper the right arm always is
    looks : swivel samples, all round, of a candidate arm. They are scored against the frame, for either arm in every
        second frame, and every second aimed arm is drawn by its cost: from an arm that is folded the wrong way the
        near ones lead beyond the joint limits; 0 = the paper's draw without scores
    power : of the distance in `f` of Eq. 5: the paper's 2 makes far candidates rarer, and first poses in rooms worse
    floor : least share that a candidate counts (`f` of Eq. 5), or a raised hand is never proposed to a hanging arm
    held : share that a candidate counts that the other hand holds, or both arms take the same hand
    fine : every second pair of particles diffuses only this share as far, and one not at all: mostly people move slowly
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
                raise SettingsError(f"particles.{name} is {getattr(self, name)}; it is a share and lies in [0, 1]")
