"""Depth sensor models: measurements of an exact surface by a time-of-flight camera and a Kinect v1.

A frame is an instant: motion blur is not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from toolkit.io.errors import UsageError
from toolkit.sensing.camera import Camera


@dataclass(frozen=True)
class Surface:
    """Surface seen by the rays of a camera.

    Attributes
    ----------
    depth : float32 (H, W), metres along z, 0 without a hit
    cosine : float32 (H, W), cosine between ray and surface normal, in [0, 1]
    person : int16 (H, W), number of the person, -1 for everything else
    reflectance : float32 (H, W), relative to a plain surface: 1 is bright cloth or wood, 0 glass; None is 1
        everywhere
    """

    depth: np.ndarray
    cosine: np.ndarray
    person: np.ndarray
    reflectance: np.ndarray | None = None


SENSOR_RANGE = 8.0
"""Largest measured depth of both sensors, metres."""


def _ray_lengths(camera: Camera) -> np.ndarray:
    """Return the length of the ray of unit depth through each pixel, (H, W)."""
    return np.sqrt(1.0 + (camera.rays() ** 2).sum(axis=-1))


def _millimetres(depth: np.ndarray, valid: np.ndarray, nearest: float, farthest: float) -> np.ndarray:
    inside = valid & (depth >= nearest) & (depth <= farthest)
    return np.where(inside, np.rint(1e3 * np.where(inside, depth, 0.0)), 0.0).astype(np.uint16)


@dataclass(frozen=True)
class TimeOfFlight:
    """Time-of-flight camera of 176 x 144 pixels (Baak 2013, 5.3.1), 44 by 35 degrees field of view.

    Light returns with an amplitude of cos(angle of incidence) / distance^2. Photon noise makes the range noise
    proportional to the inverse root of the amplitude, so it grows with distance and grazing angle. A pixel is the
    amplitude-weighted mean of the ranges in it; at edges it lies between front and back (mixed pixels).
    """

    name: ClassVar = "tof"
    camera: ClassVar = Camera(217.0, 217.0, 87.5, 71.5, 176, 144)
    rays_per_side: ClassVar = 3
    """Rays along each side of a pixel: `measure` expects the surface seen by `camera.scaled(rays_per_side)`."""
    noise_at_3m: float = 0.010
    """Standard deviation in metres at 3 m, seen frontally."""
    dimmest: ClassVar = 0.08
    """Amplitude, relative to a frontal surface at 3 m, below which there is no measurement."""

    def measure(self, surface: Surface, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return measured depth, uint16 (H, W) millimetres along z with 0 = none, and person, int16 (H, W), -1 =
        none.
        """
        distance = surface.depth * self._fine_lengths
        hit = surface.depth > 0
        amplitude = np.where(hit, surface.cosine / np.where(hit, distance, 1.0) ** 2, 0.0)
        if surface.reflectance is not None:
            amplitude *= surface.reflectance
        total = self._pixels(amplitude)
        mean = self._pixels(amplitude * distance) / np.maximum(total, 1e-12)
        strength = total * 9.0
        noise = self.noise_at_3m / np.sqrt(np.maximum(strength, self.dimmest)) * rng.standard_normal(total.shape)
        depth = (mean + noise) / _ray_lengths(self.camera)
        return _millimetres(depth, strength >= self.dimmest, 0.3, SENSOR_RANGE), self._owners(surface.person)

    def _owners(self, person: np.ndarray) -> np.ndarray:
        """Return the person with the largest part of a pixel, int16 (H, W); -1 if people fill less than half."""
        people = max(int(person.max()) + 1, 1)
        shares = np.stack([self._pixels((person == i).astype(np.float32)) for i in range(people)])
        return np.where(shares.sum(axis=0) >= 0.5, shares.argmax(axis=0), -1).astype(np.int16)

    @cached_property
    def _fine_lengths(self) -> np.ndarray:
        return _ray_lengths(self.camera.scaled(self.rays_per_side)).astype(np.float32)

    def _pixels(self, values: np.ndarray) -> np.ndarray:
        """Return the mean over the rays of each pixel."""
        side = self.rays_per_side
        return sum(values[i::side, j::side] for i in range(side) for j in range(side)) / np.float32(side**2)


@dataclass(frozen=True)
class KinectV1:
    """Kinect v1 at 320 x 240 pixels: structured light with triangulation (Baak 2013, 5.3.1).

    The sensor measures inverse depth with spatially correlated noise (the matching window), in steps of 2.5 cm at 3 m.
    Silhouettes are ragged by about a pixel. Points that the projector, 7.5 cm to the right, does not illuminate are
    holes (the shadow to the left of a person), as are surfaces at a grazing angle and random pixels at edges.
    """

    name: ClassVar = "kinect"
    camera: ClassVar = Camera(285.63, 285.63, 159.5, 119.5, 320, 240)
    rays_per_side: ClassVar = 1
    step: ClassVar = 0.025 / 3.0**2
    """1/m: quantum of the inverse depth; a depth step is `step * z^2`."""
    noise: float = 0.5
    """Standard deviation of the inverse depth in quanta."""
    window: ClassVar = 0.8
    """Pixels: width over which the noise is shared."""
    ragged: float = 0.6
    """Pixels: standard deviation of the sideways displacement of a measurement."""
    baseline: ClassVar = 0.075
    """Metres from the camera to the projector, to the right."""
    grazing: ClassVar = 0.12
    """Cosine of incidence below which all surfaces are holes; up to twice of it, some are."""
    dimmest: ClassVar = 0.012
    """Light given back, relative to a frontal plain surface at 1 m, below which there is no measurement; where
    surfaces are of several materials."""
    torn: float = 0.25
    """Share of the pixels at depth edges that give no measurement."""

    def measure(self, surface: Surface, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return measured depth, uint16 (H, W) millimetres along z with 0 = none, and person, int16 (H, W), -1 =
        none.
        """
        rows, columns = self._displaced(rng)
        depth, cosine = surface.depth[rows, columns], surface.cosine[rows, columns]
        lit = self._lit(surface.depth)[rows, columns]
        hit = depth > 0
        inverse = 1.0 / np.where(hit, depth, 1.0)
        quanta = np.rint(inverse / self.step + self.noise * self._shared_noise(rng))
        holes = rng.random(depth.shape) < np.clip(2.0 - cosine / self.grazing, 0.0, 1.0)
        edge = self._at_edges(surface.depth) & (rng.random(depth.shape) < self.torn)
        valid = hit & lit & ~holes & ~edge & (quanta >= 1)
        if surface.reflectance is not None:
            light = surface.reflectance[rows, columns] * cosine * inverse**2
            valid &= light >= self.dimmest * rng.lognormal(0.0, 0.25, light.shape)
        measured = 1.0 / (self.step * np.maximum(quanta, 1.0))
        return _millimetres(measured, valid, 0.45, SENSOR_RANGE), surface.person[rows, columns]

    def _displaced(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return the source pixels of each pixel's measurement."""
        height, width = self.camera.shape
        shift = np.rint(self.ragged * rng.standard_normal((2, height, width))).astype(np.int64)
        rows = np.clip(np.arange(height)[:, None] + shift[0], 0, height - 1)
        return rows, np.clip(np.arange(width) + shift[1], 0, width - 1)

    def _lit(self, depth: np.ndarray) -> np.ndarray:
        """Return bool (H, W) mask of the points that the projector illuminates.

        For the projector a point is at column `u - fx b / z`. If a point further right in the image has a smaller
        column, it is between the projector and this point.
        """
        seen = np.where(depth > 0, depth, np.inf)
        column = np.arange(self.camera.width) - self.camera.fx * self.baseline / seen
        blocking = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
        return column <= blocking + 0.5

    def _shared_noise(self, rng: np.random.Generator) -> np.ndarray:
        from scipy.ndimage import gaussian_filter

        noise = gaussian_filter(rng.standard_normal(self.camera.shape), self.window, mode="wrap")
        return noise / noise.std()

    def _at_edges(self, depth: np.ndarray) -> np.ndarray:
        """Return bool (H, W): pixels whose 3 x 3 neighbourhood spans more than 10 cm."""
        from scipy.ndimage import maximum_filter, minimum_filter

        return maximum_filter(depth, 3) - minimum_filter(depth, 3) > 0.1


Sensor = TimeOfFlight | KinectV1
"""Depth camera: its rays, and its measurement of a surface."""
SENSORS: dict[str, type[Sensor]] = {kind.name: kind for kind in (TimeOfFlight, KinectV1)}
"""Sensors by the names of `simulate --sensor`."""


def make_sensor(name: str) -> Sensor:
    """Return the sensor of a name in `SENSORS`.

    Raises
    ------
    UsageError
        There is no sensor of this name.
    """
    if name not in SENSORS:
        raise UsageError(f"no sensor is called {name!r}; use one of {', '.join(SENSORS)}")
    return SENSORS[name]()
