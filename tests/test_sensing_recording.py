"""Recordings as NPZ: round trip, streaming, and bad files."""

import tracemalloc
import zipfile

import numpy as np
import pytest

from tests.sensing_scenes import TOF, person_alone
from toolkit.io.errors import RecordingError, UsageError
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import RecordingWriter, save_recording
from toolkit.sensing.camera import Camera


def write(path, compressed=True, **changes):
    """Write an NPZ recording of two frames with some arrays replaced, or left out (None)."""
    arrays = {
        "depth": np.stack([person_alone(TOF), person_alone(TOF, 0.1)]),
        "intrinsics": TOF.intrinsics,
        "timestamps": np.array([0.0, 0.1]),
    }
    arrays = {k: v for k, v in {**arrays, **changes}.items() if v is not None}
    (np.savez_compressed if compressed else np.savez)(path, **arrays)
    return path


def test_a_recording_comes_back_as_it_was_saved(tmp_path):
    rng = np.random.default_rng(0)
    depth = rng.integers(500, 5000, (5, *TOF.shape)).astype(np.uint16)
    color = rng.integers(0, 255, (5, *TOF.shape, 3)).astype(np.uint8)
    joints = rng.normal(size=(5, 20, 3)).astype(np.float32)
    joints[2, 3] = np.nan
    camera = Camera(*TOF.intrinsics, TOF.width, TOF.height, (0.1, 0.0, 0.001, 0.0, 0.0))
    path = tmp_path / "take.npz"
    save_recording(
        path, depth=iter(depth), camera=camera, timestamps=np.arange(5) / 25, background=depth[0], color=iter(color),
        up_camera=(0, -0.8, -0.6), joints=joints, reference_joints=joints + 1,
    )  # fmt: skip
    back = open_recording(path)
    assert back.name == "take"
    assert len(back) == 5
    assert back.camera == camera
    assert back.options == {}
    np.testing.assert_array_equal(np.stack(list(back.frames())), depth)
    for i in (3, 4, 0, 2):
        np.testing.assert_array_equal(back.depth(i), depth[i])
        np.testing.assert_array_equal(back.color(i), color[i])
    np.testing.assert_array_equal(back.background, depth[0])
    np.testing.assert_array_equal(back.joints, joints)
    np.testing.assert_array_equal(back.reference_joints, joints + 1)
    np.testing.assert_allclose(back.up_camera, (0, -0.8, -0.6))
    np.testing.assert_allclose(back.timestamps, np.arange(5) / 25)


@pytest.mark.parametrize("compressed", [True, False])
def test_a_long_recording_is_never_held_in_memory(tmp_path, compressed):
    count, image = 400, np.random.default_rng(0).integers(500, 4000, TOF.shape).astype(np.uint16)
    path = tmp_path / "long.npz"
    if compressed:
        tracemalloc.start()
        save_recording(path, depth=(image for _ in range(count)), camera=TOF, timestamps=np.arange(count) / 30)
        written = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert written < 10 * image.nbytes + 4e6, "writing holds a few frames and zlib's window"
    else:
        write(path, compressed=False, depth=np.repeat(image[None], count, axis=0), timestamps=np.arange(count) / 30)
    tracemalloc.start()
    recording = open_recording(path)
    total = sum(int(frame[0, 0]) for frame in recording.frames())
    recording.depth(count - 1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == count * int(image[0, 0])
    assert peak < 10 * image.nbytes + 1e6, f"{peak} bytes for frames of {image.nbytes}"


def test_a_mirrored_recording_is_flipped_with_all_that_belongs_to_it(tmp_path):
    joints = np.zeros((2, 20, 3), dtype=np.float32)
    joints[:, :, 0] = 0.4
    path = write(
        tmp_path / "a.npz", joints=joints, up_camera=np.array([0.6, -0.8, 0.0]),
        background=np.tile(np.arange(1000, 1176, dtype=np.uint16), (144, 1)),
    )  # fmt: skip
    plain, flipped = open_recording(path), open_recording(path, mirrored=True)
    np.testing.assert_array_equal(flipped.depth(1), plain.depth(1)[:, ::-1])
    np.testing.assert_array_equal(flipped.background, plain.background[:, ::-1])
    np.testing.assert_allclose(flipped.joints[..., 0], -0.4)
    np.testing.assert_allclose(flipped.up_camera, (-0.6, -0.8, 0.0))
    assert flipped.camera.cx == TOF.width - 1 - TOF.cx
    assert flipped.options == {"mirrored": True}


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"depth": None}, "has no 'depth'"),
        ({"intrinsics": None}, "no intrinsics; give --intrinsics"),
        ({"intrinsics": np.zeros(4)}, "implausible"),
        ({"intrinsics": np.full(4, np.nan)}, "not finite"),
        ({"intrinsics": np.zeros(3)}, "3 numbers"),
        ({"depth": np.zeros((4, 4), np.uint16)}, r"shape \(4, 4\)"),
        ({"depth": np.zeros((0, *TOF.shape), np.uint16), "timestamps": np.zeros(0)}, "no frame"),
        ({"timestamps": np.zeros(3)}, "one per frame"),
        ({"joints": np.zeros((2, 19, 3))}, r"joints .* shape \(2, 19, 3\)"),
        ({"reference_joints": np.zeros((1, 20, 3))}, "reference_joints"),
        ({"background": np.zeros((4, 4), np.uint16)}, "background"),
        ({"color": np.zeros((2, 4, 4, 3), np.uint8)}, "color"),
        ({"distortion": np.zeros(3)}, "five finite numbers"),
    ],
)
def test_a_wrong_array_is_named(tmp_path, changes, part):
    with pytest.raises(RecordingError, match=part):
        open_recording(write(tmp_path / "a.npz", **changes))


def test_intrinsics_can_be_given_where_the_file_has_none(tmp_path):
    path = write(tmp_path / "a.npz", intrinsics=None)
    assert open_recording(path, intrinsics="220,220,87.5,71.5").camera == TOF
    assert open_recording(path, intrinsics=[220, 220, 87.5, 71.5]).options == {"intrinsics": (220.0, 220.0, 87.5, 71.5)}


@pytest.mark.parametrize("compressed", [True, False])
def test_damaged_frames_are_an_error_when_they_are_read(tmp_path, compressed):
    path = write(tmp_path / "a.npz", compressed=compressed)
    with zipfile.ZipFile(path) as archive:
        middle = archive.getinfo("depth.npy").header_offset + archive.getinfo("depth.npy").compress_size // 2
    data = bytearray(path.read_bytes())
    data[middle : middle + 200] = bytes(200 * [255])
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged"):
        for _ in open_recording(path).frames():
            pass


def test_an_unknown_option_lists_the_known_ones(tmp_path):
    with pytest.raises(UsageError, match=r"unknown reader option 'segment'; give settings=\{'sensing.segment'"):
        open_recording(write(tmp_path / "a.npz"), segment="person")
    with pytest.raises(UsageError, match="unknown reader option 'mirror'; there are: format, mirrored"):
        open_recording(write(tmp_path / "a.npz"), mirror=True)


def test_an_unknown_format_lists_the_known_ones(tmp_path):
    with pytest.raises(UsageError, match="npz, npy, utd_mhad, ros, mkv, .*png, cloud, raw"):
        open_recording(write(tmp_path / "a.npz"), format="oni")


def test_a_frame_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(RecordingError, match="frames 0 to 1"):
        open_recording(write(tmp_path / "a.npz")).depth(2)


def test_nothing_is_left_of_a_recording_that_failed(tmp_path):
    with pytest.raises(RuntimeError), RecordingWriter(tmp_path / "a.npz", TOF) as writer:
        writer.append(person_alone(TOF), 0.0)
        raise RuntimeError("the simulator broke")
    assert list(tmp_path.iterdir()) == []


def test_a_recording_without_frames_is_not_written(tmp_path):
    with pytest.raises(RecordingError, match="at least one"):
        save_recording(tmp_path / "a.npz", depth=[], camera=TOF, timestamps=[])
    assert list(tmp_path.iterdir()) == []
