"""Seeded mutations of every format that the project reads, and what became of reading them.

A damaged file may be refused with an error of the project, or read with its meaning unchanged. A foreign exception is a
finding; so is another meaning where the format carries a checksum. Text and plain images carry none: a digit that is
another digit is another file.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.container_files import mkv_recording, ros_recording
from tests.database_helpers import moving_clip, small_database, write_bvh
from tests.mocap_helpers import AMC_ARM, ASF_ARM
from tests.sensing_scenes import TOF, person_alone
from toolkit.checkpoint import load_checkpoint, save_checkpoint
from toolkit.config import load_settings
from toolkit.database.database import PoseDatabase
from toolkit.errors import DepthMocapError
from toolkit.mocap.read import read_clip
from toolkit.mocap.rig import _read_map
from toolkit.retrieval.annotation.classes import learn_classes, load_classes, save_classes
from toolkit.retrieval.annotation.report import read_segments
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery
from toolkit.retrieval.keyframes.query_file import load_queries
from toolkit.retrieval.search.example import Example, search_example
from toolkit.retrieval.search.find import find
from toolkit.retrieval.workflow.motions import labels_of
from toolkit.runs import load_people
from toolkit.sensing.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.sensing.writer import save_recording
from toolkit.track import FrameResult, RunInfo, Track, TrackWriter
from toolkit.tracking.hybrid import HybridSettings

INTERESTING = (
    b"",
    b"\x00",
    b"\xff\xff\xff\xff",
    b"-1",
    b"nan",
    b"1e308",
    b"9" * 400,
    b"[" * 2000,
    b"{}",
    b"null",
    b"\n",
)
"""Pieces that mutations put in."""


@dataclass(frozen=True)
class Format:
    """One format: how a small whole file is made in a folder, what is read from it, and whether it has a checksum."""

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]
    checked: bool = False


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three random changes: a flipped bit, a byte, a cut, a hole, a copy, a piece put in, bytes swapped."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        size = max(1, len(out))
        at, other = (int(p) for p in rng.integers(0, size, 2))
        length = int(min(rng.geometric(0.1), size))
        kind = int(rng.integers(7))
        if kind == 0 and out:
            out[at] ^= 1 << int(rng.integers(8))
        elif kind == 1 and out:
            out[at] = int(rng.integers(256))
        elif kind == 2:
            del out[at:]
        elif kind == 3:
            del out[at : at + length]
        elif kind == 4:
            out[other:other] = out[at : at + length]
        elif kind == 5:
            out[at : at + int(rng.integers(0, 5))] = INTERESTING[int(rng.integers(len(INTERESTING)))]
        elif out:
            out[at : at + length], out[other : other + length] = out[other : other + length], out[at : at + length]
    return bytes(out)


def meaning(value: Any) -> str:
    """Digest of everything that a value holds."""
    digest = hashlib.sha256()
    for piece in _pieces(value):
        digest.update(piece)
    return digest.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, dict):
        for key in sorted(value, key=str):
            yield str(key).encode()
            yield from _pieces(value[key])
    elif isinstance(value, (list, tuple)):
        yield b"("
        for item in value:
            yield from _pieces(item)
    elif is_dataclass(value) and not isinstance(value, type):
        yield from _pieces({f.name: getattr(value, f.name) for f in fields(value)})
    else:
        yield repr(value).encode()


def outcome(kind: Format, path: Path, original: str) -> str:
    """What reading a mutated file came to: refused, same, other, or a finding."""
    try:
        read = meaning(kind.read(path))
    except DepthMocapError as error:
        return "refused" if "\n" not in str(error) else f"FINDING: {len(str(error).splitlines())} lines"
    except Exception as error:
        return f"FINDING: {type(error).__name__}: {error}"[:200]
    if read == original:
        return "same"
    return "FINDING: another meaning" if kind.checked else "other"


def fuzz(name: str, folder: Path, mutations: int, seed: int) -> Counter[str]:
    """How often each outcome came up; the mutated file of a finding stays in `folder`."""
    kind, rng = FORMATS[name], np.random.default_rng([seed, sorted(FORMATS).index(name)])
    folder.mkdir(parents=True, exist_ok=True)
    path = kind.make(folder)
    whole = path.read_bytes()
    original, found = meaning(kind.read(path)), Counter[str]()
    for i in range(mutations):
        data = mutated(whole, rng)
        path.write_bytes(data)
        came = outcome(kind, path, original)
        found[came] += 1
        if came.startswith("FINDING"):
            (folder / f"finding_{i}_{path.name}").write_bytes(data)
    path.write_bytes(whole)
    return found


# What is read


def _recording(path: Path) -> Any:
    recording: Recording = open_recording(path if path.suffix not in (".png", ".json", ".csv", ".txt") else path.parent)
    return _everything(recording)


def _everything(recording: Recording) -> dict[str, Any]:
    known = {
        name: getattr(recording, name)
        for name in ("camera", "timestamps", "background", "joints", "reference_joints", "stored_up")
    }
    colors = [recording.color(i) for i in range(len(recording))]
    return {**known, "frames": [frame.copy() for frame in recording.frames()], "colors": colors}


# How small whole files are made


def _npz(folder: Path, **more: Any) -> Path:
    depth = np.stack([person_alone(TOF, 0.1 * i) for i in range(2)])[:, 40:80, 60:100]
    from toolkit.sensing.camera import Camera

    camera = Camera(50.0, 50.0, 19.5, 19.5, 40, 40, (0.1, 0.0, 0.0, 0.0, 0.0))
    save_recording(
        folder / "take.npz", depth=depth, camera=camera, timestamps=[0.0, 0.1], up_camera=(0, -1, 0),
        background=depth[0] + np.uint16(500), joints=np.zeros((2, 20, 3)), color=np.zeros((2, 40, 40, 3), np.uint8),
    )  # fmt: skip
    return folder / "take.npz"


def _stored_npz(folder: Path) -> Path:
    path = _npz(folder)
    with np.load(path) as arrays:
        values = dict(arrays)
    np.savez(path, **values)
    return path


def _png(folder: Path) -> Path:
    import cv2

    take = folder / "take"
    take.mkdir(exist_ok=True)
    cv2.imwrite(str(take / "0.png"), person_alone(TOF)[40:80, 60:100])
    (take / "camera.json").write_text(
        json.dumps({"fx": 50, "fy": 50, "cx": 19.5, "cy": 19.5, "dist": [0.1, 0, 0, 0, 0]})
    )
    return take / "0.png"


def _intrinsics(folder: Path) -> Path:
    return _png(folder).with_name("camera.json")


def _tum(folder: Path) -> Path:
    take = _png(folder).parent
    (take / "depth.txt").write_text("# depth\n1.5 0.png\n")
    return take / "depth.txt"


def _stray(folder: Path) -> Path:
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


def _mat(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "a1_s1_t1_depth.mat", {"d_depth": np.full((240, 320, 2), 2000, np.uint16)}, do_compression=True)
    return folder / "a1_s1_t1_depth.mat"


def _cloud(suffix: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        import open3d as o3d

        points = np.random.default_rng(0).uniform((-0.5, -0.5, 1.0), (0.5, 0.5, 1.2), (300, 3))
        o3d.io.write_point_cloud(
            str(folder / f"take{suffix}"), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        )
        return folder / f"take{suffix}"

    return make


def _ros(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = ros_recording(folder / name, 2)
        return path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))

    return make


def _r3d(folder: Path) -> Path:
    import lzfse

    facts = {"w": 80, "h": 80, "dw": 40, "dh": 40, "K": [100, 0, 0, 0, 100, 0, 39.5, 39.5, 1]}
    depth = np.linspace(1, 2, 1600, dtype="<f4").tobytes()
    with zipfile.ZipFile(folder / "take.r3d", "w") as archive:
        archive.writestr("metadata", json.dumps({**facts, "frameTimestamps": [0.0, 0.1]}))
        for i in range(2):
            archive.writestr(f"rgbd/{i}.depth", lzfse.compress(depth))
    return folder / "take.r3d"


def _database(folder: Path) -> Path:
    from dataclasses import replace

    from tests.test_parts import random_forest

    trained = random_forest(np.random.default_rng(0))
    replace(small_database(12), forest=trained).save(folder / "poses.npz")
    return folder / "poses.npz"


def _matrices() -> list[FeatureMatrix]:
    rng = np.random.default_rng(0)
    return [FeatureMatrix(f"doc{i}", np.repeat(rng.random((40, 8)) < 0.4, 5, axis=1)) for i in range(3)]


def _classes(folder: Path) -> Path:
    save_classes(folder / "classes.npz", learn_classes({"walk": _matrices()[:2], "jump": _matrices()[2:]}))
    return folder / "classes.npz"


def _read_index(path: Path) -> Any:
    index = KeyframeIndex.open(path)
    index.check()
    return index.names, index.arrays()


def _search_index(path: Path) -> Any:
    index = KeyframeIndex.open(path)
    moment = Keyframe("upper", (("F1", 1),))
    found = find(index, KeyframeQuery((moment, moment), ((0, 9),)))
    example = _matrices()[0].sliced(0, 30)
    return found.starts, search_example(index, Example.of(example), 3)


def _index(folder: Path) -> Path:
    KeyframeIndex.build(_matrices()).save(folder / "motions.index")
    return folder / "motions.index"


def _track(folder: Path) -> Path:
    from toolkit.body import skeleton

    writer = TrackWriter(folder, ("clean", "fit"), ("local", "database"))
    joints, pose = np.zeros((20, 3), np.float32), np.zeros(skeleton.POSE_SIZE)
    for i in range(3):
        writer.append(FrameResult(pose, joints, np.ones(20, np.float32), 0, 1, np.ones(2, np.float32)), 0.1 * i)
    return writer.finish()


def _run(folder: Path) -> Path:
    from toolkit.body import skeleton

    turn = np.diag([1.0, -1.0, -1.0]).ravel().tolist()
    RunInfo("/r.npz", "ab", {"mirrored": True}, skeleton.fingerprint(), [0.5], 1.0, "d", turn, {}, "1").save(folder)
    return folder / "run.json"


def _people(folder: Path) -> Path:
    row = dict(id=1, folder="person_01", first_frame=0, last_frame=3, stature=1.7, tracked=1.0, lost=0.0, hidden=0.0)
    (folder / "people.json").write_text(json.dumps({"people": [row]}))
    return folder / "people.json"


def _state(folder: Path) -> Path:
    save_checkpoint(
        folder / "state.npz", "hybrid", {"pose": np.arange(3.0), "count": 3, "past": (None, "a", {"b": 1.5})}
    )
    return folder / "state.npz"


def _text(name: str, text: str, beside: dict[str, str] | None = None) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        for other, content in (beside or {}).items():
            (folder / other).write_text(content)
        (folder / name).write_text(text)
        return folder / name

    return make


def _bvh(folder: Path) -> Path:
    write_bvh(folder / "a.bvh", seed=0, frames=2)
    return folder / "a.bvh"


def _amass(folder: Path) -> Path:
    from tests.test_mocap_amass import write_amass

    return write_amass(folder / "a.npz", moving_clip("a", 0, 3))


QUERIES = json.dumps(
    {"version": 1, "queries": [{"label": "a", "keyframes": [{"F1": 1}, {"F20": 0}], "distances": [[0, 30]], "lead": 3}]}
)
RIG = "joints:\n  root: Hips\n  thorax: [Spine2, Chest]\n  head: Head\n"

FORMATS: dict[str, Format] = {
    "recording npz": Format(_npz, _recording, checked=True),
    "recording npz, stored": Format(_stored_npz, _recording, checked=True),
    "recording png": Format(_png, _recording),
    "recording intrinsics json": Format(_intrinsics, _recording),
    "recording tum list": Format(_tum, _recording),
    "recording stray odometry": Format(_stray, _recording),
    "recording mat": Format(_mat, _recording),
    "recording pcd": Format(_cloud(".pcd"), _recording),
    "recording ply": Format(_cloud(".ply"), _recording),
    "recording mkv": Format(lambda folder: mkv_recording(folder / "take.mkv"), _recording),
    "recording bag": Format(_ros("take.bag"), _recording),
    "recording db3": Format(_ros("take_sqlite"), _recording),
    "recording mcap": Format(_ros("take_mcap"), _recording),
    "recording r3d": Format(_r3d, _recording),
    "pose database": Format(_database, PoseDatabase.load, checked=True),
    "motion classes": Format(_classes, load_classes, checked=True),
    "keyframe index": Format(_index, _read_index, checked=True),
    "keyframe index, searched": Format(_index, _search_index),
    "track npz": Format(_track, Track.load, checked=True),
    "run json": Format(_run, lambda path: RunInfo.load(path.parent)),
    "people json": Format(_people, lambda path: load_people(path.parent)),
    "tracker state": Format(_state, lambda path: load_checkpoint(path, "hybrid"), checked=True),
    "queries json": Format(_text("q.json", QUERIES), load_queries),
    "labels csv": Format(
        _text("l.csv", "clip,label\na,walk\nb,jump\n"), lambda path: labels_of([Path("a.bvh")], table=path)
    ),
    "segments csv": Format(_text("s.csv", "start,end,label\n0,1.5,walk\n1.5,2,jump\n"), read_segments),
    "settings yaml": Format(
        _text("s.yaml", "seed: 3\nsensing:\n  segment: person\n"), lambda path: load_settings(HybridSettings, path)
    ),
    "rig yaml": Format(_text("r.yaml", RIG), _read_map),
    "bvh": Format(_bvh, read_clip),
    "amc": Format(_text("arm_1.amc", AMC_ARM, {"arm.asf": ASF_ARM}), read_clip),
    "asf": Format(
        _text("arm.asf", ASF_ARM, {"arm_1.amc": AMC_ARM}), lambda path: read_clip(path.with_name("arm_1.amc"))
    ),
    "amass npz": Format(_amass, read_clip, checked=True),
}
