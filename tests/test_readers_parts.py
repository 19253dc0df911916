"""What each reader of recordings decides by itself: which files are frames, by what camera, and which way is up."""

from __future__ import annotations

import sqlite3
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.io.errors import RecordingError
from toolkit.recordings.readers import png, raw, record3d, ros, ros_files, stray, tum, utd_mhad


def touch(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    return folder


# Folders of pictures


def test_images_called_depth_are_the_frames_and_their_namesakes_the_colour(tmp_path: Path) -> None:
    folder = touch(tmp_path, "depth10.png", "depth2.png", "rgb2.png", "rgb10.png")
    assert [file.name for file in png.depth_files(folder)] == ["depth2.png", "depth10.png"]
    assert [file.name for file in png.color_files(folder, png.depth_files(folder))] == ["rgb2.png", "rgb10.png"]
    (folder / "rgb10.png").unlink()
    assert png.color_files(folder, png.depth_files(folder)) == [], "a frame without colour leaves all without"


@pytest.mark.parametrize(
    ("color", "found"),
    [
        (("b.jpg", "a.jpg"), ["a.jpg", "b.jpg"]),
        (("0.jpg", "a.jpg", "b.jpg"), ["a.jpg", "b.jpg"]),
        (("7.jpg", "30.jpg"), ["7.jpg", "30.jpg"]),
        (("a.jpg",), []),
    ],
)
def test_colour_beside_depth_goes_by_stems_else_by_numbers_if_there_are_as_many(
    tmp_path: Path, color: tuple[str, ...], found: list[str]
) -> None:
    touch(tmp_path, "depth/a.png", "depth/b.png", *(f"color/{name}" for name in color))
    assert [file.name for file in png.color_files(tmp_path / "depth", png.depth_files(tmp_path))] == found


def test_a_raw_folder_is_known_by_the_size_of_its_files_and_takes_those_of_their_kind(tmp_path: Path) -> None:
    for name, size in (("2.raw", 2 * 176 * 144), ("10.raw", 4), ("notes.txt", 9), (".hidden", 2 * 176 * 144)):
        (tmp_path / name).write_bytes(b"\0" * size)
    assert raw.matches(tmp_path) and not raw.matches(tmp_path / "notes.txt")
    assert [file.name for file in raw.frame_files(tmp_path)] == ["2.raw", "10.raw"], (
        "the one that is cut short is a frame"
    )
    with pytest.raises(RecordingError, match=r"10\.raw holds 2 values, expected 176x144"):
        raw.read_frame(tmp_path / "10.raw", (144, 176))


def test_a_raw_frame_is_little_endian_and_row_by_row(tmp_path: Path) -> None:
    (tmp_path / "0.raw").write_bytes(bytes([1, 0, 2, 0, 3, 0, 0, 1, 5, 0, 6, 0]))
    np.testing.assert_array_equal(raw.read_frame(tmp_path / "0.raw", (2, 3)), [[1, 2, 3], [256, 5, 6]])


def test_a_list_of_images_has_times_files_and_comments(tmp_path: Path) -> None:
    (tmp_path / "depth.txt").write_text("# time file\n3.5 depth/a.png  # first\n\n4 depth/b.png\n")
    times, files = tum.listed(tmp_path / "depth.txt")
    assert times.tolist() == [3.5, 4.0] and [file.name for file in files] == ["a.png", "b.png"]
    assert tum.matches(tmp_path) and not tum.matches(tmp_path / "depth.txt")


# Phones


def test_a_matrix_of_the_video_is_scaled_about_the_corner_of_the_image(tmp_path: Path) -> None:
    (tmp_path / "camera_matrix.csv").write_text("1500,0,959.5\n0,1400,719.5\n0,0,1\n")
    camera = stray.camera_of(tmp_path / "camera_matrix.csv", (192, 256))
    np.testing.assert_allclose(camera.intrinsics, [200.0, 1400 * 256 / 1920, 127.5, 95.5])


def test_the_vertical_is_the_median_over_an_odometry(tmp_path: Path) -> None:
    upright, aside = "0,0,0,1", "0,0,0.70710678,0.70710678"
    rows = "\n".join(f"{k},{turn}" for k, turn in enumerate((aside, upright, aside)))
    (tmp_path / "odometry.csv").write_text(f"timestamp,qx,qy,qz,qw\n{rows}\n")
    times, up = stray.odometry_of(tmp_path / "odometry.csv")
    assert times.tolist() == [0.0, 1.0, 2.0]
    np.testing.assert_allclose(up, [1.0, 0.0, 0.0], atol=1e-7)


def test_the_camera_of_a_phones_depth_is_that_of_its_colour_column_by_column() -> None:
    known = {"dw": 192, "dh": 256, "w": 768, "h": 1024, "K": [800, 0, 0, 0, 820, 0, 383.5, 501.5, 1]}
    shape, camera, times = record3d.facts_of(known | {"frameTimestamps": [5.0, 5.5]})
    assert shape == (256, 192) and times.tolist() == [0.0, 0.5]
    np.testing.assert_allclose(camera.intrinsics, [200.0, 205.0, 95.5, 125.0])
    assert len(record3d.facts_of(known)[2]) == 0


# Messages


def test_messages_of_a_topic_come_in_the_order_of_time(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "a.db3") as database:
        database.execute("CREATE TABLE topics (id, name, type, serialization_format)")
        database.execute("CREATE TABLE messages (id, topic_id, timestamp, data)")
        database.executemany(
            "INSERT INTO topics VALUES (?, ?, 'sensor_msgs/msg/Image', 'cdr')", [(1, "/depth"), (2, "/color")]
        )
        rows = [(1, 1, 30, b"late"), (2, 2, 20, b"other"), (3, 1, 10, b"early")]
        database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
    file = ros_files.open_messages(tmp_path / "a.db3")
    assert file.topics == {"/depth": "sensor_msgs/Image", "/color": "sensor_msgs/Image"}
    assert file.times("/depth").tolist() == [10, 30]
    assert list(file.messages("/depth")) == [b"early", b"late"] and list(file.messages("/depth", 1)) == [b"late"]


def messages(**topics: str) -> Any:
    return SimpleNamespace(topics={f"/{name.replace('__', '/')}": kind for name, kind in topics.items()}, cdr=True)


def test_the_depth_topic_is_the_only_one_and_colour_counts_where_depth_is_aligned_to_it() -> None:
    file = messages(cam__color__image_raw=ros.IMAGE, cam__aligned_depth_to_color__image_raw=ros.IMAGE)
    depth = ros.depth_topic(Path("take"), file, None)
    assert depth == "/cam/aligned_depth_to_color/image_raw" and ros.color_topic(file, depth) == "/cam/color/image_raw"
    assert ros.color_topic(file, "/cam/depth/image_raw") is None
    both = messages(cam__depth__image=ros.IMAGE, cam__depth__image__compressedDepth=ros.COMPRESSED)
    assert ros.depth_topic(Path("take"), both, None) == "/cam/depth/image", "the same images, compressed"


@pytest.mark.parametrize(
    ("encoding", "behind", "unit"),
    [("32FC1", b"", "m"), ("16UC1", b"", "mm"), ("mono16", struct.pack("<f", 0.00025), 0.00025), ("16UC1", b"x", "mm")],
)
def test_the_unit_is_what_stands_behind_an_image_or_that_of_ros(encoding: str, behind: bytes, unit: Any) -> None:
    picture: Any = SimpleNamespace(encoding=encoding, behind=behind)
    assert ros.unit_of(Path("take"), messages(), "/depth", picture) == unit


# Another skeleton


def test_a_kinect_skeleton_keeps_head_and_limbs_and_gets_our_trunk_with_y_down() -> None:
    kinect = np.full((20, 3, 1), 9.0)  # its own neck, spine and hip centre, which are none of ours
    kinect[0, :, 0] = [0.0, 1.7, 2.0]
    for row, x, y in ((4, -0.2, 1.4), (8, 0.2, 1.4), (12, -0.1, 0.9), (16, 0.1, 0.9)):
        kinect[row, :, 0] = [x, y, 2.0]
    named = dict(zip(skeleton.REPORTED, utd_mhad.joints_from_kinect(kinect)[0].tolist(), strict=True))
    assert named["head"] == pytest.approx([0.0, -1.7, 2.0])
    assert named["left_shoulder"] == pytest.approx([-0.2, -1.4, 2.0])
    assert named["right_hip"] == pytest.approx([0.1, -0.9, 2.0])
    assert named["pelvis"] == pytest.approx([0.0, -0.9, 2.0]) and named["neck"] == pytest.approx([0.0, -1.4, 2.0])
