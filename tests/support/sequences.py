"""Four sequences as in Qammaz, 3.1: two men and two women in colour and depth who bend, do jumping jacks and twist.

All four do the same: 8 s of bends (CMU 02_06, where the mocap is, else bundled), 8 s of jumping jacks and 8 s of twists
(bundled, for want of free mocap of them), one after the other. Skin follows the joints by dual quaternions, which no
tracker does. They stand in a room whose empty depth is known.
"""

from pathlib import Path

from tests.support.dual_quaternions import dual_skinning
from tests.support.suite import RATE, cut, digest_of, has_mocap, in_place, motion_of
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.simulation.joining import joined
from toolkit.simulation.simulate import simulate_recording

SEQUENCES = {"MS_1": "athletic_male", "MS_2": "heavy_male", "FS_1": "slim_female", "FS_2": "average_female"}
"""Sequence -> subject; each subject has deformations outside the shape space."""
FRAMES = 720
MOTIONS = (("02_06", 5.0), ("bundled_jumping_jack", 0.0), ("bundled_twist", 0.0))
"""Motions, and skipped seconds of each."""
BENDS = "bundled_bend_forward"
"""Replacement of the first motion if there is no mocap."""
DISTANCE = 3.0
"""Distance from the camera, metres."""


def sequence_body(name: str) -> Body:
    """Return the subject of a sequence, before dressing."""
    return subject_body(SEQUENCES[name], seed=sorted(SEQUENCES).index(name))


def record_sequence(name: str, work: Path, frames: int = FRAMES, yaw: float = 0.0) -> Path:
    """Return a sequence as a recording of `frames` frames in colour and depth, in `work`; made if missing.

    The person stands turned by `yaw` degrees to the left, as in the view of another camera.
    """
    folders = ["toolkit/simulation", "toolkit/mocap", "toolkit/body"]
    digest = digest_of((performed, sequence_body, cut, in_place, motion_of), folders, name, frames)
    path = work / "recordings" / f"{name}_{f'{yaw:.0f}_' if yaw else ''}{digest}.npz"
    if not path.exists():
        body = sequence_body(name)
        simulate_recording(
            performed(body, frames), path, body=body, yaw=yaw, sensor="kinect", distance=DISTANCE, height=1.2,
            seed=sorted(SEQUENCES).index(name), color=True, skinning=dual_skinning,
        )  # fmt: skip
    return path


def performed(body: Body, frames: int) -> PoseClip:
    """Return the three motions on a body, one after the other, `frames` in all."""
    each, parts = -(-frames // len(MOTIONS)), []
    for motion, start in MOTIONS:
        chosen = motion if motion.startswith("bundled_") or has_mocap() else BENDS
        poses = motion_of(chosen, body).poses
        start = start if chosen == motion else 0.0
        parts.append(in_place(cut(poses, start, each, shortest=each)))
    return PoseClip("sequence", joined(parts)[0][:frames], RATE, "sequence")
