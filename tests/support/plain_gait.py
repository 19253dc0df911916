"""Reference gait and rises without the project's analysis: from the plan of a motion, or from where feet stay.

A made motion (`tests.support.walking`) has its strides and durations in its plan. Of mocap a foot stands while its
lowest vertex stays where it is; a stride goes from one stand's place to the foot's next. Neither peaks
of the heel before the pelvis nor joint angles are used.
"""

import numpy as np

from tests.support.walking import Rising, Walk
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.spans import spans

ONSET = 0.05
"""Fraction of a rise at which it starts, and that is missing when it ends, by definition of the figure."""
STAYS = 0.5
"""Maximum speed of a standing foot's lowest vertex along the ground, m/s; a swinging one moves at several."""
SHORTEST = 0.25
"""Minimum duration of a stand in a walk, seconds."""


def planned_walk(walk: Walk) -> dict[str, float]:
    """Return the figures of a synthetic walk."""
    return {
        "stride_length_m": walk.speed * 120.0 / walk.cadence,
        "cadence_steps_per_min": walk.cadence,
        "speed_m_per_s": walk.speed,
        "step_width_m": walk.width,
        "stance_share": walk.stance,
        "stride_time_s": 120.0 / walk.cadence,
    }


def planned_rises(plan: Rising) -> list[tuple[float, float]]:
    """Return start and duration of each rise, seconds: half a cosine without its first and last fraction `ONSET`."""
    before = plan.duration * float(np.arccos(1.0 - 2.0 * ONSET)) / np.pi
    cycle = plan.stand + 2.0 * plan.duration + plan.rest
    first = plan.stand + plan.duration + plan.rest + before
    return [(k * cycle + first, plan.duration - 2.0 * before) for k in range(plan.count)]


def walk_on_ground(body: Body, poses: np.ndarray, rate: float) -> dict[str, float]:
    """Return the figures of a walk in true poses (T, P), y up, from the places of the feet's lowest vertices."""
    vertices = np.array([body.vertex_positions(pose) for pose in poses])
    ankles = [skeleton.REPORTED.index(f"{side}_ankle") for side in ("left", "right")]
    places = body.joint_positions(poses)[:, ankles][..., [0, 2]]
    stands = [
        _stands(vertices[:, body.part == skeleton.JOINT_NAMES.index(f"{name}_ankle")], places[:, side], rate)
        for side, name in enumerate(("left", "right"))
    ]
    lengths, times, widths = [], [], []
    for side in range(2):
        for (begin, here), (end, there) in zip(stands[side][:-1], stands[side][1:], strict=True):
            lengths.append(float(np.linalg.norm(there - here)))
            times.append(end - begin)
            across = np.array([there[1] - here[1], here[0] - there[0]]) / lengths[-1]
            widths += [abs(float((place - here) @ across)) for t, place in stands[1 - side] if begin < t < end]
    length, time = float(np.mean(lengths)), float(np.mean(times))
    return {
        "stride_length_m": length,
        "cadence_steps_per_min": 120.0 / time,
        "speed_m_per_s": length / time,
        "step_width_m": float(np.mean(widths)),
        "stride_time_s": time,
    }


def _stands(foot: np.ndarray, ankle: np.ndarray, rate: float) -> list[tuple[float, np.ndarray]]:
    """Return start, seconds, and the ankle's place of each stand of a foot (T, V, 3) after the first frame."""
    times = np.arange(1, len(foot))
    lowest = foot[1:, :, 1].argmin(axis=1)
    steps = (foot[times, lowest] - foot[times - 1, lowest])[:, [0, 2]]
    return [
        ((s.start + 1) / rate, np.median(ankle[s.start + 1 : s.stop + 1], axis=0))
        for s in spans(np.linalg.norm(steps, axis=1) * rate < STAYS)
        if s.start > 0 and (s.stop - s.start) / rate > SHORTEST
    ]
