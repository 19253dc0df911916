"""AMASS motions: round trip through our body, and errors for other NPZ files."""

from pathlib import Path

import numpy as np
import pytest

from database_builder.build import Sampling, build_database
from tests.database_helpers import moving_clip, neutral
from tests.support.amass import write_amass
from toolkit.io.errors import MocapError
from toolkit.mocap.amass import is_amass, read_amass
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget
from toolkit.retrieval.features.relational import FEATURES
from toolkit.retrieval.workflow.index import index_motions


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
