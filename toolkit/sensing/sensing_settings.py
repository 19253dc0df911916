"""Settings of segmentation and filtering of depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import constant

MODES = "auto, segmented, background, empty-frames:N, range:NEAR,FAR, person, seed:U,V"
SUPPORT = {"keep": 0, "mixed": 3}
"""Number of supporting neighbours (of 8) that a pixel needs, by the setting `contour`."""
CONTOURS = (*SUPPORT, "silhouette")


@dataclass(frozen=True)
class SegmentationMode:
    """Parsed setting `segment`: a name and its numbers."""

    name: str
    numbers: tuple[float, ...] = ()

    @classmethod
    def parse(cls, text: str) -> SegmentationMode:
        """Parse `name` or `name:number[,number]`.

        Raises
        ------
        SettingsError
            The text is none of `MODES`.
        """
        name, _, tail = text.partition(":")
        counts = {"auto": 0, "segmented": 0, "background": 0, "person": 0, "empty-frames": 1, "range": 2, "seed": 2}
        try:
            numbers = tuple(float(part) for part in tail.split(",")) if tail else ()
        except ValueError:
            numbers = (float("nan"),)
        if counts.get(name) != len(numbers) or not all(np.isfinite(n) and n >= 0 for n in numbers):
            raise SettingsError(f"--segment is {text!r}; give one of: {MODES}")
        if name == "range" and numbers[0] >= numbers[1]:
            raise SettingsError(f"--segment {text!r} is no range; give metres, the nearer first")
        most_empty_frames = 1000
        if name == "empty-frames" and not (1 <= numbers[0] <= most_empty_frames and numbers[0] == int(numbers[0])):
            raise SettingsError(f"--segment {text!r} needs a number of frames from 1 to {most_empty_frames}")
        return cls(name, numbers)


@dataclass(frozen=True)
class SensingSettings:
    """Settings of segmentation and filtering.

    Attributes
    ----------
    segment : "auto" (a background if there is one, else already segmented frames), "segmented", "background",
        "empty-frames:N" (background model of the first N frames), "range:NEAR,FAR" (metres), "person" (the only
        person-sized object), "seed:U,V" (the object at this pixel of the first frame)
    subject : selected person of several: "only" (two people are an error), "largest" or "nearest"
    near, far : metres; depth outside is not used. A Kinect starts at 0.4 m, and no person beyond 8 m has enough pixels
    background_margin : metres by which a foreground pixel is nearer than the background, beyond the quantisation of
        both; a ToF camera's noise is 1 to 2 cm, and a sole is 4 cm above the floor
    contour : "mixed" deletes pixels that fewer than 3 of their 8 neighbours support, "silhouette" every pixel of the
        person with a pixel beside the person among its 4 neighbours (Baak 2013, 5.3.1), "keep" none. On simulated
        time-of-flight images "mixed" keeps 91 % of a person, with 0.1 % beside the body ("keep": 2.7 %); a forearm is
        3 to 4 pixels wide at 176x144, and "silhouette" halves it
    contour_tolerance : metres within which a neighbour supports a pixel, beyond the quantisation; the depth of a
        forearm's side changes by 2 cm per pixel at 3 m
    quantisation : metres at 1 m; grows with the square of the distance. A Kinect v1 has 2.5 cm at 3 m (Baak 2013,
        5.3.1)
    median : apply the 3x3 median
    half_resolution : keep every second pixel of every second row
    """

    segment: str = "auto"
    subject: str = "only"
    near: float = 0.3
    far: float = 8.0
    background_margin: float = 0.03
    contour: str = "mixed"
    contour_tolerance: float = constant(0.03)
    quantisation: float = 0.0028
    median: bool = True
    half_resolution: bool = False

    def __post_init__(self) -> None:
        SegmentationMode.parse(self.segment)
        if self.contour not in CONTOURS:
            raise SettingsError(f"contour {self.contour!r} is none of: {', '.join(CONTOURS)}")
        if self.subject not in ("only", "largest", "nearest"):
            raise SettingsError(f"--subject is {self.subject!r}; give one of: only, largest, nearest")
        if not 0 <= self.near < self.far <= 65.0:
            raise SettingsError(f"near {self.near} and far {self.far} are no range; give metres, near first, up to 65")
        for name in ("background_margin", "contour_tolerance", "quantisation"):
            if not 0 <= getattr(self, name) <= 1:
                raise SettingsError(f"{name} {getattr(self, name)} is out of range; give metres between 0 and 1")
