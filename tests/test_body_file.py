"""A person's own body: as a file, from recordings of a T-pose, in a track and in its run folder."""

from pathlib import Path

import numpy as np
import pytest

from tests.fake_tracker import FakeTracker
from tests.run_helpers import run as run_command
from tests.support.subjects import LEVEL, camera_for, draw
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.personal import load_body_file, save_body
from toolkit.body.shape import ShapeSpace
from toolkit.io.archives import load_archive, save_archive
from toolkit.io.checkpoint import plain, read_state
from toolkit.io.errors import BodyError, UsageError
from toolkit.recordings.writer import save_recording
from toolkit.tracking import registry
from toolkit.tracking.registry import Registration, register
from toolkit.tracking.state import PersonState
from toolkit.tracks import RunInfo

CAMERA = camera_for(5000)


def own() -> Body:
    """Return a body with offsets."""
    space = ShapeSpace.load()
    count = len(space.skin_joints)
    return space.body([0.5, -1.0], offsets=0.01 * np.sin(np.arange(count)))


def test_a_body_comes_back_from_its_file(tmp_path: Path) -> None:
    save_body(own(), tmp_path / "me.npz")
    found = load_body_file(tmp_path / "me.npz")
    np.testing.assert_array_equal(found.vertices, own().vertices)
    np.testing.assert_array_equal(found.joints, own().joints)
    assert found.name == "me"


def test_a_body_keeps_its_offsets_in_a_state_and_in_a_run_folder(tmp_path: Path) -> None:
    state = PersonState.begin(own(), sized=True, seed=0)
    np.testing.assert_array_equal(read_state(plain(state), PersonState, "person").body.vertices, own().vertices)
    offsets = own().offsets
    assert offsets is not None
    turn = np.eye(3).ravel().tolist()
    shape = own().shape.tolist()
    info = RunInfo("/r.npz", "ab", {}, skeleton.fingerprint(), shape, 1.0, "", turn, {}, "0", offsets=list(offsets))
    info.save(tmp_path)
    np.testing.assert_allclose(RunInfo.load(tmp_path).body().vertices, own().vertices, atol=1e-12)


def test_a_body_of_another_mesh_a_damaged_one_and_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "me.npz"
    with pytest.raises(BodyError, match=r"me\.npz"):
        load_body_file(path)
    save_body(own(), path)
    values = {name: value for name, value in load_archive(path, BodyError, "").items() if name != "checksum"}
    for name, value, said in (
        ("topology", "0" * 16, "another mesh"),
        ("offsets", np.full(len(values["offsets"]), 0.5), "offsets of"),
        ("offsets", np.zeros(7), "do not fit"),
        ("shape", np.full(16, np.nan), "shape of"),
    ):
        save_archive(tmp_path / "bad.npz", values | {name: value})
        with pytest.raises(BodyError, match=said):
            load_body_file(tmp_path / "bad.npz")
    save_archive(tmp_path / "bad.npz", {name: value for name, value in values.items() if name != "scale"})
    with pytest.raises(BodyError, match="has no scale"):
        load_body_file(tmp_path / "bad.npz")


def test_a_tracker_without_use_for_a_body_refuses_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "REGISTERED", {})
    settings = type(FakeTracker().settings)
    register("fake", Registration(settings, needs_database=False, build=lambda *given: FakeTracker()))
    save_body(own(), tmp_path / "me.npz")
    with pytest.raises(UsageError, match="takes no body"):
        TrackerRecipe(None, {"tracker": "fake"}, body=tmp_path / "me.npz").build()


@pytest.mark.parametrize("config", ["swarm", "qammaz", "lopez2011"])
def test_every_tracker_without_a_database_takes_a_body(tmp_path: Path, config: str) -> None:
    save_body(own(), tmp_path / "me.npz")
    tracker = TrackerRecipe(config, body=tmp_path / "me.npz").build()
    assert tracker.learning_seconds == 0.0
    follower = tracker.follower(CAMERA, LEVEL)
    np.testing.assert_allclose(follower.body.vertices, own().vertices, atol=1e-12)


def recorded(path: Path, degrees: float) -> Path:
    """Return a recording of the neutral body in a T-pose."""
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[2], pose[4] = -2.8, np.radians(degrees)
    rng = np.random.default_rng(0)
    body = ShapeSpace.load().body([0.5, -1.0])
    depth = np.array([np.rint(1000 * draw(body, pose, CAMERA, rng)) for _ in range(3)]).astype(np.uint16)
    save_recording(path, depth=depth, camera=CAMERA, timestamps=np.arange(3) / 30, up_camera=LEVEL[1])
    return path


def test_recordings_of_a_t_pose_become_a_body(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    views = [recorded(tmp_path / f"{degrees}.npz", degrees) for degrees in (0, 180)]
    assert run_command("body", "scan", *views, "--output", tmp_path / "me.npz") == 0
    body = load_body_file(tmp_path / "me.npz")
    expected = ShapeSpace.load().body([0.5, -1.0])
    off = ((body.vertices - expected.vertices) * expected.normals).sum(axis=1)
    assert np.median(np.abs(off)) < 0.006 and "of the skin seen" in capsys.readouterr().out
