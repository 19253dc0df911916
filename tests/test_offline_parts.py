"""Parts that only whole commands exercised: seated motions, occluders, the ground, expected limbs, colours, reports."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from database_builder.kept import KeptFile
from database_builder.occluders import box, occluder_meshes
from depthmocap.step import track_of
from toolkit.app.stabilise.demands import DISAGREEMENT
from toolkit.app.stabilise.retrack import GapGuide
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.evaluation.orientation_report import write_check
from toolkit.evaluation.orientations import RunCheck
from toolkit.evaluation.reference import Reference, find_reference
from toolkit.fitting.priors import LimbPrior
from toolkit.inertial.calibration import Calibration, Mounting
from toolkit.inertial.distance import Distances, WrongStretch
from toolkit.io.errors import OutputError, RecordingError
from toolkit.mocap.choreography import MOTIONS
from toolkit.mocap.procedural import SEATED_MOTIONS, SEATED_SUBJECT_MOTIONS, perform
from toolkit.motion.contact import ground_of
from toolkit.retrieval.priors.bridge import Bridge
from toolkit.retrieval.priors.gap_trajectories import KEPT, PRIOR_SPREAD, GapWays
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limb_entries import ENTRIES
from toolkit.sensing.camera import Camera
from toolkit.simulation.interiors.mesh import BOX_FACES
from toolkit.simulation.picture import FINER, Backdrop, DrawnMesh
from toolkit.simulation.raycast import Hits, cast
from toolkit.simulation.scene import PlacedCamera
from toolkit.tracking.multi_person import Row
from toolkit.tracks import EMPTY, LOST, TRACKED, FrameResult

BODY = load_body("neutral")
STANDING_HIPS = -float(BODY.vertices[:, 1].min())

# Seated motions.


@pytest.mark.parametrize("name", [*SEATED_MOTIONS, *SEATED_SUBJECT_MOTIONS])
def test_who_sits_has_the_hips_low_the_knees_bent_and_something_on_the_floor(name: str) -> None:
    motion = MOTIONS[name]
    clip = perform(name, BODY, 15.0)
    low, high = skeleton.POSE_LIMITS.T
    assert (clip.poses[:, 3:] >= low[3:] - 1e-9).all() and (clip.poses[:, 3:] <= high[3:] + 1e-9).all()
    poses = clip.poses[:: max(1, len(clip.poses) // 6)]
    hips = poses[:, 1]
    assert (hips < (0.45 if motion.on_floor else 0.8 * STANDING_HIPS)).all()
    lowest = np.array([BODY.vertex_positions(pose)[:, 1].min() for pose in poses])
    np.testing.assert_allclose(lowest, 0.0, atol=1e-6 if motion.on_floor else 0.12)


def test_no_motion_of_a_seated_subject_is_one_of_the_database() -> None:
    held = [MOTIONS[name].hold for name in SEATED_MOTIONS]
    assert all(MOTIONS[name].hold not in held for name in SEATED_SUBJECT_MOTIONS)


# What stands before people.


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Of a closed surface; positive where its faces turn outwards."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("yaw", [0.0, 0.8, -2.0])
def test_a_box_is_closed_outwards_and_as_large_and_as_far_as_asked(yaw: float) -> None:
    centre, size = np.array([0.3, 0.5, -2.0]), (0.8, 0.4, 0.2)
    mesh = box(centre, size, yaw)
    assert mesh.faces is BOX_FACES
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(np.prod(size))
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), centre, atol=1e-12)
    wide = mesh.vertices[4] - mesh.vertices[0]  # along the box's own x
    np.testing.assert_allclose(wide / size[0], [np.cos(yaw), 0.0, -np.sin(yaw)], atol=1e-12)


def test_what_hides_a_person_stands_on_their_floor_or_above_it_and_not_behind_them() -> None:
    root, space = np.array([0.4, 0.1, -2.6]), ShapeSpace.load()
    poses = np.zeros((1, skeleton.POSE_SIZE))
    floor = root[1] + BODY.vertices[:, 1].min()
    towards = -root[[0, 2]] / np.hypot(*root[[0, 2]])
    before, kinds = [], set()
    for seed in range(40):
        meshes = occluder_meshes(poses, space, root, 0.0, BODY.vertices, np.random.default_rng(seed))
        kinds.add((len(meshes), len(meshes[0].vertices)))
        for mesh in meshes:
            assert mesh.vertices[:, 1].min() > floor - 1e-6
            assert volume(mesh.vertices, mesh.faces) > 0.0
            before.append(float(((mesh.vertices.mean(axis=0) - root)[[0, 2]] * towards).sum()))
    assert len(kinds) >= 4, "desks, crates, and people"
    assert np.mean(np.array(before) > 0.0) > 0.85, "a chair's back may stand behind who sits on it"


# The ground under people.


def somebody(height: float | None, *, feet: bool = True, there: bool = True, state: int = TRACKED) -> Any:
    poses = np.zeros((30, skeleton.POSE_SIZE))
    poses[:, 1] = 0.2
    track = SimpleNamespace(
        pose=poses,
        timestamps=np.arange(30) / 30,
        state=np.full(30, state),
        observed=np.full((30, len(skeleton.REPORTED)), feet),
    )
    return SimpleNamespace(camera_height=height, track=track, body=BODY, there=np.full(30, there))


def test_the_ground_is_where_the_camera_saw_it_else_where_feet_rest_else_guessed() -> None:
    below = 0.2 - STANDING_HIPS
    assert ground_of([somebody(None), somebody(1.3)]) == (-1.3, "seen by the camera")
    height, how = ground_of([somebody(None)])
    assert height == pytest.approx(below, abs=0.02) and how == "where the feet rest"
    for person in (somebody(None, feet=False), somebody(None, state=LOST)):
        height, how = ground_of([person])
        assert height == pytest.approx(below, abs=0.02) and how == "guessed"
    assert ground_of([somebody(None, feet=False, there=False)]) == (0.0, "guessed")


# What is expected of hidden limbs while a recording is tracked again.


def test_a_prior_holds_hidden_frames_only_and_gives_way_to_the_whole_pose_in_bad_ones() -> None:
    times = np.arange(10) / 30
    entries = ENTRIES["left_arm"]
    gap, hidden = Gap("left_arm", 2, 7), np.array([False, True, True, True, False])
    mean = np.arange(5.0)[:, None] + np.zeros(len(entries))
    way = GapWays(gap, hidden, Bridge(mean, np.full_like(mean, 0.04)), (KEPT,), np.zeros((1, *mean.shape)))
    whole: Any = {4: object()}
    marked = {5: [SimpleNamespace(violation=lambda pose: 0.2), SimpleNamespace(violation=lambda pose: 0.1)]}
    guide = GapGuide([way], whole, times, marked)  # type: ignore[arg-type]
    priors = [guide.priors(float(time)) for time in times]
    assert [len(terms) for terms in priors] == [0, 0, 0, 1, 1, 3, 0, 0, 0, 0]
    first = priors[3][0]
    assert isinstance(first, LimbPrior) and first.entries is entries
    assert first.mean.tolist() == mean[1].tolist()
    np.testing.assert_allclose(first.variance, 0.04 + PRIOR_SPREAD**2)
    assert priors[4][0] is whole[4]
    pose = np.zeros(skeleton.POSE_SIZE)
    assert guide.contradicts(float(times[5]), pose) == pytest.approx(0.3 * DISAGREEMENT)
    assert guide.contradicts(float(times[4]), pose) == 0.0


# Colours of simulated people.


def test_a_person_is_drawn_before_a_wall_and_hidden_behind_it() -> None:
    camera = Camera(40.0, 40.0, 9.5, 7.5, 20, 16)
    fine = Camera(40.0 * FINER, 40.0 * FINER, 9.5 * FINER + 0.5, 7.5 * FINER + 0.5, 20 * FINER, 16 * FINER)
    square = np.array([(-0.1, -0.1, 1.0), (0.1, -0.1, 1.0), (0.1, 0.1, 1.0), (-0.1, 0.1, 1.0)])
    faces = np.array([(0, 2, 1), (0, 3, 2)], dtype=np.int32)
    wall = np.full((*fine.shape, 3), 100.0)
    pictures = []
    for distance in (2.0, 0.5):
        backdrop = Backdrop(wall, np.full(fine.shape, distance), np.array([0.0, 0.0, -1.0]), fine)
        mesh = DrawnMesh(square, faces, np.full((4, 3), 250.0))
        pictures.append(backdrop.with_people([mesh], np.random.default_rng(0)))
    before, behind = pictures
    assert before.shape == (*camera.shape, 3) and before.dtype == np.uint8
    assert before[7, 9].min() > 200 and before[0, 0].max() < 120
    np.testing.assert_array_equal(before[0], behind[0])
    assert behind.max() < 120, "noise is a few grey levels"


def test_a_room_is_painted_where_something_is_and_every_generator_paints_its_own() -> None:
    fine = Camera(40.0, 40.0, 19.5, 15.5, 40, 32)
    wall = np.array([(-2.0, -2.0, 3.0), (2.0, -2.0, 3.0), (2.0, 0.0, 3.0)])
    hits = cast(wall, np.array([(0, 2, 1)]), fine)
    view = PlacedCamera(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    rooms = [Backdrop.of_room(hits, fine, view, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    seen = hits.depth > 0
    assert isinstance(hits, Hits) and 0.1 < seen.mean() < 0.9
    assert (rooms[0].image[seen] > 0).all() and not rooms[0].image[~seen].any()
    assert np.isinf(rooms[0].depth[~seen]).all()
    np.testing.assert_array_equal(rooms[0].image, rooms[1].image)
    assert not np.array_equal(rooms[0].image, rooms[2].image)


# A check by inertial sensors as files.


@pytest.fixture
def check() -> RunCheck:
    times = np.arange(60) / 30
    full = np.where((times > 0.5) & (times < 1.0), 60.0, 5.0)
    full[0] = np.nan
    curves = (Distances("left_shin", times, full, full / 2), Distances("head", times, np.full(60, 4.0), np.zeros(60)))
    errors = (WrongStretch("left_shin", 0.5333, 0.9667, 60.0, 58.5, "orientation"),)
    sensors = {"left_shin": Mounting((1.0, 0.0, 0.0, 0.0), "weak", reason="<hardly moves>")}
    return RunCheck("a <run>", Calibration("robust", "shared", sensors, {}), curves, errors)


def test_a_check_comes_back_from_its_files_and_names_stay_text(check: RunCheck, tmp_path: Path) -> None:
    table, errors, figures, png, html = write_check(check, tmp_path)
    rows = list(csv.DictReader(table.open()))
    assert len(rows) == 120 and rows[0]["full"] == "" and rows[0]["limb"] == "left_shin"
    assert [float(row["full"]) for row in rows[1:60]] == check.distances[0].full[1:].tolist()
    (error,) = csv.DictReader(errors.open())
    assert (error["limb"], float(error["start"]), error["peak"]) == ("left_shin", 0.533, "60.0")
    found = json.loads(figures.read_text())
    assert found["limbs"]["left_shin"]["frames"] == 59
    assert found["limbs"]["head"]["median"] == 4.0
    assert found["errors"][0]["mean"] == 58.5
    page = html.read_text()
    assert "a &lt;run&gt;" in page and "&lt;hardly moves&gt;" in page and "<run>" not in page
    assert png.read_bytes().startswith(b"\x89PNG")


# What a track is compared with.


class Take(SimpleNamespace):
    """A recording of five frames, of which the joints matter."""

    def __len__(self) -> int:
        return 5


@pytest.mark.parametrize(("key", "is_truth"), [("joints", True), ("reference_joints", False)])
def test_a_recording_speaks_for_itself_and_says_whether_it_is_the_truth(key: str, is_truth: bool) -> None:
    joints = np.random.default_rng(0).normal(size=(2, 5, 20, 3))
    known = {"joints": None, "reference_joints": None, key: joints}
    found = find_reference(Take(name="take", **known), [], 3)  # type: ignore[arg-type]
    assert found is not None and found.is_truth == is_truth
    np.testing.assert_array_equal(found.joints, joints[:, :3])
    np.testing.assert_array_equal(found.of(1).joints, joints[1, :3])
    assert Reference(joints[0], True).people.shape == (1, 5, 20, 3)


def test_without_joints_there_is_no_reference_and_another_length_is_an_error() -> None:
    assert find_reference(Take(name="take", joints=None, reference_joints=None), [], 5) is None  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="has 4 frames, the recording 5"):
        find_reference(Take(name="take", joints=np.zeros((4, 20, 3)), reference_joints=None), [], 5)  # type: ignore[arg-type]


# A track of rows in memory.


def test_rows_become_the_columns_of_a_track() -> None:
    result = FrameResult(
        np.zeros(skeleton.POSE_SIZE), np.zeros((20, 3), np.float32), np.ones(20, np.float32), TRACKED, 1,
        np.ones(3, np.float32),
    )  # fmt: skip
    results = [result, replace(result, state=EMPTY, source=0), replace(result, pose=result.pose + 0.1)]
    rows = [Row(4, k, 0.1 * k, each) for k, each in enumerate(results)]
    tracker: Any = SimpleNamespace(source_names=("local", "arms"), stage_names=("prepare", "landmarks", "select"))
    track = track_of(rows, tracker, BODY)
    assert track.state.tolist() == [TRACKED, EMPTY, TRACKED] and track.source.tolist() == [1, 0, 1]
    assert track.timestamps.tolist() == pytest.approx([0.0, 0.1, 0.2])
    np.testing.assert_array_equal(track.pose[2], results[2].pose)
    assert track.stage_ms.shape == (3, 3) and track.contact.shape == (3, 2) and not track.contact[1].any()


# What a build keeps.


def test_what_is_kept_comes_back_under_its_key_alone(tmp_path: Path) -> None:
    path = tmp_path / "images.npz"
    kept = KeptFile(path, "seed 1")
    assert kept.load() is None
    assert kept.save({"depth": np.arange(5, dtype=np.uint16), "name": "a"})
    arrays = kept.load()
    assert arrays is not None and set(arrays) == {"depth", "name"}
    np.testing.assert_array_equal(arrays["depth"], np.arange(5))
    assert KeptFile(path, "seed 2").load() is None
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert kept.load() is None, "what is damaged is made again"


def test_without_a_place_or_without_room_a_build_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert KeptFile(None, "a").save({"depth": np.zeros(3)}) and KeptFile(None, "a").load() is None

    def full(*_: Any, **__: Any) -> None:
        raise OutputError("No space left on device")

    monkeypatch.setattr("database_builder.kept.save_archive", full)
    assert not KeptFile(tmp_path / "images.npz", "a").save({"depth": np.zeros(3)})
    assert not list(tmp_path.iterdir())
