"""Settings of the particle filter of an upper body (Lopez-Mendez 2011, 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from toolkit.io.typed_values import AtLeastOne, Range, Share, constant


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

    count: AtLeastOne = 64
    alpha: Share = constant(0.5)
    trunk_columns: AtLeastOne = constant(80)
    arm_columns: AtLeastOne = constant(160)
    alternate: bool = constant(True)
    looks: Annotated[int, Range(0)] = constant(8)
    power: Annotated[float, Range(1e-6)] = constant(1.0)
    floor: Share = constant(0.3)
    held: Share = constant(0.05)
    fine: Share = constant(0.3)
