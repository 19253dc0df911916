"""Parts of container readers, each for itself: Matroska's index, ROS messages, a Kinect's calibration and colour."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as drawn_with
from hypothesis import strategies as st

from tests.container_files import calibration, element, mkv_block, mkv_track, whole
from toolkit.io.errors import RecordingError
from toolkit.recordings.readers import ros_messages as ros
from toolkit.recordings.readers.matroska import Block, Matroska
from toolkit.recordings.readers.mkv import FactoryCalibration, calibration_of, registered
from toolkit.sensing.camera import Camera

HEAD, SEGMENT, CLUSTER, TRACKS = element(0x1A45DFA3, b""), 0x18538067, 0x1F43B675, 0x1654AE6B
UNKNOWN = b"\x01" + 7 * b"\xff"
"""The size of an element that lasts as long as its parent."""


def index_of(path: Path, segment: bytes) -> Matroska:
    path.write_bytes(HEAD + segment)
    return Matroska(path)


def short(identifier: int, content: bytes) -> bytes:
    """An element whose size takes one byte."""
    assert len(content) < 127
    return identifier.to_bytes((identifier.bit_length() + 7) // 8, "big") + bytes([0x80 | len(content)]) + content


# Matroska


@drawn_with(max_examples=30, deadline=None)
@given(
    written=st.lists(st.tuples(st.integers(1, 2), st.integers(-900, 900), st.binary(max_size=20)), max_size=8),
    start=st.integers(1000, 1 << 40),
    scale=st.sampled_from([1, 1000, 1_000_000]),
)
def test_blocks_come_back_by_track_in_the_order_of_time(
    written: list[tuple[int, int, bytes]], start: int, scale: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    blocks = b"".join(mkv_block(number, shift, content) for number, shift, content in written)
    segment = element(0x1549A966, whole(0x2AD7B1, scale))
    segment += element(TRACKS, b"".join(mkv_track(number, f"t{number}", b"b16g", (4, 3)) for number in (1, 2)))
    segment += element(CLUSTER, whole(0xE7, start) + blocks)
    file = index_of(tmp_path_factory.mktemp("mkv") / "a.mkv", element(SEGMENT, segment))
    for track in file.tracks:
        expected = [((start + shift) * scale, content) for number, shift, content in written if number == track.number]
        assert [block.time for block in track.blocks] == sorted(time for time, _ in expected)
        assert sorted((block.time, file.read(block)) for block in track.blocks) == sorted(expected)
    assert [(t.name, t.width, t.height, t.codec) for t in file.tracks] == [
        ("t1", 4, 3, "V_MS/VFW/FOURCC"), ("t2", 4, 3, "V_MS/VFW/FOURCC")
    ]  # fmt: skip


def test_elements_of_unknown_size_last_as_long_as_their_parent_and_sizes_may_be_short(tmp_path: Path) -> None:
    cluster = whole(0xE7, 5) + short(0xA0, short(0xA1, b"\x81\x00\x02\x00depth"))  # a block in its group
    segment = element(TRACKS, mkv_track(1, "DEPTH", b"b16g", (4, 3)))
    segment += CLUSTER.to_bytes(4, "big") + UNKNOWN + cluster
    file = index_of(tmp_path / "a.mkv", SEGMENT.to_bytes(4, "big") + UNKNOWN + segment)
    (block,) = file.tracks[0].blocks
    assert block.time == 7_000_000 and file.read(block) == b"depth"


def test_attachments_go_by_their_names_and_what_matters_to_nobody_is_passed_over(tmp_path: Path) -> None:
    files = b"".join(element(0x61A7, element(0x466E, name) + element(0x465C, name * 3)) for name in (b"a", b"b"))
    file = index_of(tmp_path / "a.mkv", element(SEGMENT, element(0xEC, b"void") + element(0x1941A469, files)))
    assert file.attachments == {"a": b"aaa", "b": b"bbb"} and file.tracks == []


@pytest.mark.parametrize(
    ("segment", "words"),
    [
        (element(CLUSTER, mkv_block(1, 0, b"")[:-1]), "ends within an element"),
        (element(TRACKS, whole(0xB0, 4)), "before the first track"),
        (element(CLUSTER, element(0xA3, b"\x81\x00")), "cut short"),
        (element(CLUSTER, b"\x00"), "or holds what is none"),
        (element(0x1941A469, element(0x465C, bytes((1 << 24) + 1))), "has 16777217 bytes"),
    ],
    ids=["cut", "no track", "short block", "no element", "large"],
)
def test_a_damaged_index_is_named(tmp_path: Path, segment: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        index_of(tmp_path / "a.mkv", element(SEGMENT, segment))


def test_a_block_beyond_the_end_is_not_read(tmp_path: Path) -> None:
    file = index_of(tmp_path / "a.mkv", element(SEGMENT, b""))
    with pytest.raises(ValueError, match="within the 9 bytes from 40 on"):
        file.read(Block(0, 40, 9))


# ROS messages


def ros1(*fields: tuple[str, Any]) -> bytes:
    """Fields one after the other, little-endian, texts with their length in front."""
    return b"".join(
        struct.pack("<I", len(value)) + value if code == "s" else struct.pack(f"<{code}", value)
        for code, value in fields
    )


def cdr(*fields: tuple[str, Any], big: bool = False) -> bytes:
    """The same in ROS 2's form: numbers aligned to their size, texts ended by a zero."""
    order, out = ">" if big else "<", b""
    for code, value in fields:
        size = 4 if code == "s" else struct.calcsize(code)
        out += bytes(-len(out) % size)
        if code == "s":
            out += struct.pack(f"{order}I", len(value) + 1) + value + b"\0"
        else:
            out += struct.pack(order + code, value)
    return bytes([0, not big, 0, 0]) + out


NUMBERS = st.one_of(
    st.tuples(st.just("B"), st.integers(0, 255)),
    st.tuples(st.just("I"), st.integers(0, 2**32 - 1)),
    st.tuples(st.just("i"), st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just("d"), st.floats(allow_nan=False)),
    st.tuples(st.just("f"), st.floats(allow_nan=False, width=32)),
    st.tuples(st.just("s"), st.text(st.characters(codec="ascii", exclude_characters="\0")).map(str.encode)),
)


@drawn_with(max_examples=60, deadline=None)
@given(fields=st.lists(NUMBERS, max_size=8))
@pytest.mark.parametrize(
    ("pack", "two"), [(ros1, False), (cdr, True), (lambda *f: cdr(*f, big=True), True)], ids=["1", "2", "2, big-endian"]
)
def test_a_cursor_reads_what_was_packed(pack: Callable[..., bytes], two: bool, fields: list[tuple[str, Any]]) -> None:
    cursor = ros.Cursor(pack(*fields), two)
    for code, value in fields:
        assert (cursor.text().encode() if code == "s" else cursor.numbers(code, 1)[0]) == value
    assert not cursor.rest()
    with pytest.raises(ValueError, match="1 bytes too early"):
        cursor.take(1)


@pytest.mark.parametrize("data", [b"", b"\0\1", b"\0\7\0\0"])
def test_what_does_not_begin_as_ros_2_does_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="no ROS 2 message"):
        ros.Cursor(data, True)


HEADER = {False: [("I", 1)], True: []}
"""The running number that ROS 1 has in front."""


def message(two: bool, *fields: tuple[str, Any]) -> bytes:
    stamped = [*HEADER[two], ("I", 12), ("I", 500_000_000), ("s", b"optical")]
    return (cdr if two else ros1)(*stamped, *fields)


@pytest.mark.parametrize("two", [False, True])
def test_a_header_and_an_acceleration_are_those_of_the_message(two: bool) -> None:
    data = message(two, *[("d", 7.0)] * 25, ("d", 1.0), ("d", -9.8), ("d", 0.5), *[("d", 7.0)] * 9)
    assert ros.read_header(ros.Cursor(data, two)) == "optical"
    frame, measured = ros.acceleration(data, two)
    assert frame == "optical" and measured.tolist() == [1.0, -9.8, 0.5]


@pytest.mark.parametrize("two", [False, True])
def test_a_camera_is_that_of_the_message(two: bool) -> None:
    lens, matrix, turn, projection = (
        [base + k for k in range(n)] for base, n in ((0.5, 5), (10, 9), (90, 9), (20, 12))
    )
    floats = [("d", float(value)) for values in (matrix, turn, projection) for value in values]
    data = message(two, ("I", 48), ("I", 64), ("s", b"plumb_bob"), ("I", 5), *[("d", v) for v in lens], *floats)
    info = ros.camera_info(data, two)
    assert (info.shape, info.model) == ((48, 64), "plumb_bob")
    assert (info.D, info.K, info.P) == (tuple(lens), tuple(matrix), tuple(projection))


def image(pixels: np.ndarray, encoding: bytes, *, big: bool = False, padding: int = 0) -> bytes:
    """A picture's message whose rows end in `padding` bytes that are none of its pixels."""
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if big else "<"))
    rows = [row.tobytes() + b"\xee" * padding for row in stored]
    head = [("I", len(pixels)), ("I", pixels.shape[1]), ("s", encoding), ("B", big), ("I", len(rows[0]))]
    return message(False, *head, ("s", b"".join(rows)))


DEPTH = np.arange(12, dtype=np.uint16).reshape(3, 4) * 1000


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize(("encoding", "kind"), [(b"16UC1", "u2"), (b"mono16", "u2"), (b"32FC1", "f4")])
def test_depth_comes_back_whatever_its_bytes_and_its_rows_end_in(
    big: bool, padding: int, encoding: bytes, kind: str
) -> None:
    found = ros.picture(image(DEPTH.astype(kind), encoding, big=big, padding=padding) + b"unit", False)
    np.testing.assert_array_equal(found.pixels, DEPTH)
    assert found.pixels.dtype == kind and found.encoding == encoding.decode() and found.behind == b"unit"


@pytest.mark.parametrize(("encoding", "order"), [(b"rgb8", [0, 1, 2]), (b"bgr8", [2, 1, 0]), (b"bgra8", [2, 1, 0])])
def test_colour_is_red_green_blue(encoding: bytes, order: list[int]) -> None:
    color = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    stored = color[:, :, order]
    if encoding == b"bgra8":
        stored = np.concatenate([stored, np.full((2, 4, 1), 255, np.uint8)], axis=2)
    found = ros.picture(image(stored, encoding), False)
    np.testing.assert_array_equal(found.pixels, color)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (image(DEPTH, b"8UC1"), "its images are 8UC1"),
        (image(DEPTH, b"32FC1"), "4x3 32FC1 has 24 bytes"),
        (image(DEPTH[:, :0], b"16UC1"), "0x3 16UC1 has 0 bytes"),
        (image(DEPTH, b"16UC1")[:-2], "2 bytes too early"),
    ],
    ids=["other", "narrow rows", "empty", "cut"],
)
def test_a_picture_that_is_none_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ros.picture(data, False)


def compressed(form: bytes, picture: np.ndarray, a: float = 0.0, b: float = 0.0) -> bytes:
    content = cv2.imencode(".png", picture)[1].tobytes()
    return message(False, ("s", form), ("s", (struct.pack("<iff", 0, a, b) if b"Depth" in form else b"") + content))


def test_quantised_depth_comes_back_to_within_its_steps() -> None:
    """`value = A / depth + B`, as the transport writes it for up to 10 m: near depths are fine, unmeasured ones 0."""
    a, b = 10_100.0, -1009.0
    metres = np.array([[0.0, 0.5, 1.0], [2.0, 5.0, 9.5]], np.float32)
    with np.errstate(divide="ignore"):
        values = np.where(metres > 0, a / metres + b, 0.0).astype(np.uint16)
    found = ros.compressed_picture(compressed(b"32FC1; compressedDepth png", values, a, b), False).pixels
    step = metres**2 / a  # the change of depth from one value to the next
    assert found.dtype == np.float32 and (np.abs(found - metres) <= 1.01 * step + 1e-6).all()


def test_compressed_depth_in_millimetres_and_compressed_colour_come_back() -> None:
    depth = ros.compressed_picture(compressed(b"16UC1; compressedDepth", DEPTH), False)
    np.testing.assert_array_equal(depth.pixels, DEPTH)
    color = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    found = ros.compressed_picture(compressed(b"bgr8; png compressed bgr8", color[:, :, ::-1]), False)
    np.testing.assert_array_equal(found.pixels, color)


@pytest.mark.parametrize("form", [b"16UC1; compressedDepth", b"16UC3; compressedDepth"])
def test_compressed_depth_of_eight_bits_or_another_encoding_is_refused(form: bytes) -> None:
    pixels = DEPTH.astype(np.uint8) if form.startswith(b"16UC1") else DEPTH
    with pytest.raises(ValueError, match="write it as 16UC1 PNG"):
        ros.compressed_picture(compressed(form, pixels), False)
    with pytest.raises(ValueError, match="cannot be decoded"):
        ros.compressed_picture(message(False, ("s", b"jpeg"), ("s", b"no picture")), False)


# A Kinect's calibration and colour


def stored(**changes: Any) -> str:
    return json.dumps(calibration() | changes)


@pytest.mark.parametrize(
    ("size", "binned", "corner"),
    [((640, 576), 1, (192, 180)), ((320, 288), 2, (96, 90)), ((512, 512), 2, (0, 0)), ((1024, 1024), 1, (0, 0))],
)
def test_a_mode_of_the_depth_camera_is_a_window_of_the_whole_sensor(
    size: tuple[int, int], binned: int, corner: tuple[int, int]
) -> None:
    """A point seen in the middle of a sensor's pixel is seen at the same ray in the binned and cut image."""
    content = calibration()
    cx, cy, fx, fy = 0.49, 0.52, 0.5, 0.51
    content["CalibrationInformation"]["Cameras"][0]["Intrinsics"]["ModelParameters"][:4] = [cx, cy, fx, fy]
    camera = calibration_of(json.dumps(content), size, None, "a.mkv").depth
    point = np.array([0.3, -0.2, 2.0])
    on_sensor = 1024 * (np.array([fx, fy]) * point[:2] / point[2] + [cx, cy])  # from its corner, in its pixels
    np.testing.assert_allclose(camera.project(point), on_sensor / binned - corner - 0.5, atol=1e-9)
    assert (camera.width, camera.height) == size


def test_lens_and_poses_are_those_of_the_file_and_a_wide_picture_is_cut_from_the_sensor() -> None:
    content = calibration()
    depth, color = content["CalibrationInformation"]["Cameras"]
    depth["Intrinsics"]["ModelParameters"][4:] = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.0, 0.0, 0.001, 0.002]
    turn = cv2.Rodrigues(np.array([0.1, 0.0, 0.0]))[0]
    color["Rt"] = {"Rotation": turn.ravel().tolist(), "Translation": [-0.03, 0.002, 0.004]}
    found = calibration_of(json.dumps(content), (320, 288), (1920, 1080), "a.mkv")
    assert found.depth.distortion == (0.01, 0.02, 0.002, 0.001, 0.03, 0.04, 0.05, 0.06)
    np.testing.assert_allclose(found.R_color_depth, turn)
    np.testing.assert_allclose(found.t_color_depth, [-0.03, 0.002, 0.004])
    assert found.color is not None and found.color.cy == 0.5 * 1440 - 180 - 0.5  # of 1440 rows the middle 1080
    np.testing.assert_array_equal(found.R_imu_depth, [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert calibration_of(stored(), (320, 288), None, "a.mkv").color is None


@pytest.mark.parametrize(
    ("text", "size", "words"),
    [
        ("{", (320, 288), "the calibration of a.mkv"),
        (stored(), (640, 480), "640x480 pixels, no mode of the sensor"),
        (stored(CalibrationInformation={"Cameras": [{"Purpose": "Depth"}]}), (320, 288), "is incomplete"),
    ],
    ids=["no JSON", "no mode", "no intrinsics"],
)
def test_a_calibration_that_is_none_is_named(text: str, size: tuple[int, int], words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        calibration_of(text, size, None, "a.mkv")


def test_colour_is_looked_up_where_each_measured_pixel_lies() -> None:
    """Against one point at a time; what the colour camera does not see, and what is not measured, is black."""
    depth_camera = Camera(40.0, 40.0, 15.5, 11.5, 32, 24)
    color_camera = Camera(50.0, 52.0, 19.0, 15.0, 40, 30)
    turn, shift = cv2.Rodrigues(np.array([0.02, -0.05, 0.1]))[0], np.array([-0.2, 0.03, 0.01])
    rng = np.random.default_rng(0)
    depth = rng.integers(900, 3000, (24, 32)).astype(np.uint16)
    depth[rng.random(depth.shape) < 0.2] = 0
    color = rng.integers(1, 256, (30, 40, 3)).astype(np.uint8)
    expected = np.zeros((24, 32, 3), np.uint8)
    for v, u in np.argwhere(depth):
        z = depth[v, u] / 1000
        point = np.array([(u - 15.5) / 40 * z, (v - 11.5) / 40 * z, z])
        x, y = np.rint(color_camera.project(turn @ point + shift)).astype(int)
        if 0 <= x < 40 and 0 <= y < 30:
            expected[v, u] = color[y, x]
    found = registered(depth, color, FactoryCalibration(depth_camera, color_camera, turn, shift, np.eye(3)))
    np.testing.assert_array_equal(found, expected)
    seen = found.any(axis=2)
    assert 0.5 < seen[depth > 0].mean() < 1.0 and not seen[depth == 0].any()
    blind = FactoryCalibration(depth_camera, None, turn, shift, np.eye(3))
    assert not registered(depth, color, blind).any()
