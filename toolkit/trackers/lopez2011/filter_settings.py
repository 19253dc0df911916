"""Settings of the particle filter of an upper body (Lopez-Mendez 2011, 2)."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.io.typed_values import AtLeastOne, Share, constant


@dataclass(frozen=True)
class ParticleSettings:
    """Parameters of the filter that the paper varies or leaves open.

    Attributes
    ----------
    count : particles in each of the three layers (64 in the paper's online figure, 256 in its reported one)
    alpha : fraction of the arm particles that diffuse (Eq. 6), in [0, 1]; rejected proposals add to it; 1 is the plain
        filter
    columns : maximum width in pixels of the images in which poses are weighed (160x120 in the paper); a hand has 8
        pixels across at 1.4 m
    """

    count: AtLeastOne = 256
    alpha: Share = constant(0.5)
    columns: AtLeastOne = 160
