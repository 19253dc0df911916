"""Motion capture that can be read but is not as intended; skeletons of other systems by joint names."""

import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from toolkit.body.shape import load_body
from toolkit.io.errors import MocapError, PlausibilityWarning
from toolkit.mocap.bvh import read_bvh
from toolkit.mocap.clip import Clip
from toolkit.mocap.plausibility import check_clip
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.mocap.rig import KEYS, load_rig

PLACES = {
    "root": (0, 1, 0), "lumbar": (0, 1.1, 0), "thorax": (0, 1.25, 0), "cervical": (0, 1.5, 0), "head": (0, 1.65, 0),
    "clavicle": (0.03, 1.4, 0), "shoulder": (0.18, 1.45, 0), "elbow": (0.46, 1.45, 0), "wrist": (0.7, 1.45, 0),
    "hip": (0.09, 1, 0), "knee": (0.1, 0.6, 0), "ankle": (0.1, 0.1, 0), "foot": (0.1, 0.05, 0.15),
}  # fmt: skip
CHAINS = (("clavicle", "shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "foot"))


def clip_of(names: dict[str, str], frames: int = 20) -> Clip:
    """Return a person who bends the left elbow and knee and moves ahead, with the joint names of a rig."""
    keys: list[tuple[str, int, np.ndarray]] = []
    for key in ("root", "lumbar", "thorax", "cervical", "head"):
        keys.append((key, len(keys) - 1, np.array(PLACES[key], dtype=float)))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for chain, start in zip(CHAINS, (2, 0), strict=True):
            parent = start
            for part in chain:
                if f"{side}_{part}" in names:
                    keys.append((f"{side}_{part}", parent, np.array(PLACES[part]) * (sign, 1.0, 1.0)))
                    parent = len(keys) - 1
    rotations = np.broadcast_to(np.eye(3), (frames, len(keys), 3, 3)).copy()
    bent = [k for k, (key, _, _) in enumerate(keys) if key in ("left_elbow", "left_knee")]
    for t in range(frames):
        c, s = np.cos(0.05 * t), np.sin(0.05 * t)
        rotations[t, bent] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    return Clip(
        name="take",
        joint_names=tuple(names[key] for key, _, _ in keys),
        parents=np.array([parent for _, parent, _ in keys]),
        offsets=np.array([place - (keys[parent][2] if parent >= 0 else 0.0) for _, parent, place in keys]),
        rotations=rotations,
        root_positions=np.array([[0.0, 1.0, 0.01 * t] for t in range(frames)]),
        frame_rate=30.0,
    )


TRUNK = ("root", "lumbar", "thorax", "cervical", "head")
LIMBS = ("clavicle", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "foot")


def rig(trunk: str, limbs: str, sides: tuple[str, str] = ("Left", "Right")) -> dict[str, str]:
    """Return joint names by key; `{}` in the names of the limbs is the side."""
    found = dict(zip(TRUNK, trunk.split(), strict=True))
    for side, word in zip(("left", "right"), sides, strict=True):
        found |= {f"{side}_{part}": name.format(word) for part, name in zip(LIMBS, limbs.split(), strict=True)}
    return found


BIPED = rig(
    "Bip01_Pelvis Bip01_Spine Bip01_Spine2 Bip01_Neck Bip01_Head",
    "Bip01_{}_Clavicle Bip01_{}_UpperArm Bip01_{}_Forearm Bip01_{}_Hand "
    "Bip01_{}_Thigh Bip01_{}_Calf Bip01_{}_Foot Bip01_{}_Toe0", ("L", "R"),
)  # fmt: skip
XSENS = rig("Pelvis L3 T8 Neck Head", "{}Shoulder {}UpperArm {}ForeArm {}Hand {}UpperLeg {}LowerLeg {}Foot {}Toe")
ROKOKO = rig("Hips Spine1 Spine4 Neck Head", "{}Shoulder {}Arm {}ForeArm {}Hand {}Thigh {}Shin {}Foot {}Toe")
VICON = rig(
    "pelvis lowerback thorax neck head",
    "{}clavicle {}humerus {}radius {}hand {}femur {}tibia {}foot {}toes",
    ("l", "r"),
)
SYSTEMS = {"biped": BIPED, "xsens": XSENS, "rokoko": ROKOKO, "vicon": VICON}


@pytest.mark.parametrize("system", SYSTEMS)
def test_skeletons_of_other_systems_have_a_joint_map(system: str) -> None:
    clip = clip_of(SYSTEMS[system])
    joints = load_rig(clip).joints
    assert {key: name for key, name in joints.items() if key in SYSTEMS[system]} == SYSTEMS[system]
    assert set(joints) <= set(KEYS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert check_clip(clip) is clip


@pytest.mark.parametrize("rate", [0.03, 4.0, 1200.0])
def test_a_frame_time_in_milliseconds_is_refused(rate: float) -> None:
    with pytest.raises(MocapError, match="write the frame time in seconds, not milliseconds"):
        check_clip(replace(clip_of(BIPED), frame_rate=rate))


def test_a_file_is_checked_when_it_is_read(tmp_path: Path) -> None:
    from tests.mocap_helpers import BVH_TWO_BONES

    (tmp_path / "a.bvh").write_text(BVH_TWO_BONES.replace("Frame Time: 0.0333333", "Frame Time: 33.3333"))
    with pytest.raises(MocapError, match="0.03 frames a second"):
        read_clip(tmp_path / "a.bvh")


def test_radians_read_as_degrees_are_doubted() -> None:
    clip = clip_of(BIPED)
    still = np.broadcast_to(np.eye(3), clip.rotations.shape).copy()
    with pytest.warns(PlausibilityWarning, match="radians have to be given in degrees"):
        check_clip(replace(clip, rotations=still))


@pytest.mark.parametrize("rate", [5.0, 24.0, 1000.0])
def test_rates_of_motion_capture_are_read(rate: float) -> None:
    assert check_clip(replace(clip_of(BIPED), frame_rate=rate)).frame_rate == rate


def test_angles_beyond_the_limits_of_the_body_in_most_frames_are_doubted() -> None:
    clip = clip_of(BIPED)
    clip = replace(clip, rotations=np.broadcast_to(np.eye(3), clip.rotations.shape))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        retarget(clip, load_body("neutral"))
    turned = clip.rotations.copy()
    turned[:, clip.joint_names.index("Bip01_Head")] = [[-1, 0, 0], [0, 1, 0], [0, 0, -1]]  # the face is at the back
    with pytest.warns(PlausibilityWarning, match=r"limits of the body in most frames \(cervical_ry 100 %"):
        retarget(replace(clip, rotations=turned), load_body("neutral"))


def test_a_root_without_channels_is_doubted() -> None:
    clip = clip_of(BIPED)
    with pytest.warns(PlausibilityWarning, match="the root stays in one place"):
        check_clip(replace(clip, root_positions=np.tile(clip.root_positions[:1], (len(clip), 1))))


@pytest.mark.parametrize("how", ["names", "scale"])
def test_exchanged_sides_and_a_negative_scale_are_doubted(how: str) -> None:
    clip = clip_of(XSENS)
    if how == "names":
        swap = {"Left": "Right", "Right": "Left"}
        names = tuple(
            next((swap[side] + name[len(side) :] for side in swap if name.startswith(side)), name)
            for name in clip.joint_names
        )
        wrong = replace(clip, joint_names=names)
    else:
        wrong = replace(clip, offsets=-clip.offsets)
    with pytest.warns(PlausibilityWarning, match="left and right exchanged, or is mirrored by a negative scale"):
        check_clip(wrong)


def test_a_long_file_is_read_in_time_linear_in_its_joints(tmp_path: Path) -> None:
    def seconds(joints: int) -> float:
        head = ["HIERARCHY ROOT r { OFFSET 0 0 0 CHANNELS 1 Zrotation"]
        leaf = "OFFSET 0 1 0 CHANNELS 1 Zrotation End Site { OFFSET 0 1 0 } }"
        head += [f"JOINT j{i} {{ {leaf}" for i in range(joints)]
        row = " ".join(["0"] * (joints + 1))
        (tmp_path / "a.bvh").write_text("\n".join([*head, "}", "MOTION", "Frames: 1", "Frame Time: 0.03", row]))
        start = time.process_time()
        assert len(read_bvh(tmp_path / "a.bvh").joint_names) == joints + 1
        return time.process_time() - start

    seconds(100)  # imports and compiled kernels
    assert seconds(40_000) < 8 * max(seconds(10_000), 0.05)  # 4 is linear, 16 quadratic
