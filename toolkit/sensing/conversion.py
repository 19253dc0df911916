"""Conversion of raw depth images to the canonical form: uint16 millimetres along z, not mirrored."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from toolkit.io.errors import RecordingError, UsageError
from toolkit.sensing.camera import Camera

LARGEST_MM = 65535
"""Largest depth of the canonical form."""
FARTHEST_MEDIAN_MM = 20_000.0
"""Twice the length of a room."""
DEPTH_UNITS = {
    "mm": 0.001, "m": 1.0, "0.01": 0.01, "0.0254": 0.0254, "0.002": 0.002, "0.0005": 0.0005, "0.00025": 0.00025,
    "0.0002": 0.0002, "0.000125": 0.000125, "0.0001": 0.0001,
}  # fmt: skip
"""Metres per stored unit, by the name of `--depth-unit`: centimetres, inches, 1/5000 m (TUM RGB-D), 1/10 mm (RealSense
at close range), halves, quarters, eighths (OpenNI, shifted) and doubles of a millimetre."""


@dataclass(eq=False)
class DepthConverter:
    """Converter of units, projection and mirroring of raw frames.

    Attributes
    ----------
    unit : "mm", "m" or the metres of one raw unit
    radial : raw values are distances from the camera's centre, not depths along z
    mirrored : raw images are flipped left to right
    """

    unit: str | float = "mm"
    radial: bool = False
    mirrored: bool = False
    _factor: float = field(init=False)
    _checked: bool = field(init=False, default=False)
    _slant: np.ndarray | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._factor = 1000.0 * unit_in_metres(self.unit)

    def convert(self, raw: np.ndarray, camera: Camera, what: str, *, check: bool = True) -> np.ndarray:
        """Return one raw image (H, W) of `camera` as uint16 millimetres along z.

        NaN, infinite and negative values, 16-bit values from 65000 on, and depths beyond 65.5 m, become 0: no
        measurement.

        Raises
        ------
        RecordingError
            The image has another shape or type, or the first one with a measurement has an implausible median.
        """
        if raw.shape != camera.shape:
            raise RecordingError(
                f"{what} has shape {raw.shape}, expected {camera.shape}; all frames must have one size"
            )
        if raw.dtype.kind not in "uif":
            raise RecordingError(f"{what} has type {raw.dtype}; depth must be numbers, uint16 millimetres best")
        if raw.dtype.itemsize == 1:
            raise RecordingError(f"{what} has 8 bits a pixel; depth needs 16 bits")
        # 16-bit values from here on mean no measurement (Azure Kinect files; others saturate at 65535)
        invalid_from = 65000
        if raw.dtype == np.uint16 and raw.size and raw.max() >= invalid_from:
            raw = np.where(raw < invalid_from, raw, np.uint16(0))
        if check and not self._checked:
            self._check(raw, what)
        depth = raw
        if raw.dtype != np.uint16 or self._factor != 1.0 or self.radial:
            depth = self._millimetres(raw, camera)
        return np.ascontiguousarray(depth[:, ::-1] if self.mirrored else depth)

    def _millimetres(self, raw: np.ndarray, camera: Camera) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):  # overflows and NaN are out of range
            values = raw.astype(np.float64) * self._factor
        if self.radial:
            if self._slant is None:
                self._slant = 1.0 / np.sqrt(1.0 + (camera.rays() ** 2).sum(axis=-1))
            values *= self._slant
        with np.errstate(invalid="ignore"):
            usable = (values > 0) & (values <= LARGEST_MM)
        rounded = np.zeros(values.shape, dtype=np.uint16)
        rounded[usable] = np.rint(values[usable])
        return rounded

    def _check(self, raw: np.ndarray, what: str) -> None:
        measured = raw[np.isfinite(raw) & (raw > 0)].astype(np.float64)
        far = measured * self._factor > LARGEST_MM
        if far.any() and not far.all() and np.ptp(measured[far]) == 0:
            measured = measured[~far]  # one value far away stands for no measurement
        if not measured.size:
            return
        stored = float(np.median(measured))
        if not self._plausible(self._factor * stored):
            fitting = [u for u, metres in DEPTH_UNITS.items() if self._plausible(1000 * stored * metres)]
            raise RecordingError(
                f"{what} has a median value of {stored:g}, which is {self._factor * stored / 1000:g} m with "
                f"--depth-unit {self.unit}; give --depth-unit {' or '.join(fitting) or 'the metres of one unit'}"
            )
        self._checked = True

    @staticmethod
    def _plausible(median_mm: float) -> bool:
        nearest_median_mm = 100.0  # nearest range of a depth camera; metres read as millimetres are below
        return nearest_median_mm <= median_mm <= FARTHEST_MEDIAN_MM


def unit_in_metres(unit: str | float) -> float:
    """Return the metres of one depth unit: "mm", "m" or a positive number.

    Raises
    ------
    UsageError
        The unit is none of these.
    """
    if unit in ("mm", "m"):
        return 0.001 if unit == "mm" else 1.0
    try:
        value = float(unit)
    except (TypeError, ValueError):
        value = float("nan")
    if not 0 < value < 10:
        raise UsageError(f"--depth-unit is {unit!r}; give mm, m or the metres of one unit, such as 0.001")
    return value
