"""Messages of readers for files that are cut, hold no depth, or have jumping clocks; and bounded memory."""

import json
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests import container_files
from tests.container_files import mkv_recording, ros_recording
from tests.file_formats import FORMATS
from tests.sensing_scenes import TOF, person_alone
from toolkit.io.errors import RecordingError
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.recording import Recording

RECORDINGS = [name for name in FORMATS if name.startswith("recording") and not name.endswith("resealed")]


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_truncated_file_is_one_sentence_or_as_long_as_before(name: str, tmp_path: Path) -> None:
    kind = FORMATS[name]
    path = kind.make(tmp_path)
    content, frames = path.read_bytes(), len(kind.read(path)["frames"])
    for share in (0.0, 0.1, 0.5, 0.9, 0.995):
        path.write_bytes(content[: int(share * len(content))])
        try:
            read = kind.read(path)
        except RecordingError as problem:
            assert "\n" not in str(problem)
        else:
            texts = ("tum", "stray")  # a list of frames that is cut between two lines is a shorter list
            assert len(read["frames"]) == frames or any(word in name for word in texts), share


def _npz(folder: Path, times: list[float]) -> Path:
    depth = np.stack([person_alone(TOF)] * len(times))
    save_recording(folder / "take.npz", depth=depth, camera=TOF, timestamps=range(len(times)))
    with np.load(folder / "take.npz") as arrays:
        kept = {name: array for name, array in arrays.items() if name != "checksum"}
    np.savez(folder / "take.npz", **{**kept, "timestamps": np.array(times)})
    return folder / "take.npz"


def _tum(folder: Path, times: list[float]) -> Path:
    lines = []
    for i, time in enumerate(times):
        cv2.imwrite(str(folder / f"{i}.png"), person_alone(TOF))
        lines.append(f"{time} {i}.png")
    (folder / "camera.json").write_text(json.dumps(dict(zip(("fx", "fy", "cx", "cy"), TOF.intrinsics, strict=True))))
    (folder / "depth.txt").write_text("\n".join(["# depth", *lines, ""]))
    return folder


def _mkv(folder: Path, times: list[float]) -> Path:
    return mkv_recording(folder / "take.mkv", times_us=[round(1e6 * time) for time in times])


def _r3d(folder: Path, times: list[float]) -> Path:
    path = FORMATS["recording r3d"].make(folder)
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    known = json.loads(content["metadata"])
    depth = content["rgbd/0.depth"]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps({**known, "frameTimestamps": times}))
        for i in range(len(times)):
            archive.writestr(f"rgbd/{i}.depth", depth)
    return path


@pytest.mark.parametrize("name", ("0\0.png", "../0.png", ""))
def test_a_list_names_only_files_that_can_be_beside_it(name: str, tmp_path: Path) -> None:
    path = _tum(tmp_path, [0.0, 0.1]) / "depth.txt"
    path.write_text(f"0.0 {name}\n")
    with pytest.raises(RecordingError, match="line 1 of "):
        open_recording(tmp_path)


CLOCKS: dict[str, Callable[[Path, list[float]], Path]] = {"npz": _npz, "tum": _tum, "mkv": _mkv, "r3d": _r3d}


@pytest.mark.parametrize("kind", CLOCKS)
def test_a_clock_that_jumps_back_is_refused_or_put_in_order(kind: str, tmp_path: Path) -> None:
    path = CLOCKS[kind](tmp_path, [1.0, 1.1, 0.4, 1.3])
    try:
        times = open_recording(path).timestamps
    except RecordingError as problem:
        assert "\n" not in str(problem) and "time" in str(problem)
    else:
        assert (np.diff(times) >= 0).all()


@pytest.mark.parametrize("kind", CLOCKS)
def test_a_clock_that_jumps_ahead_once_is_kept(kind: str, tmp_path: Path) -> None:
    times = open_recording(CLOCKS[kind](tmp_path, [1.0, 1.1, 1.2, 3601.2])).timestamps
    np.testing.assert_allclose(np.diff(times), [0.1, 0.1, 3600.0], atol=1e-3)


def _colour_folder(folder: Path) -> Path:
    cv2.imwrite(str(folder / "0.png"), np.zeros((20, 30, 3), np.uint8))
    return folder


def _colour_phone(folder: Path) -> Path:
    path = FORMATS["recording r3d"].make(folder)
    with zipfile.ZipFile(path) as archive:
        known = archive.read("metadata")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", known)
        archive.writestr("rgbd/0.jpg", b"\xff\xd8")
    return path


def _colour_npz(folder: Path) -> Path:
    np.savez(folder / "take.npz", color=np.zeros((2, 20, 30, 3), np.uint8), intrinsics=np.ones(4))
    return folder / "take.npz"


def _colour_scan(folder: Path) -> Path:
    odometry = FORMATS["recording stray odometry"].make(folder)
    for image in (odometry.parent / "depth").iterdir():
        image.unlink()
    return odometry.parent


@pytest.mark.parametrize("make", [_colour_folder, _colour_phone, _colour_npz, _colour_scan])
def test_colour_alone_is_no_recording(make: Callable[[Path], Path], tmp_path: Path) -> None:
    with pytest.raises(RecordingError) as problem:
        recording = open_recording(make(tmp_path), intrinsics=(30.0, 30.0, 14.5, 9.5))
        recording.depth(0)
    assert "\n" not in str(problem.value)


def _held(recording: Recording) -> int:
    """Return the bytes that reading all frames needs at once, beyond those of opening."""
    tracemalloc.start()
    for _ in recording.frames():
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.parametrize("kind", ["mkv", "bag", "mcap"])
def test_frames_are_read_one_at_a_time_however_many_there_are(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count = 60 if kind == "mkv" else 240
    monkeypatch.setattr(container_files, "frames", lambda count=3: [person_alone(TOF)] * count)
    if kind == "mkv":
        path = mkv_recording(tmp_path / "take.mkv", times_us=[33_333 * i for i in range(count)])
    else:
        path = ros_recording(tmp_path / ("take.bag" if kind == "bag" else "take_mcap"), count)
    recording = open_recording(path)
    assert len(recording) == count
    _held(recording)
    assert _held(recording) < 5e6, "of 11 MB and more; bags are read in chunks of a megabyte"
