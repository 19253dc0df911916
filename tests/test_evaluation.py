import csv
import io
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.evaluation import agreement, evaluate
from toolkit.evaluation import joint_errors as joints
from toolkit.evaluation.extrema_scores import all_found
from toolkit.io.errors import RecordingError
from toolkit.io.files import sha256_of
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.tracks import LOST, TRACKED, FrameResult, RunInfo, TrackWriter
from toolkit.tracks.runs import PersonSummary, save_people

CAMERA = Camera(100.0, 100.0, 40.0, 30.0, 80, 60)
FRAMES = 6


def standing(frames: int = FRAMES) -> np.ndarray:
    """Return joints (frames, 20, 3) of a person at 2.5 m who sways, camera frame (y down), facing the camera."""
    side = {"left": 1.0, "right": -1.0}
    at = {"pelvis": (0, 0), "spine": (0, -0.2), "neck": (0, -0.5), "head": (0, -0.7)}
    for name, s in side.items():
        at |= {f"{name}_shoulder": (0.18 * s, -0.5), f"{name}_elbow": (0.4 * s, -0.45)}
        at |= {f"{name}_wrist": (0.6 * s, -0.4), f"{name}_hand": (0.7 * s, -0.4), f"{name}_hip": (0.1 * s, 0)}
        at |= {f"{name}_knee": (0.1 * s, 0.4), f"{name}_ankle": (0.1 * s, 0.8), f"{name}_foot": (0.12 * s, 0.85)}
    rest = np.array([(*at[name], 2.5) for name in skeleton.REPORTED])
    sway = 0.05 * np.sin(np.arange(frames))[:, None, None] * np.array([1.0, 0.2, 0.5])
    return (rest + sway).astype(np.float32)


def write_run(folder: Path, joints_found: np.ndarray, *, name: str = "take", **recorded: np.ndarray) -> Path:
    """Write a recording without a visible person and a run folder of a track on it."""
    depth = np.zeros((len(standing()), *CAMERA.shape), dtype=np.uint16)
    depth[:, 20:40, 30:50] = 2500
    recording = folder / f"{name}.npz"
    times = np.arange(len(depth)) / 30
    save_recording(recording, depth=depth, camera=CAMERA, timestamps=times, up_camera=(0, -1, 0), **recorded)
    run = folder / f"run_{name}"
    writer = TrackWriter(run, ("clean", "fit"), ("local", "database"))
    for i, found in enumerate(joints_found):
        result = FrameResult(
            np.zeros(skeleton.POSE_SIZE), found.astype(np.float32), np.ones(20, np.float32),
            LOST if i == 0 else TRACKED, int(i == 1), np.array([1.0, 2.0 + i], np.float32),
        )  # fmt: skip
        writer.append(result, times[i])
    writer.finish()
    turn = level_rotation(np.array([0, -1, 0])).ravel().tolist()
    mark = skeleton.fingerprint()
    RunInfo(str(recording), sha256_of(recording), {}, mark, [], 1.0, "", turn, {}, "0.1.0").save(run)
    return run


def test_errors_are_distances_capped_at_one_metre() -> None:
    truth = standing()
    found = truth.copy()
    found[0, 3, 0] += 0.25
    found[1, 4, 2] += 7.0
    errors = joints.joint_errors(found, truth)
    assert errors[0, 3] == pytest.approx(0.25, abs=1e-6) and errors[1, 4] == 1.0
    assert np.delete(errors.ravel(), [3, 24]).max() == 0.0


def test_unknown_truth_is_left_out_of_every_figure() -> None:
    truth = standing()
    truth[:, 5] = np.nan
    errors = joints.joint_errors(standing(), truth)
    assert joints.accuracy(errors) == 1.0
    np.testing.assert_array_equal(joints.frame_errors(errors), np.zeros(FRAMES))
    assert np.isnan(joints.accuracy(errors[:, 5]))


def test_a_joint_is_seen_where_a_surface_as_near_as_its_limb_is_thick_is_measured() -> None:
    depth = np.full(CAMERA.shape, 2.0, dtype=np.float32)
    depth[:, :20] = 1.0  # something nearer
    depth[30, 60] = 0.0  # a hole among measurements
    depth[40:, 50:] = 0.0  # nothing is measured
    pelvis, hand = skeleton.REPORTED.index("pelvis"), skeleton.REPORTED.index("left_hand")
    places = {
        (40, 30, 2.11): (True, True),
        (40, 30, 2.15): (True, False),
        (40, 30, 2.3): (False, False),
        (40, 30, 1.75): (False, False),
        (10, 30, 2.1): (False, False),
        (22, 30, 2.1): (True, True),
        (17, 30, 2.1): (False, False),
        (60, 30, 2.1): (True, True),
        (70, 55, 2.1): (False, False),
        (-1, 30, 2.0): (False, False),
        (80, 30, 2.0): (False, False),
        (40, 60, 2.0): (False, False),
        (40, 30, -1.0): (False, False),
        (np.nan, 30, 2.0): (False, False),
    }
    people = np.full((len(places), 20, 3), np.nan)
    for person, (u, v, z) in zip(people, places, strict=True):
        person[[pelvis, hand]] = (u - 40) / 100 * z, (v - 30) / 100 * z, z
    seen = joints.visible_joints(people, depth, CAMERA)
    assert seen[:, [pelvis, hand]].tolist() == [list(expected) for expected in places.values()]
    assert seen.sum() == sum(map(sum, places.values()))
    np.testing.assert_array_equal(joints.visible_joints(people[1], depth, CAMERA), seen[1])
    assert not joints.visible_joints(people[:0], depth, CAMERA).size


def test_overlap_and_residual_compare_two_depth_images() -> None:
    measured, rendered = np.zeros((4, 4), np.float32), np.zeros((4, 4), np.float32)
    measured[0, :3], rendered[0, 1:] = 2.0, 2.03
    assert evaluate.silhouette_overlap(measured, rendered) == 0.5
    assert evaluate.depth_residual(measured, rendered) == pytest.approx(0.03, abs=1e-6)
    empty = np.zeros((4, 4), np.float32)
    assert np.isnan(evaluate.silhouette_overlap(empty, empty)) and np.isnan(evaluate.depth_residual(measured, empty))


def test_each_end_effector_needs_an_extremum_of_its_own() -> None:
    ends = np.arange(15.0).reshape(5, 3)
    assert all_found(ends[::-1] + 0.05, ends)
    assert not all_found(np.concatenate([ends[:4], ends[:1]]), ends)
    assert not all_found(ends[:4], ends)
    close = ends.copy()
    close[1] = close[0] + 0.1
    assert not all_found(np.concatenate([close[:1], close[2:], close[2:3]]), close)


def test_offsets_of_other_subjects_undo_a_constant_displacement_however_the_person_stands() -> None:
    rng = np.random.default_rng(0)
    offsets = rng.normal(scale=0.1, size=(20, 3))
    differences, plain = [], []
    for yaw in (0.0, 1.0, 2.0):
        turn = Rotation.from_euler("yxz", [yaw, 0.4, 0.3]).as_matrix()
        track = standing().astype(np.float64) @ turn
        reference = track + np.einsum("tac,jc->tja", agreement.torso_frames(track), offsets)
        plain.append(agreement.agreement(track, reference))
        differences.append(agreement.local_differences(track, reference))
        np.testing.assert_allclose(differences[-1][0], offsets[agreement.COMPARED], atol=1e-6)
    assert max(plain) < 0.7
    assert agreement.agreement_with_offsets(differences, ["1", "2", "2"]) == [1.0, 1.0, 1.0]


def test_offsets_are_the_medians_of_all_other_subjects_together() -> None:
    runs = [
        np.full((frames, 16, 3), metres, np.float32) for frames, metres in ((3, 0.0), (4, 0.3), (1, 0.9), (9, 0.32))
    ]
    # The medians of the others, along each axis: 0.32 m for a and b, 0.3 m for c, who is 35 mm away.
    assert agreement.agreement_with_offsets(runs, ["a", "b", "b", "c"]) == [0.0, 1.0, 0.0, 1.0]


def test_a_run_is_compared_with_the_truth_in_its_own_recording(tmp_path: Path) -> None:
    truth = standing()
    found = truth.copy()
    found[:, :, 0] += 0.03
    found[5] += 0.5
    table = evaluate.evaluate_runs([write_run(tmp_path, found, joints=truth)], surface=False)
    row = table.rows[0]
    far = np.minimum(np.linalg.norm([0.53, 0.5, 0.5]), 1.0)
    assert row.error_mm == pytest.approx(1000 * (5 * 0.03 + far) / 6, abs=0.1)
    assert row.median_mm == pytest.approx(30, abs=0.1)
    assert row.a100 == row.a100_hands_feet == row.a100_joints["head"] == pytest.approx(5 / 6)
    assert row.lost == pytest.approx(1 / 6)
    assert row.states["lost"] == pytest.approx(1 / 6) and row.sources == {"local": 0.8, "database": 0.2}
    assert row.frame_ms == pytest.approx(5.5) and row.stages_ms == {"clean": 1.0, "fit": 4.5}
    assert row.agreement is None


def test_another_systems_skeleton_gives_agreement_and_never_an_error(tmp_path: Path) -> None:
    found = standing()
    runs = [
        write_run(tmp_path, found, name=f"a1_s{s}_t1_depth", reference_joints=found + np.float32([0, 0.2, 0]))
        for s in (1, 2)
    ]
    for row in evaluate.evaluate_runs(runs, surface=False):
        assert row.agreement == 0.0 and row.agreement_offsets == 1.0
        assert row.error_mm is None and row.a100 is None and row.lost is None


def test_references_are_a_file_or_a_folder_matched_by_stem(tmp_path: Path) -> None:
    found = standing()
    run = write_run(tmp_path, found)
    write_run(tmp_path / "elsewhere", found, joints=found)
    assert evaluate.evaluate_runs([run], surface=False).rows[0].error_mm is None
    for reference in (tmp_path / "elsewhere", tmp_path / "elsewhere" / "take.npz"):
        assert evaluate.evaluate_runs([run], [reference], surface=False).rows[0].error_mm == 0.0
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="holds no joints for take"):
        evaluate.evaluate_runs([run], [tmp_path / "empty"], surface=False)
    with pytest.raises(RecordingError, match="no reference"):
        evaluate.evaluate_runs([run], [tmp_path / "absent"], surface=False)


def test_an_interrupted_run_is_evaluated_over_the_frames_it_has(tmp_path: Path) -> None:
    truth = standing()
    row = evaluate.evaluate_runs([write_run(tmp_path, truth[:4], joints=truth)], surface=False).rows[0]
    assert (row.frames, row.recorded_frames, row.error_mm) == (4, 6, 0.0)


def test_a_recording_that_changed_since_is_not_evaluated(tmp_path: Path) -> None:
    run = write_run(tmp_path, standing(), joints=standing())
    recording = tmp_path / "take.npz"
    recording.write_bytes(recording.read_bytes() + b"x")
    with pytest.raises(RecordingError, match="changed"):
        evaluate.evaluate_runs([run])
    recording.unlink()
    with pytest.raises(RecordingError, match="gone"):
        evaluate.evaluate_runs([run])


def test_the_table_is_printed_and_written_as_csv_and_json(tmp_path: Path) -> None:
    truth = standing()
    runs = [write_run(tmp_path, truth, name=n, joints=truth) for n in ("one", "two")]
    table = evaluate.evaluate_runs(runs, surface=False)
    console = Console(file=io.StringIO(), width=200)
    console.print(table.to_rich())
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    assert "one" in printed and "mean of 2" in printed and "agreement" not in printed
    table.to_csv(tmp_path / "table.csv")
    rows = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert [row["recording"] for row in rows] == ["one", "two"] and rows[0]["a100_joints.head"] == "1.0"
    table.to_json(tmp_path / "table.json")
    read = json.loads((tmp_path / "table.json").read_text())
    assert read["mean"]["error_mm"] == 0.0 and read["runs"][1]["agreement"] is None
    assert len(read["curve_thresholds_mm"]) == len(read["mean"]["curve"])


def write_people(folder: Path, found: list[np.ndarray], truth: np.ndarray) -> Path:
    """Return a run of several people on a recording whose truth is `truth` (N, T, 20, 3)."""
    people = []
    run = folder / "crowd"
    for i, joints_found in enumerate(found):
        single = write_run(folder, joints_found, joints=truth)
        run.mkdir(exist_ok=True)
        single.rename(run / f"person_{i + 1:02d}")
        people.append(PersonSummary(i + 1, f"person_{i + 1:02d}", 0, FRAMES - 1, 1.7, 1.0, 0.0, 0.0))
    for person in people[:-1]:  # the recording has a new modification time each time
        shutil.copy(run / people[-1].folder / "run.json", run / person.folder)
    save_people(run, people)
    return run


def test_people_of_a_run_are_matched_with_the_truth_whatever_their_order(tmp_path: Path) -> None:
    left, right = standing() - np.float32([0.8, 0, 0]), standing() + np.float32([0.8, 0, 0])
    run = write_people(tmp_path, [right + np.float32(0.01), left], np.stack([left, right]))
    table = evaluate.evaluate_runs([run])
    assert [row.recording for row in table] == ["take/person_01", "take/person_02"]
    np.testing.assert_allclose([row.error_mm for row in table], [10 * np.sqrt(3), 0.0], atol=1e-2)
    assert evaluate.find_runs([run.parent]) == [run] and evaluate.find_runs([run]) == [run]


def test_a_missed_person_counts_one_metre(tmp_path: Path) -> None:
    truth = np.stack([standing(), standing() + np.float32([0.8, 0, 0])])
    truth[1, :2] = np.nan
    table = evaluate.evaluate_runs([write_people(tmp_path, [standing()], truth)])
    assert [row.recording for row in table] == ["take/person_01", "take/not found"]
    np.testing.assert_allclose([row.error_mm for row in table], [0.0, 1000.0], atol=1e-2)
    assert table.rows[1].a100 == 0.0 and table.rows[1].lost == 1.0


def test_one_track_of_several_people_is_compared_with_its_person(tmp_path: Path) -> None:
    right = standing() + np.float32([0.8, 0, 0])
    table = evaluate.evaluate_runs([write_run(tmp_path, right, joints=np.stack([standing(), right]))], surface=False)
    assert len(table) == 1 and table.rows[0].error_mm == pytest.approx(0.0, abs=1e-2)
