"""Exports of pixels, on the ground, with blanks for absent frames, and as AMASS."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.run_helpers import write_run
from tests.test_export import random_poses
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.rotations.matrices import matrices
from toolkit.body.shape import ShapeSpace
from toolkit.body.sole import soles
from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.files import sha256_of
from toolkit.mocap.amass import JOINTS
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import perform
from toolkit.mocap.read import read_clip
from toolkit.output.export.amass import OURS
from toolkit.output.export.pixels import BACKGROUND, regain_contour
from toolkit.output.export.run import export_run, origin_of
from toolkit.sensing.camera import level_rotation
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, Simulation, prepare, simulate_scene
from toolkit.tracks import EMPTY, TRACKED, FrameResult, RunInfo, TrackWriter
from toolkit.tracks.runs import PersonSummary, load_persons, save_people

FRAMES = 4


def true_run(run: Path, recording: Path, simulation: Simulation, person: int, absent: int = 0) -> None:
    """Write a run folder with a simulated person's true poses."""
    body, poses = simulation.performers[person].body, simulation.performers[person].poses
    turn = level_rotation(simulation.view.up_camera)
    info = RunInfo(
        str(recording), sha256_of(recording), {}, skeleton.fingerprint(), body.shape.tolist(), body.scale, "",
        turn.ravel().tolist(), {}, "0",
    )  # fmt: skip
    joints = simulation.view.to_camera(body.joint_positions(poses))
    root = simulation.view.to_camera(poses[:, None, :3])[:, 0] @ turn.T
    writer = TrackWriter(run, ("fit",), ("local",))
    for i in range(len(poses)):
        pose = np.concatenate([root[i], poses[i, 3:]])  # the floor plan's axes are those of the level frame
        state = EMPTY if i < absent else TRACKED
        writer.append(
            FrameResult(pose, joints[i].astype(np.float32), np.ones(20, np.float32), state, 0, np.ones(1)), i / 30
        )
    writer.finish()
    info.save(run)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Simulation]:
    """Write a run of two people side by side, the first absent in its first frame; return it and the simulation."""
    folder = tmp_path_factory.mktemp("two")
    body: Body = ShapeSpace.load().body([0.0])
    clip = PoseClip("boxing", perform("boxing", body).poses[:FRAMES], 30.0, "boxing")
    people = [SimulatedPerson(clip, body=body, at=(side, 0.0)) for side in (-0.5, 0.5)]
    shot = CaptureSettings(furnished=False, distance=3.0)
    simulation = prepare(people, shot)
    simulate_scene(people, folder / "take.npz", shot)
    for number in (1, 2):
        true_run(folder / "run" / f"person_{number:02d}", folder / "take.npz", simulation, number - 1, 2 - number)
    rows = [PersonSummary(n, f"person_{n:02d}", 0, FRAMES - 1, 1.7, 1.0, 0.0, 0.0) for n in (1, 2)]
    save_people(folder / "run", rows)
    return folder / "run", simulation


def test_a_body_index_map_has_the_ids_of_people_json(two: tuple[Path, Simulation], tmp_path: Path) -> None:
    run, simulation = two
    export_run(run, tmp_path / "index", format="body-index")
    files = sorted((tmp_path / "index").iterdir())
    assert [file.name for file in files] == [f"frame_{i:06d}.png" for i in range(FRAMES)]
    for i, (file, frame) in enumerate(zip(files, simulation.frames(), strict=True)):
        image = Image.open(file)
        assert image.mode == "L"
        labels = np.asarray(image)
        truth = np.where(frame.person < 0, BACKGROUND, frame.person + 1)
        truth[(truth == 1) & (i == 0)] = BACKGROUND  # absent in the run's first frame
        assert (labels == truth).mean() > 0.95
        assert set(np.unique(labels)) == ({2, BACKGROUND} if i == 0 else {1, 2, BACKGROUND})
        assert (labels[frame.depth == 0] == BACKGROUND).all()


def test_a_contour_is_regained_at_the_person_s_depth_only() -> None:
    depth = np.full((5, 5), 3000, dtype=np.uint16)
    depth[1:4, 1:4] = 2000
    depth[1, 1], depth[3, 2] = 0, 3000
    labels = np.full(depth.shape, BACKGROUND, dtype=np.uint8)
    labels[2, 2] = 7
    regain_contour(labels, depth)
    assert np.array_equal(labels == 7, depth == 2000)


def test_what_was_measured_needs_the_recording(two: tuple[Path, Simulation], tmp_path: Path) -> None:
    run, _ = two
    with pytest.raises(RecordingError, match="gone"):
        export_run(run, tmp_path / "index", format="body-index", recording=tmp_path / "none.npz")
    with pytest.raises(UsageError, match="a folder"):
        export_run(run, tmp_path / "index.png", format="body-index")


def standing(tmp_path: Path, *, floor: float | None = None, absent: int = 0) -> Path:
    """Write a run of a person who stands 3 m from a camera 1.2 m above the floor, which may be known."""
    run = tmp_path / "run"
    poses = np.zeros((8, skeleton.POSE_SIZE))
    write_run(run, poses, absent=absent)
    info = RunInfo.load(run)
    poses[:, :3] = [0.4, -1.2 - float(soles(info.body(), poses[:1])[0, ..., 1].min()), -3.0]
    write_run(run, poses, absent=absent)
    replace(info, floor=[] if floor is None else [floor]).save(run)
    return run


@pytest.mark.parametrize(("floor", "how"), [(1.2, "seen by the camera"), (None, "where the feet rest")])
def test_a_standing_person_stands_at_the_origin_of_the_file(tmp_path: Path, floor: float | None, how: str) -> None:
    run = standing(tmp_path, floor=floor, absent=2)
    people = load_persons(run)
    assert f"({how})" in origin_of(people, "floor")[1]
    export_run(run, tmp_path / "a.csv")
    rows = list(csv.DictReader((tmp_path / "a.csv").open(newline="")))
    assert rows[0]["pelvis_x_m"] == "" and rows[1]["left_foot_observed"] == ""
    assert [float(rows[3][f"pelvis_{axis}_m"]) for axis in "xz"] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert float(rows[3]["left_ankle_y_m"]) == pytest.approx(0.08, abs=0.03)
    assert float(rows[3]["head_y_m"]) > 1.4
    clip_path = tmp_path / "a.bvh"
    export_run(run, clip_path)
    np.testing.assert_allclose(read_clip(clip_path).root_positions[:, [0, 2]], 0.0, atol=1e-5)
    assert read_clip(clip_path).root_positions[:, 1].min() > 0.7


def test_a_bvh_repeats_the_nearest_pose_in_absent_frames_and_notes_it(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(6), absent=2)
    export_run(run, tmp_path / "a.bvh")
    found = read_clip(tmp_path / "a.bvh").rotations
    np.testing.assert_allclose(found[0], found[2], atol=1e-6)
    assert np.abs(found[3] - found[2]).max() > 0.1
    notes = json.loads((tmp_path / "a.bvh.notes.json").read_text())
    assert notes["people"] == [{"name": "run", "nobody_there": [[0, 1]], "lost": []}]
    assert "ground at y = 0" in notes["axes"]


def test_an_always_absent_person_is_blank_in_tables_and_rejected_by_other_formats(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(3), absent=3)
    export_run(run, tmp_path / "a.csv")
    assert all(row["head_x_m"] == "" for row in csv.DictReader((tmp_path / "a.csv").open(newline="")))
    export_run(run, tmp_path / "a.json")
    export_run(run, tmp_path / "a.trc")
    for name in ("a.bvh", "a.npz"):
        with pytest.raises(UsageError, match="in no frame"):
            export_run(run, tmp_path / name)


def test_an_amass_motion_comes_back_exactly(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(5))
    export_run(run, tmp_path / "a.npz", format="amass", origin="camera")
    clip, person = read_clip(tmp_path / "a.npz"), load_persons(run)[0]
    assert clip.frame_rate == pytest.approx(25.0)
    vectors = np.zeros((5, len(skeleton.JOINT_NAMES), 3))
    vectors[:, skeleton.DOF_JOINT, skeleton.DOF_AXIS] = person.track.pose[:, 3:]
    names = [OURS.get(name, name.replace("collar", "clavicle")) for name, _ in JOINTS]
    for j, name in enumerate(names):
        if name in skeleton.JOINT_NAMES:
            expected = matrices(vectors[:, skeleton.JOINT_NAMES.index(name)])
            np.testing.assert_allclose(clip.rotations[:, j], expected, atol=1e-12)
        else:
            np.testing.assert_allclose(clip.rotations[:, j], np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-15)
    hips = clip.world()[0][:, [clip.index("left_hip"), clip.index("right_hip")]].mean(axis=1)
    np.testing.assert_allclose(hips, person.track.pose[:, :3], atol=1e-12)


def test_an_origin_that_a_format_does_not_have_is_refused(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(3))
    with pytest.raises(UsageError, match="--origin floor is not for k4abt"):
        export_run(run, tmp_path / "a.json", format="k4abt", origin="floor")
    with pytest.raises(UsageError, match="neither floor nor camera"):
        export_run(run, tmp_path / "a.csv", origin="moon")
    with pytest.raises(UsageError, match="--format k4abt is written to"):
        export_run(run, tmp_path / "a.csv", format="k4abt")
    with pytest.raises(UsageError, match="--format obj is unknown"):
        export_run(run, tmp_path / "a.csv", format="obj")
