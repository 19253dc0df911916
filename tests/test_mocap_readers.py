"""BVH, ASF/AMC and AMASS readers against independent references, and errors for broken files."""

import math
from pathlib import Path

import numpy as np
import pybvh
import pytest

from database_builder.build import Sampling, build_database
from tests.database_helpers import moving_clip, neutral
from tests.mocap_helpers import AMC_ARM, ASF_ARM, BVH_TWO_BONES
from tests.support.amass import write_amass
from toolkit.io.errors import MocapError
from toolkit.mocap.amass import is_amass, read_amass
from toolkit.mocap.asf_amc import find_asf
from toolkit.mocap.bvh import read_bvh
from toolkit.mocap.file_skeleton import CMU_UNIT
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget
from toolkit.retrieval.features.relational import FEATURES
from toolkit.retrieval.workflow.index import index_motions


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def random_bvh(path: Path, rng: np.random.Generator, moving: tuple[int, ...] = (), frames: int = 7) -> Path:
    """Return a tree of 9 joints with a rotation order each; the root and the joints in `moving` have position
    channels.
    """
    parents = [-1, 0, 1, 1, 0, 4, 5, 0, 7]
    orders = [rng.permutation(list("XYZ")) for _ in parents]

    def joint(j: int, depth: int) -> list[str]:
        pad = "  " * depth
        offset = np.zeros(3) if j == 0 else rng.normal(size=3) * 25.0
        channels = [f"{axis}rotation" for axis in orders[j]]
        if j in (0, *moving):
            channels = ["Xposition", "Yposition", "Zposition", *channels]
        children = [c for c, p in enumerate(parents) if p == j]
        lines = [f"{'ROOT' if j == 0 else 'JOINT'} joint{j}", "{", "OFFSET " + " ".join(f"{v:.6f}" for v in offset)]
        lines.append(f"CHANNELS {len(channels)} {' '.join(channels)}")
        for child in children:
            lines += joint(child, depth + 1)
        if not children:
            lines += ["End Site", "{", "OFFSET 0 10 0", "}"]
        return [pad + line for line in (*lines, "}")]

    columns = 3 * (len(parents) + 1 + len(moving))
    rows = [" ".join(f"{v:.6f}" for v in rng.uniform(-180.0, 180.0, columns)) for _ in range(frames)]
    header = ["MOTION", f"Frames: {frames}", "Frame Time: 0.0333333"]
    return write(path, "\n".join(["HIERARCHY", *joint(0, 0), *header, *rows]) + "\n")


@pytest.mark.parametrize("seed", range(4))
def test_joint_positions_of_any_rotation_order_agree_with_pybvh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    monkeypatch.setattr("toolkit.mocap.bvh.metres_per_unit", lambda size, name: 0.01)
    path = random_bvh(tmp_path / "any.bvh", np.random.default_rng(seed))
    clip = read_bvh(path)
    oracle = pybvh.read_bvh_file(path)
    names = [node.name for node in oracle.nodes]
    expected = oracle.node_positions()[:, [names.index(name) for name in clip.joint_names]] * 0.01
    np.testing.assert_allclose(clip.world()[0], expected, atol=1e-9)
    assert clip.frame_rate == pytest.approx(30.0)
    assert set(clip.end_sites) == {"joint2", "joint3", "joint6", "joint8"}


def test_position_channels_of_an_inner_joint_replace_its_offset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("toolkit.mocap.bvh.metres_per_unit", lambda size, name: 0.01)
    path = random_bvh(tmp_path / "moving.bvh", np.random.default_rng(7), moving=(5,))
    clip = read_bvh(path)
    positions, rotations = clip.world()
    rows = np.loadtxt(path.read_text().split("Frame Time: 0.0333333\n")[1].splitlines())
    order = [0, 1, 2, 3, 4, 5, 6, 7, 8]
    assert clip.joint_names == tuple(f"joint{j}" for j in order)
    written = rows[:, 6 + 4 * 3 : 6 + 4 * 3 + 3] * 0.01  # joint5 follows joints 1 to 4
    local = np.einsum("tba,tb->ta", rotations[:, 4], positions[:, 5] - positions[:, 4])
    np.testing.assert_allclose(local, written, atol=1e-9)
    still = np.einsum("tba,tb->ta", rotations[:, 5], positions[:, 6] - positions[:, 5])
    np.testing.assert_allclose(still, np.broadcast_to(clip.offsets[6], still.shape), atol=1e-9)


@pytest.mark.data("cmu-mocap")
def test_cmu_clips_agree_with_pybvh(data_folder: Path) -> None:
    for path in find_clips(data_folder / "mocap" / "cmu")[::17]:
        clip, oracle = read_clip(path), pybvh.read_bvh_file(path)
        names = [node.name for node in oracle.nodes]
        expected = oracle.node_positions()[:, [names.index(name) for name in clip.joint_names]] * CMU_UNIT
        np.testing.assert_allclose(clip.world()[0], expected, atol=1e-9)
        assert clip.frame_rate == pytest.approx(120.0)


def axis_matrix(axis: str, degrees: float) -> np.ndarray:
    """Return one textbook rotation, for the reference below."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def acclaim_starts(asf: str, amc: str, frame: int) -> dict[str, np.ndarray]:
    """Return the start of each bone in one frame, file units: Acclaim's definition with 4x4 matrices, bone by bone."""
    bones: dict[str, tuple[np.ndarray, np.ndarray, list[str]]] = {}
    bone_text = asf[asf.index(":bonedata") : asf.index(":hierarchy")]
    for block in bone_text.split("begin")[1:]:
        field = {line.split()[0]: line.split()[1:] for line in block.splitlines() if line.strip()}
        vector = np.array([float(v) for v in field["direction"]])
        vector *= float(field["length"][0]) / np.linalg.norm(vector)
        frame_matrix = np.eye(3)
        order = field["axis"][3].lower()
        for axis, degrees in zip(order, field["axis"][:3], strict=True):
            frame_matrix = axis_matrix(axis, float(degrees)) @ frame_matrix
        bones[field["name"][0]] = (vector, frame_matrix, field.get("dof", []))
    lines = amc.splitlines()
    first = next(i for i, line in enumerate(lines) if line.strip() == str(frame))
    moves: dict[str, list[float]] = {}
    for line in lines[first + 1 :]:
        if len(line.split()) == 1:
            break
        moves[line.split()[0]] = [float(v) for v in line.split()[1:]]
    transform = np.eye(4)
    transform[:3, 3] = moves["root"][:3]
    for axis, degrees in zip("zyx", moves["root"][:2:-1], strict=True):
        transform[:3, :3] = transform[:3, :3] @ axis_matrix(axis, degrees)
    starts = {"root": transform[:3, 3]}
    ends = {"root": transform}
    for line in asf[asf.index(":hierarchy") :].splitlines():
        parent, *children = line.split() or [""]
        for child in children if parent in ends else []:
            vector, own, dofs = bones[child]
            motion = np.eye(3)
            for dof, degrees in zip(dofs, moves.get(child, []), strict=True):
                motion = axis_matrix(dof[1], degrees) @ motion
            step = np.eye(4)
            step[:3, :3] = own @ motion @ np.linalg.inv(own)
            placed = ends[parent] @ step
            starts[child] = placed[:3, 3]
            placed = placed.copy()
            placed[:3, 3] += placed[:3, :3] @ vector
            ends[child] = placed
    return starts


def test_acclaim_bones_with_own_axes_and_few_degrees_of_freedom_agree_with_the_definition(tmp_path: Path) -> None:
    write(tmp_path / "arm.asf", ASF_ARM)
    clip = read_clip(write(tmp_path / "arm_01.amc", AMC_ARM))
    positions, _ = clip.world()
    for frame in (1, 2):
        for bone, start in acclaim_starts(ASF_ARM, AMC_ARM, frame).items():
            np.testing.assert_allclose(positions[frame - 1, clip.index(bone)], start * CMU_UNIT, atol=1e-9)


@pytest.mark.data("hdm05")
def test_hdm05_clips_agree_with_the_definition(data_folder: Path) -> None:
    for path in find_clips(data_folder / "mocap" / "hdm05")[::60]:
        clip = read_clip(path)
        positions, _ = clip.world()
        asf, amc = (p.read_text(encoding="latin-1") for p in (find_asf(path), path))
        for frame in (1, len(clip) // 2, len(clip)):
            for bone, start in acclaim_starts(asf, amc, frame).items():
                np.testing.assert_allclose(positions[frame - 1, clip.index(bone)], start * CMU_UNIT, atol=1e-9)
        assert clip.frame_rate == 120.0


@pytest.mark.parametrize(
    ("factor", "unit"), [(1.0, 0.01), (0.01, 1.0), (10.0, 0.001), (1 / 2.54, 0.0254), (0.01 / CMU_UNIT, CMU_UNIT)]
)
def test_the_unit_of_a_person_is_guessed(tmp_path: Path, factor: float, unit: float) -> None:
    text = BVH_TWO_BONES.replace("0 90 0\n", f"0 {90 * factor} 0\n").replace("0 80 0\n", f"0 {80 * factor} 0\n")
    clip = read_bvh(write(tmp_path / "person.bvh", text))
    assert clip.offsets[1, 1] == pytest.approx(0.9, rel=1e-6)
    assert clip.root_positions[1, 0] == pytest.approx(unit)


BROKEN_BVH = {
    "is empty": "  \n",
    "does not begin with HIERARCHY": "hello",
    "no MOTION section": BVH_TWO_BONES.split("MOTION")[0],
    "broken MOTION header": BVH_TWO_BONES.split("Frame Time")[0],
    "announces 3 frames": BVH_TWO_BONES.replace("Frames: 2", "Frames: 3"),
    "but holds 17 numbers": BVH_TWO_BONES.replace(" 50 60\n", " 50\n"),
    "columns in its first frame": BVH_TWO_BONES.replace("0 0 0 0 0 0\n1 91 2", "0 0 0\n0 0 0 1 91 2"),
    "not finite in frame 1": BVH_TWO_BONES.replace("40 50 60", "nan 50 60"),
    "text among its frames": BVH_TWO_BONES.replace("40 50 60", "forty 50 60"),
    "has no frames": BVH_TWO_BONES.split("0.0333333")[0].replace("Frames: 2", "Frames: 0") + "0.03\n",
    "frame time 0.0": BVH_TWO_BONES.replace("0.0333333", "0"),
    "unknown channel 'Wrotation'": BVH_TWO_BONES.replace("3 Zrotation", "3 Wrotation"),
    "unknown word 'OFFSAT'": BVH_TWO_BONES.replace("OFFSET 0 90", "OFFSAT 0 90"),
    "joint 'Hips' twice": BVH_TWO_BONES.replace("JOINT Spine", "JOINT Hips"),
    "twice about one axis": BVH_TWO_BONES.replace("3 Zrotation Yrotation", "3 Zrotation Zrotation"),
    "unclosed braces": BVH_TWO_BONES.replace("}\nMOTION", "MOTION"),
}


@pytest.mark.parametrize("message", BROKEN_BVH)
def test_a_broken_bvh_file_is_named_with_its_fault(tmp_path: Path, message: str) -> None:
    path = write(tmp_path / "broken.bvh", BROKEN_BVH[message])
    with pytest.raises(MocapError, match=message) as caught:
        read_bvh(path)
    assert "broken.bvh" in str(caught.value)


def test_files_that_hold_no_motion_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MocapError, match="check the path"):
        read_clip(tmp_path / "absent.bvh")
    with pytest.raises(MocapError, match="neither BVH nor AMC"):
        read_clip(write(tmp_path / "note.txt", "hello"))
    with pytest.raises(MocapError, match="skeleton without motion"):
        read_clip(write(tmp_path / "arm.asf", ASF_ARM))
    with pytest.raises(MocapError, match="is empty"):
        read_clip(write(tmp_path / "empty.bvh", ""))


def test_motion_files_are_found_in_order_and_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    for name in ("z.bvh", "b/a.AMC", "arm.asf", "a.bvh", "notes.md"):
        write(tmp_path / name, "x")
    found = find_clips(tmp_path)
    assert [p.relative_to(tmp_path).as_posix() for p in found] == ["a.bvh", "b/a.AMC", "z.bvh"]
    assert find_clips(tmp_path / "z.bvh") == [tmp_path / "z.bvh"]
    (tmp_path / "none").mkdir()
    with pytest.raises(MocapError, match="no motion file"):
        find_clips(tmp_path / "none")
    with pytest.raises(MocapError, match="there is no folder"):
        find_clips(tmp_path / "absent")


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 3 Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0 1.7 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 0.1 0
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.1
0 0 0 0 0 0
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "OFFSET 0 0.1 0\n",
            "OFFSET 0 0.1 0\n      CHANNELS 3 Zrotation Xrotation Yrotation\n",
            "End Site has channels",
        ),
        ("OFFSET 0 1.7 0", "OFFSET 0 0 0", "fits no usual unit"),
        ("\n0 0 0 0 0 0", "\n0 1e308 0 0 0 0", "not a joint angle"),
        ("CHANNELS 3 Z", "CHANNELS 4 Xposition Z", "fits|columns"),
    ],
)
def test_a_bvh_whose_numbers_cannot_be_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    (tmp_path / "a.bvh").write_text(BVH)
    assert read_bvh(tmp_path / "a.bvh").joint_names == ("Hips", "Chest")
    (tmp_path / "a.bvh").write_text(BVH.replace(old, new, 1))
    with pytest.raises(MocapError, match=words):
        read_bvh(tmp_path / "a.bvh")


def test_a_motion_goes_there_and_back(tmp_path: Path) -> None:
    clip = moving_clip("walk", seed=3)
    path = write_amass(tmp_path / "walk.npz", clip)
    assert is_amass(path) and find_clips(tmp_path) == [path]
    read = read_clip(path)
    assert read.frame_rate == 30.0 and read.name == "walk"
    back = retarget(read, neutral())
    joints, wanted = (neutral().joint_positions(poses) for poses in (back.poses, clip.poses))
    shift = wanted[:, :1] - joints[:, :1]
    np.testing.assert_allclose(shift, np.broadcast_to(shift[:1], shift.shape), atol=1e-6)
    error = np.linalg.norm(joints + shift - wanted, axis=2)
    assert np.median(error) < 0.005 and np.quantile(error, 0.95) < 0.05, "what the limbs' twist leaves"


def test_joints_of_smpl_x_are_read_from_their_parts(tmp_path: Path) -> None:
    clip = moving_clip("walk", seed=3)
    whole = read_amass(write_amass(tmp_path / "a.npz", clip))
    poses = np.load(tmp_path / "a.npz")["poses"]
    parts = {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "poses": None}
    again = read_amass(
        write_amass(tmp_path / "b.npz", clip, **parts, mocap_framerate=None, mocap_frame_rate=np.array(30.0))
    )
    np.testing.assert_array_equal(again.rotations, whole.rotations)


def test_a_motion_is_a_clip_like_any_other_for_database_and_retrieval(tmp_path: Path) -> None:
    path = write_amass(tmp_path / "walk.npz", moving_clip("walk", seed=3))
    database = build_database(
        [tmp_path], tmp_path / "out" / "poses.npz", Sampling(0.02, seated=False), workers=1
    ).database
    assert database.sources == ("walk.npz",) and len(database) > 5
    index = index_motions([path], tmp_path / "out" / "motions.index")
    assert index.frames == 60 and len(FEATURES) == 40


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"poses": np.zeros((60, 60))}, "66 numbers"),
        ({"poses": np.full((60, 156), np.nan)}, "not finite"),
        ({"poses": np.zeros((60, 156), complex)}, "complex"),
        ({"poses": np.zeros((59, 156))}, "shape"),
        ({"trans": np.zeros((60, 2))}, "shape"),
        ({"trans": np.full((60, 3), 1e9)}, "outside"),
        ({"mocap_framerate": None}, "lacks"),
        ({"mocap_framerate": np.array("fast")}, "must be numbers"),
        ({"mocap_framerate": np.array(0.0)}, "outside"),
        ({"poses": None}, "lacks"),
    ],
)
def test_what_is_no_motion_is_named(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    path = write_amass(tmp_path / "walk.npz", moving_clip("walk", seed=3), **changes)
    with pytest.raises(MocapError, match=words):
        read_clip(path)
