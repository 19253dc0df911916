"""Writers of one small valid file for each format that the project reads."""

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tests.container_files import realsense_recording, ros_recording
from tests.database_helpers import moving_clip, small_database, write_bvh
from tests.sensing_scenes import TOF, person_alone
from tests.support.amass import write_amass
from toolkit.body import k4abt, skeleton
from toolkit.body.personal import save_body
from toolkit.body.shape import ShapeSpace
from toolkit.inertial.calibration import Calibration, Mounting, TakeClock
from toolkit.inertial.sensor_files import CSV_COLUMNS
from toolkit.inertial.stream import Sensors, checked_stream
from toolkit.io.checkpoint import save_checkpoint
from toolkit.recordings.writer import save_recording
from toolkit.retrieval.annotation.classes import learn_classes, save_classes
from toolkit.retrieval.annotation.examples import ExampleSet
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.annotation.place_classifier import PlaceClassifier
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.sensing.camera import Camera
from toolkit.tracks import FrameResult, RunInfo, TrackWriter

Make = Callable[[Path], Path]


def npz_file(folder: Path) -> Path:
    depth = np.stack([person_alone(TOF, 0.1 * i) for i in range(2)])[:, 40:80, 60:100]
    camera = Camera(50.0, 50.0, 19.5, 19.5, 40, 40, (0.1, 0.0, 0.0, 0.0, 0.0))
    save_recording(
        folder / "take.npz", depth=depth, camera=camera, timestamps=[0.0, 0.1], up_camera=(0, -1, 0),
        background=depth[0] + np.uint16(500), joints=np.zeros((2, 20, 3)), color=np.zeros((2, 40, 40, 3), np.uint8),
    )  # fmt: skip
    return folder / "take.npz"


def stored_npz_file(folder: Path) -> Path:
    path = npz_file(folder)
    with np.load(path) as arrays:
        values = dict(arrays)
    np.savez(path, **values)
    return path


def png_file(folder: Path) -> Path:
    import cv2

    take = folder / "take"
    take.mkdir(exist_ok=True)
    cv2.imwrite(str(take / "0.png"), person_alone(TOF)[40:80, 60:100])
    (take / "camera.json").write_text(
        json.dumps({"fx": 50, "fy": 50, "cx": 19.5, "cy": 19.5, "dist": [0.1, 0, 0, 0, 0]})
    )
    return take / "0.png"


def intrinsics_file(folder: Path) -> Path:
    return png_file(folder).with_name("camera.json")


def tum_file(folder: Path) -> Path:
    take = png_file(folder).parent
    (take / "depth.txt").write_text("# depth\n1.5 0.png\n")
    return take / "depth.txt"


def stray_file(folder: Path) -> Path:
    import cv2

    take = folder / "take"
    (take / "depth").mkdir(parents=True, exist_ok=True)
    for i in range(2):
        cv2.imwrite(str(take / "depth" / f"{i}.png"), person_alone(TOF)[40:80, 60:100])
    (take / "camera_matrix.csv").write_text("2400.0,0,960.0\n0,2400.0,720.0\n0,0,1\n")
    (take / "odometry.csv").write_text(
        "timestamp, frame, x, y, z, qx, qy, qz, qw\n1.0,0,0,0,0,0,0,0,1\n1.1,1,0,0,0,0,0,0,1\n"
    )
    return take / "odometry.csv"


def mat_file(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "a1_s1_t1_depth.mat", {"d_depth": np.full((240, 320, 2), 2000, np.uint16)}, do_compression=True)
    return folder / "a1_s1_t1_depth.mat"


def cloud_file(suffix: str, folder: Path) -> Path:
    import open3d as o3d

    points = np.random.default_rng(0).uniform((-0.5, -0.5, 1.0), (0.5, 0.5, 1.2), (300, 3))
    o3d.io.write_point_cloud(str(folder / f"take{suffix}"), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    return folder / f"take{suffix}"


def ros_file(name: str, folder: Path) -> Path:
    path = ros_recording(folder / name, 2)
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))


def r3d_file(folder: Path) -> Path:
    import lzfse

    facts = {"w": 80, "h": 80, "dw": 40, "dh": 40, "K": [100, 0, 0, 0, 100, 0, 39.5, 39.5, 1]}
    depth = np.linspace(1, 2, 1600, dtype="<f4").tobytes()
    with zipfile.ZipFile(folder / "take.r3d", "w") as archive:
        archive.writestr("metadata", json.dumps({**facts, "frameTimestamps": [0.0, 0.1]}))
        for i in range(2):
            archive.writestr(f"rgbd/{i}.depth", lzfse.compress(depth))
    return folder / "take.r3d"


def database_file(folder: Path) -> Path:
    from tests.test_database_prior import random_prior

    rng = np.random.default_rng(0)
    replace(small_database(12), prior=random_prior(rng)).save(folder / "poses.npz")
    return folder / "poses.npz"


def feature_matrices() -> list[FeatureMatrix]:
    rng = np.random.default_rng(0)
    return [FeatureMatrix(f"doc{i}", np.repeat(rng.random((40, 8)) < 0.4, 5, axis=1)) for i in range(3)]


def classes_file(folder: Path) -> Path:
    save_classes(
        folder / "classes.npz", learn_classes({"walk": feature_matrices()[:2], "jump": feature_matrices()[2:]})
    )
    return folder / "classes.npz"


def graded_features(number: int) -> FeatureMatrix:
    rng, one = np.random.default_rng(number), feature_matrices()[number]
    measured, placed = (rng.integers(-127, 128, (rows, len(one))).astype(np.int8) for rows in (40, 24))
    return replace(one, measured=measured, placed=placed)


def model_file(folder: Path) -> Path:
    examples = ExampleSet.of([(graded_features(0), "walk"), (graded_features(1), "jump")])
    MotionModel(examples, (PlaceClassifier.of_cost(),) * 2).save(folder / "model.npz")
    return folder / "model.npz"


def skeletons_file(folder: Path) -> Path:
    joints = len(k4abt.NAMES)
    body = {
        "body_id": 1,
        "joint_positions": [[1.0, 2.0, 2000.0]] * joints,
        "joint_orientations": [[1.0, 0, 0, 0]] * joints,
    }
    frames = [{"timestamp_usec": 33333 * i, "frame_id": i, "num_bodies": 1, "bodies": [body]} for i in range(2)]
    (folder / "take.json").write_text(json.dumps({"frames": frames}))
    return folder / "take.json"


def metadata_file(folder: Path) -> Path:
    return ros_file("take_sqlite", folder).with_name("metadata.yaml")


def index_file(folder: Path) -> Path:
    KeyframeIndex.build(feature_matrices()).save(folder / "motions.index")
    return folder / "motions.index"


def track_file(folder: Path) -> Path:
    writer = TrackWriter(folder, ("clean", "fit"), ("local", "database"))
    joints, pose = np.zeros((20, 3), np.float32), np.zeros(skeleton.POSE_SIZE)
    for i in range(3):
        writer.append(FrameResult(pose, joints, np.ones(20, np.float32), 0, 1, np.ones(2, np.float32)), 0.1 * i)
    return writer.finish()


def run_file(folder: Path) -> Path:
    turn = np.diag([1.0, -1.0, -1.0]).ravel().tolist()
    RunInfo("/r.npz", "ab", {"mirrored": True}, skeleton.fingerprint(), [0.5], 1.0, "d", turn, {}, "0").save(folder)
    return folder / "run.json"


def people_file(folder: Path) -> Path:
    row = dict(id=1, folder="person_01", first_frame=0, last_frame=3, stature=1.7, tracked=1.0, lost=0.0, hidden=0.0)
    evidence = dict(looks=3, score=1.5, moved=0.5)
    whole = {"people": [row | {"evidence": evidence}], "furniture": [evidence]}
    (folder / "people.json").write_text(json.dumps(whole))
    return folder / "people.json"


def state_file(folder: Path) -> Path:
    save_checkpoint(
        folder / "state.npz", "hybrid", {"pose": np.arange(3.0), "count": 3, "past": (None, "a", {"b": 1.5})}
    )
    return folder / "state.npz"


def person_state_file(folder: Path) -> Path:
    from toolkit.tracking.state import PersonState, Previous

    body, pose = ShapeSpace.load().body([0.5, -1.0]), np.zeros(skeleton.POSE_SIZE)
    state = PersonState(
        body, True, PersonState.begin(body, sized=True, seed=3).generator, previous=Previous.of_pose(body, pose),
        pose=pose, centre=np.zeros(3), facing=np.array([0.0, 1.0]), timestamp=0.5, in_view=np.ones(20),
        smoothed=(pose, 0.5), memory={"swarm": {"poses": pose[None], "rest": np.zeros(1)}},
    )  # fmt: skip
    save_checkpoint(folder / "state.npz", "person", state)
    return folder / "state.npz"


def text_file(name: str, text: str, beside: dict[str, str] | None = None) -> Make:
    def make(folder: Path) -> Path:
        for other, content in ({name: text} | (beside or {})).items():
            (folder / other).write_text(content)
        return folder / name

    return make


def bvh_file(folder: Path) -> Path:
    write_bvh(folder / "a.bvh", seed=0, frames=2)
    return folder / "a.bvh"


def amass_file(folder: Path) -> Path:
    return write_amass(folder / "a.npz", moving_clip("a", 0, 3))


def realsense_file(folder: Path) -> Path:
    return realsense_recording(folder / "take.db3", 2)


def raw_file(folder: Path) -> Path:
    (folder / "take").mkdir()
    for i in range(2):
        (folder / "take" / f"{i}.raw").write_bytes(person_alone(TOF, 0.1 * i).astype("<u2").tobytes())
    return folder / "take" / "1.raw"


def joints_file(folder: Path) -> Path:
    people = [{"pose_keypoints_2d": [20.5, 30.25, 0.9] * 25}, {"pose_keypoints_2d": [3, 4, 0.5] * 18}]
    (folder / "take_0_keypoints.json").write_text(json.dumps({"version": 1.3, "people": people}))
    return folder / "take_0_keypoints.json"


def body_file(folder: Path) -> Path:
    offsets = 0.01 * np.sin(np.arange(len(ShapeSpace.load().skin_joints)))
    save_body(ShapeSpace.load().body([0.5, -1.0], offsets=offsets), folder / "me.npz")
    return folder / "me.npz"


def sensors_file(suffix: str, folder: Path) -> Path:
    times, rng = np.arange(6) / 100, np.random.default_rng(0)
    turns = Rotation.from_rotvec(np.arange(6)[:, None] * [0.01, 0.02, 0.03]).as_quat(scalar_first=True)
    pull = rng.normal(0, 1, (6, 3))
    stream = checked_stream("left_shin", times, rotations=turns, gyro=pull, acceleration=pull)
    if suffix == ".csv":
        write_csv(folder / "sensors.csv", Sensors((stream,)))
    else:
        Sensors((stream,)).save(folder / f"sensors{suffix}")
    return folder / f"sensors{suffix}"


def write_csv(path: Path, sensors: Sensors) -> None:
    """Write the sensors as a CSV file with the columns of the reader."""
    lines = [",".join(CSV_COLUMNS)]
    for stream in sensors:
        for i in np.flatnonzero(stream.valid):
            parts = (stream.rotations.as_quat(scalar_first=True), stream.gyro, stream.acceleration)
            numbers = [stream.times[i], *(value for part in parts for value in part[i])]
            lines.append(",".join([stream.name, *map(repr, map(float, numbers))]))
    path.write_text("\n".join(lines) + "\n")


def inertial_matlab_file(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "a1_s1_t1_inertial.mat", {"d_iner": np.tile([0.1, 0, 1, 18, 0, 0], (5, 1))}, do_compression=True)
    return folder / "a1_s1_t1_inertial.mat"


def calibration_file(folder: Path) -> Path:
    still = (1.0, 0.0, 0.0, 0.0)
    mounted = {"left_shin": Mounting(still, "good", device="7")}
    takes = {"take": TakeClock(0.5, {"left_shin": still})}
    Calibration("robust", "shared", mounted, takes, ("a note",)).save(folder / "calibration.json")
    return folder / "calibration.json"
