"""Picture of `depthmocap info`: the depth of a frame with the detected people."""

from __future__ import annotations

import numpy as np

from toolkit.output.rendering.style import FAINT, INK, PAPER, person_color
from toolkit.people.description import FirstLook, largest_surface


def picture(look: FirstLook) -> np.ndarray:
    """Return an RGB picture, uint8 (H, W, 3): nearer is brighter, people are coloured and numbered, pixels without a
    measurement are dark.
    """
    import cv2

    depth = look.depth_mm.astype(np.float64)
    measured = depth > 0
    near, far = np.percentile(depth[measured], [2, 98]) if measured.any() else (0.0, 1.0)
    place = np.clip((depth - near) / max(far - near, 1.0), 0.0, 1.0)
    near_shade, far_shade = 0.95, 0.25  # brightness of the nearest and the farthest measurement
    shade = np.where(measured, near_shade + (far_shade - near_shade) * place, 0.0)[..., None]
    image = np.where(measured[..., None], shade * np.array(FAINT), np.array(PAPER))
    for sighting in look.sightings:
        size = (image.shape[1], image.shape[0])
        mask = cv2.resize((sighting.depth > 0).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        image[mask] = shade[mask] * np.array(person_color(sighting.id - 1))
    painted = np.ascontiguousarray(np.rint(image).astype(np.uint8))
    scale = image.shape[0] / 480
    for sighting in look.sightings:
        v, u = np.nonzero(largest_surface(sighting.depth))
        k = int(np.argmin(v))
        step = image.shape[0] / sighting.depth.shape[0]
        at = (int(u[k] * step), int(max(v[k] * step, 24 * scale)))
        cv2.putText(painted, str(sighting.id), at, cv2.FONT_HERSHEY_SIMPLEX, scale, INK, max(1, round(2 * scale)))
    return painted
