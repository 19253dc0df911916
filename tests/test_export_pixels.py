"""Person of each pixel, the segmented clouds, and the viewer's file."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.files import sha256_of
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import perform
from toolkit.output.export.pixels import BACKGROUND, regain_contour
from toolkit.output.export.run import export_run
from toolkit.sensing.camera import level_rotation
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, Simulation, prepare, simulate_scene
from toolkit.tracks import EMPTY, TRACKED, FrameResult, RunInfo, TrackWriter
from toolkit.tracks.runs import PersonSummary, save_people

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


def test_the_clouds_of_people_are_their_points_with_their_ids(two: tuple[Path, Simulation], tmp_path: Path) -> None:
    import open3d

    run, simulation = two
    export_run(run, tmp_path / "clouds", format="ply", origin="floor")
    file = tmp_path / "clouds" / "frame_000002.ply"
    cloud = open3d.t.io.read_point_cloud(str(file))
    points, person = cloud.point.positions.numpy(), cloud.point["person"].numpy().ravel()
    assert set(person.tolist()) == {1, 2} and len(points) > 500
    assert -0.1 < points[:, 1].min() < 0.1 and 1.4 < points[:, 1].max() < 1.9, "y up, ground at 0"
    assert points[person == 1, 0].mean() < points[person == 2, 0].mean() - 0.5


def test_what_was_measured_needs_the_recording(two: tuple[Path, Simulation], tmp_path: Path) -> None:
    run, _ = two
    with pytest.raises(RecordingError, match="gone"):
        export_run(run, tmp_path / "index", format="body-index", recording=tmp_path / "none.npz")
    with pytest.raises(UsageError, match="a folder"):
        export_run(run, tmp_path / "index.png", format="body-index")


def test_a_rerun_file_is_written_and_its_package_named_where_it_is_missing(
    two: tuple[Path, Simulation], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rerun")
    export_run(two[0], tmp_path / "run.rrd")
    written = (tmp_path / "run.rrd").read_bytes()
    assert written[:4] in (b"RRF2", b"RRIO")
    body = ShapeSpace.load().body([0.0])
    mesh = 12 * (len(body.vertices) + len(body.faces))  # bytes of the positions and of the triangles
    assert len(written) < 2 * FRAMES * mesh, "the triangles are written once, depth as PNG"
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(UsageError, match="rerun"):
        export_run(two[0], tmp_path / "other.rrd")
