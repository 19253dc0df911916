"""Settings of the fit: correspondences, local optimisation and comparison."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.errors import SettingsError


@dataclass(frozen=True)
class FittingSettings:
    """Constants of the local optimisation; the reasons stand beside the values in `configs/*.yaml`.

    Lengths in metres, angles in radians.
    """

    iterations: int = 5
    neighbours: int = 3
    reach: float = 0.5
    unexplained: float = 0.2
    sigma: float = 0.12
    facing: float = 0.1
    hidden_tolerance: float = 0.03
    surface_plane: float = 1.0
    surface_point: float = 0.3
    cloud_samples: int = 400
    cloud_plane: float = 1.0
    cloud_point: float = 0.3
    extremum_weight: float = 3.0
    prior_weight: float = 0.001
    contact_weight: float = 1.0
    angle_damping: float = 1.0
    root_damping: float = 0.1
    converged: float = 0.01
    search: str = "pixels"

    def __post_init__(self) -> None:
        if self.iterations < 1 or not 1 <= self.neighbours <= 9:
            raise SettingsError(
                f"fitting needs at least 1 iteration and 1 to 9 neighbours, not {self.iterations} and {self.neighbours}"
            )
        if self.search not in ("pixels", "open3d"):
            raise SettingsError(f"fitting.search is 'pixels' or 'open3d', not {self.search!r}")
