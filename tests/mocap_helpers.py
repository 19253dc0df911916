"""A body of joints with the smallest possible mesh, and small mocap files, for the mocap tests."""

from dataclasses import replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.mocap.clip import Clip

LEFT_REST = {
    "clavicle": (0.03, 0.42, 0.0),
    "shoulder": (0.18, 0.46, -0.02),
    "elbow": (0.46, 0.455, -0.035),
    "wrist": (0.71, 0.455, 0.0),
    "hip": (0.09, 0.0, 0.0),
    "knee": (0.10, -0.42, 0.02),
    "ankle": (0.11, -0.84, -0.02),
}
SPINE_REST = {
    "root": (0.0, 0.0, 0.0),
    "lumbar": (0.0, 0.1, -0.02),
    "thorax": (0.0, 0.25, -0.02),
    "cervical": (0.0, 0.5, -0.01),
}
SITES_REST = {
    "head": (0.0, 0.66, 0.02),
    "left_hand": (0.80, 0.45, 0.01),
    "right_hand": (-0.80, 0.45, 0.01),
    "left_foot": (0.13, -0.89, 0.12),
    "right_foot": (-0.13, -0.89, 0.12),
}


def stick_body() -> Body:
    """Return an adult whose mesh is two triangles at each end effector: enough for joints, sites and tips."""
    rest = dict(SPINE_REST)
    for name, (x, y, z) in LEFT_REST.items():
        rest[f"left_{name}"] = (x, y, z)
        rest[f"right_{name}"] = (-x, y, z)
    joints = np.array([rest[name] for name in skeleton.JOINT_NAMES])
    sites = np.array([SITES_REST[name] for name, _ in skeleton.SITES])
    tips = [SITES_REST[name] for name in skeleton.END_EFFECTORS]
    carriers = {name: skeleton.JOINT_NAMES.index(parent) for name, parent in skeleton.SITES}
    vertices = np.array([np.add(tip, step) for tip in tips for step in 0.01 * np.vstack([np.zeros(3), np.eye(3)])])
    faces = np.array(
        [[4 * i + a for a in face] for i in range(5) for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
    )
    skin = np.repeat([carriers[name] for name in skeleton.END_EFFECTORS], 4)[:, None]
    return Body(
        name="stick",
        vertices=vertices,
        faces=faces.astype(np.int32),
        skin_joints=skin.astype(np.int64),
        skin_weights=np.ones((len(vertices), 1)),
        joints=joints,
        sites=sites,
        end_effectors=np.arange(5, dtype=np.int64) * 4,
        shape=np.zeros(0),
    )


BVH_TWO_BONES = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 90 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0 80 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
0 90 0 0 0 0 0 0 0
1 91 2 10 20 30 40 50 60
"""

ASF_ARM = """:version 1.10
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name upper
     direction 0.1 0.9 0.3
     length 15
     axis 10 -20 30 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name fore
     direction 0.2 1 0
     length 14
     axis -90 15 20 ZYX
    dof rz rx
  end
  begin
     id 3
     name hand
     direction 1 0 0
     length 3
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root upper
    upper fore
    fore hand
  end
"""

AMC_ARM = """#!OML:ASF arm
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
upper 5 -15 25
fore 40 2.5e-015
2
root 1.5 2.5 3.5 -10 -20 400
upper 15 -5 45
fore 20 70
"""


def renamed(clip: Clip, names: dict[str, str], tips: dict[str, str]) -> Clip:
    """Return the clip with other joint names, and an additional joint at the end site of each joint (old name) in
    `tips`.
    """
    parents, offsets, joints = list(clip.parents), list(clip.offsets), [names[name] for name in clip.joint_names]
    ends = {names[joint]: tip for joint, tip in clip.end_sites.items()}
    for carrier, tip in tips.items():
        parents.append(clip.index(carrier))
        offsets.append(ends.pop(names[carrier]))
        joints.append(tip)
    extra = np.broadcast_to(np.eye(3), (len(clip), len(tips), 3, 3))
    return replace(
        clip,
        joint_names=tuple(joints),
        parents=np.array(parents),
        offsets=np.array(offsets),
        rotations=np.concatenate([clip.rotations, extra], axis=1),
        end_sites=ends,
    )


def with_rest_pose(clip: Clip, world_at_rest: np.ndarray) -> Clip:
    """Return the same motion on a skeleton whose rest pose has the joints rotated by `world_at_rest` (J, 3, 3)."""
    _, world = clip.world()
    turned = world @ np.swapaxes(world_at_rest, -1, -2)
    local, offsets = turned.copy(), clip.offsets.copy()
    for j, parent in enumerate(clip.parents):
        if parent >= 0:
            local[:, j] = np.swapaxes(turned[:, parent], -1, -2) @ turned[:, j]
            offsets[j] = world_at_rest[parent] @ clip.offsets[j]
    ends = {joint: world_at_rest[clip.index(joint)] @ tip for joint, tip in clip.end_sites.items()}
    return replace(clip, rotations=local, offsets=offsets, end_sites=ends)


def in_world(clip: Clip, turn: np.ndarray) -> Clip:
    """Return the same motion and rest pose in a file whose axes are rotated by `turn` (3, 3)."""
    return replace(
        clip,
        rotations=turn @ clip.rotations @ turn.T,
        offsets=clip.offsets @ turn.T,
        root_positions=clip.root_positions @ turn.T,
        end_sites={joint: turn @ tip for joint, tip in clip.end_sites.items()},
    )
