"""Acts of people in scenes: enter, cross, leave, carry, embrace, hand over."""

from collections.abc import Callable

import numpy as np

from toolkit.body import skeleton
from toolkit.simulation.person import facing_of, mean_place, turned

ASIDE = 0.62
"""Metres outside the image border at which a person is out of view."""
APART, EMBRACED, WITHIN_REACH = 1.1, 0.42, 0.95
"""Metres between the roots of two people before they meet, while they embrace, and while they hand over."""
ARMS: dict[str, dict[str, float]] = {
    "box": {"shoulder_rz": -1.25, "shoulder_ry": -0.25, "elbow_ry": -1.5},
    "tablet": {"shoulder_rz": -1.15, "shoulder_ry": -0.45, "elbow_ry": -1.85},
    "bag": {"shoulder_rz": -1.4, "shoulder_ry": 0.0, "elbow_ry": -0.1},
    "hug": {"shoulder_rz": -0.35, "shoulder_ry": -1.15, "elbow_ry": -0.95},
    "give": {"shoulder_rz": -0.75, "shoulder_ry": -0.9, "elbow_ry": -0.7},
}
"""Angles of the left arm, radians; those of the right arm are their mirror image."""


def with_arms(poses: np.ndarray, arms: str, share: np.ndarray | float = 1.0) -> np.ndarray:
    """Return poses (T, P) with arms blended towards `ARMS` by a `share` in [0, 1] of each frame; a bag is in the left
    hand.
    """
    out, share = poses.copy(), np.broadcast_to(share, len(poses))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        if arms == "bag" and side == "right":
            continue
        for number, name in enumerate(skeleton.POSE_NAMES):
            joint, _, axis = name.removeprefix(f"{side}_").rpartition("_r")
            if name.startswith(side) and joint in ("clavicle", "shoulder", "elbow", "wrist"):
                wanted = sign * ARMS[arms].get(f"{joint}_r{axis}", 0.0)
                out[:, number] = (1.0 - share) * out[:, number] + share * wanted
    return out


def travelled(poses: np.ndarray, places: np.ndarray, yaws: np.ndarray) -> np.ndarray:
    """Return poses (T, P) of a motion on the spot moved to places (T, 2), x and z in metres, facing yaws (T,),
    radians.
    """
    ground = np.stack([places[:, 0], np.zeros(len(places)), places[:, 1]], axis=1)
    return turned(poses, (yaws - facing_of(poses[0]))[:, None], mean_place(poses), ground)


def out_of_sight(side: float, z: float, distance: float, slope: float) -> np.ndarray:
    """Return a place (2,) out of view on a side (-1 left, 1 right), for a camera with half the view's `slope`."""
    return np.array([side * (slope * (distance - z) + ASIDE), z])


def path_of(kind: str, at: tuple[float, float], far: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Return places (T, 2) and yaws (T,) of a person who "crosses" from `far` to the other side, "comes" or "visits"
    `at`.
    """
    t, here = np.linspace(0.0, 1.0, frames), np.asarray(at)
    share = PATHS[kind](t)[:, None]
    places = far + share * (np.where(kind == "crosses", far * [-1, 1], here) - far)
    heading = np.gradient(places, axis=0)
    ahead = np.arctan2(heading[:, 0], heading[:, 1])
    walks = np.hypot(*heading.T) > 1e-4
    if kind == "crosses":
        return places, ahead
    # facing the camera while standing; turns take a quarter of a second
    unturned = np.unwrap(np.where(walks, ahead, 0.0))
    kernel = np.ones(9) / 9.0
    return places, np.convolve(np.pad(unturned, 4, mode="edge"), kernel, mode="valid")


def _comes(t: np.ndarray) -> np.ndarray:
    return np.clip(t / 0.45, 0.0, 1.0)


def _visits(t: np.ndarray) -> np.ndarray:
    return np.clip(np.minimum(t, 1.0 - t) / 0.36, 0.0, 1.0)


PATHS: dict[str, Callable[[np.ndarray], np.ndarray]] = {"crosses": lambda t: t, "comes": _comes, "visits": _visits}
"""Fraction of the path covered at a fraction of the time."""


def meeting(kind: str, side: float, at: tuple[float, float], poses: np.ndarray) -> np.ndarray:
    """Return poses (T, P) of one of two people who meet at a place and part again.

    kind : "hug" or "give", in which the one at the left (`side` -1) has something in both hands until the middle and
        the other from then on
    """
    t = np.linspace(0.0, 1.0, len(poses))
    near = np.clip(np.minimum(t, 1.0 - t) / 0.3, 0.0, 1.0)
    near = near * near * (3.0 - 2.0 * near)
    reach = EMBRACED if kind == "hug" else WITHIN_REACH
    gap = (APART if kind == "hug" else WITHIN_REACH + 0.3) * (1.0 - near) + reach * near
    places = np.stack([at[0] + 0.5 * side * gap, np.full(len(t), at[1])], axis=1)
    if kind == "hug":
        arms = with_arms(poses, "hug", near)
    else:
        holds = t < 0.5 if side < 0 else t >= 0.5
        arms = with_arms(poses, "give", np.where(holds, 1.0, near))
    return travelled(arms, places, np.full(len(t), -side * 0.5 * np.pi))
