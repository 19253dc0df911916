"""Parts of container readers: Matroska index, ROS messages, calibration and colour of a Kinect."""

import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as drawn_with
from hypothesis import strategies as st

from tests.container_files import calibration, element, mkv_block, mkv_track, whole
from toolkit.recordings.readers import ros
from toolkit.recordings.readers.matroska import Matroska
from toolkit.recordings.readers.mkv import FactoryCalibration, registered
from toolkit.sensing.camera import Camera

HEAD, SEGMENT, CLUSTER, TRACKS = element(0x1A45DFA3, b""), 0x18538067, 0x1F43B675, 0x1654AE6B


def index_of(path: Path, segment: bytes) -> Matroska:
    path.write_bytes(HEAD + segment)
    return Matroska(path)


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


# ROS messages


def image(pixels: np.ndarray, encoding: str, *, big: bool = False, padding: int = 0) -> SimpleNamespace:
    """Return an image message whose rows end in `padding` bytes."""
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if big else "<"))
    rows = [row.tobytes() + b"\xee" * padding for row in stored]
    return SimpleNamespace(
        encoding=encoding, height=len(pixels), width=pixels.shape[1], step=len(rows[0]), is_bigendian=int(big),
        data=np.frombuffer(b"".join(rows), np.uint8),
    )  # fmt: skip


DEPTH = np.arange(12, dtype=np.uint16).reshape(3, 4) * 1000


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize(("encoding", "kind"), [("16UC1", "u2"), ("mono16", "u2"), ("32FC1", "f4")])
def test_depth_comes_back_whatever_its_bytes_and_its_rows_end_in(
    big: bool, padding: int, encoding: str, kind: str
) -> None:
    found = ros.raw_pixels(image(DEPTH.astype(kind), encoding, big=big, padding=padding))
    np.testing.assert_array_equal(found, DEPTH)
    assert found.dtype == kind


def test_quantised_depth_comes_back_to_within_its_steps() -> None:
    """`value = A / depth + B`, as the transport writes it for up to 10 m: near depths are fine, unmeasured ones 0."""
    a, b = 10_100.0, -1009.0
    metres = np.array([[0.0, 0.5, 1.0], [2.0, 5.0, 9.5]], np.float32)
    with np.errstate(divide="ignore"):
        values = np.where(metres > 0, a / metres + b, 0.0).astype(np.uint16)
    content = struct.pack("<iff", 0, a, b) + cv2.imencode(".png", values)[1].tobytes()
    message = SimpleNamespace(format="32FC1; compressedDepth png", data=np.frombuffer(content, np.uint8))
    found = ros.compressed_pixels(message)
    step = metres**2 / a  # the change of depth from one value to the next
    assert found.dtype == np.float32 and (np.abs(found - metres) <= 1.01 * step + 1e-6).all()


# A Kinect's calibration and colour


def stored(**changes: Any) -> str:
    return json.dumps(calibration() | changes)


def test_colour_is_looked_up_where_each_measured_pixel_lies() -> None:
    """Against one point at a time; pixels out of the colour camera's view, and unmeasured ones, are black."""
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
