"""Change values of the file at `path` and remove its checksum, as other programs write it; None removes a value."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.database_helpers import neutral, small_database
from tests.support.proportions import stretched
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.io.errors import DatabaseError

ARRAYS = ("poses", "joints", "features", "offsets", "pose_source", "pose_frame", "mirrored", "body_shape")


def changed(path: Path, **values: Any) -> Path:
    """Return the file at `path` with other values and no checksum, as other programs write it; None removes one."""
    with np.load(path) as archive:
        data = {**{name: archive[name] for name in archive.files}, "checksum": None, **values}
    np.savez(path, **{name: value for name, value in data.items() if value is not None})
    return path


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "poses.npz"
    small_database().save(path)
    return path


def test_a_database_read_back_equals_the_one_written(saved: Path) -> None:
    original, read = small_database(), PoseDatabase.load(saved)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(read, name), getattr(original, name))
        assert getattr(read, name).dtype == getattr(original, name).dtype
    for name in ("sources", "hashes", "threshold", "body_name", "body_scale", "torso_length", "notes"):
        assert getattr(read, name) == getattr(original, name)
    assert [p.name for p in saved.parent.iterdir()] == ["poses.npz"]


def test_a_database_of_a_body_that_is_no_named_one_is_not_stored(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match="cannot be stored"):
        small_database().for_body(stretched(neutral(), {"shoulder": 1.2})).save(tmp_path / "poses.npz")


def test_a_database_file_needs_no_pickle(saved: Path) -> None:
    with np.load(saved, allow_pickle=False) as archive:
        assert all(archive[name].dtype != object for name in archive.files)
        assert archive["joint_names"].tolist()[0] == "pelvis" and len(archive["pose_names"]) == 43


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"fingerprint": "0123456789abcdef"}, "another body"),
        ({"format_version": 99}, "format version 99, this program reads 2; "),
        ({"format": "something"}, "not a pose database"),
        ({"offsets": None}, "lacks offsets"),
        ({"offsets": np.zeros((3, 4), np.float16)}, "has shape"),
        ({"poses": np.full((200, 43), np.nan, np.float16)}, "not finite"),
        ({"body_shape": np.zeros(99)}, "has shape"),
        ({"notes": "{"}, "no JSON"),
        ({"notes": "[" * 100_000}, "no JSON"),
        ({"notes": '{"a": NaN}'}, "no JSON"),
        ({"notes": "[1]"}, "must be names with values"),
        ({"notes": '{"skipped": 3}'}, "skipped is 3; it must be a list"),
        ({"format_version": "new"}, "format version new"),
        ({"format_version": np.ones(3)}, "format version"),
        ({"torso_length": 0.0}, "outside 0.05"),
        ({"torso_length": "long"}, "must be numbers"),
        ({"threshold": np.nan}, "not finite"),
        ({"body_scale": 1e30}, "outside"),
        ({"poses": np.full((200, 43), 1e30, np.float32)}, "outside"),
        ({"poses": np.zeros((200, 43), np.complex64)}, "complex64"),
        ({"poses": np.full((200, 43), "1.0")}, "must be numbers"),
        ({"pose_source": np.full(200, 1, np.int32)}, "outside 0 to 0"),
        ({"pose_frame": np.full(200, -1, np.int32)}, "outside 0"),
        ({"mirrored": np.zeros(200)}, "truth values"),
        ({"sources": np.array(3.0)}, "text"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_the_reason(saved: Path, values: dict[str, Any], words: str) -> None:
    with pytest.raises(DatabaseError, match=words):
        PoseDatabase.load(changed(saved, **values))


def test_a_file_of_an_earlier_version_with_a_regression_forest_is_read_without_it(saved: Path) -> None:
    plain = PoseDatabase.load(saved)
    old = PoseDatabase.load(changed(saved, forest_roots=np.zeros(3, np.int32)))
    assert np.array_equal(old.poses, plain.poses)


def test_a_value_changed_behind_the_checksum_is_noticed(saved: Path) -> None:
    with np.load(saved) as archive:
        data = {name: archive[name] for name in archive.files}
    data["offsets"][7, 3] += 0.01
    np.savez(saved, **data)
    with pytest.raises(DatabaseError, match="checksum"):
        PoseDatabase.load(saved)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.95, 0.999])
def test_a_truncated_file_is_refused(saved: Path, share: float) -> None:
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    with pytest.raises(DatabaseError, match="build it again"):
        PoseDatabase.load(saved)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match="no pose database .*nothing.npz"):
        PoseDatabase.load(tmp_path / "nothing.npz")


def test_another_body_gets_its_own_joints_and_features() -> None:
    database, child = small_database(), load_body("child")
    theirs = database.for_body(child)
    np.testing.assert_allclose(theirs.joints, child.joint_positions(database.poses), atol=1e-5)
    np.testing.assert_array_equal(theirs.poses, database.poses)
    assert theirs.body_name == "child" and theirs.torso_length < 0.85 * database.torso_length
    ratio = np.linalg.norm(theirs.features, axis=1) / np.linalg.norm(database.features, axis=1)
    assert 0.5 < np.median(ratio) < 0.9


def test_the_first_poses_are_a_database_of_their_own() -> None:
    few = small_database().limited(10)
    np.testing.assert_array_equal(few.features, small_database().features[:10])
    assert few.query(few.features, 100)[1].shape == (10, 10)
    with pytest.raises(DatabaseError, match="at least 1"):
        few.limited(0)
