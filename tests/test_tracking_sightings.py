"""Stored sightings of an unfinished second pass, read back to the bit and without trust."""

import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from toolkit.io.errors import OutputError, TrackError
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D
from toolkit.tracking.sightings import ENTRY, HEADER, SightingFile, StoredSighting

CAMERA = Camera(100.0, 100.0, 40.0, 30.0, 80, 60)


def sighting(number: int, person: int = 1) -> Sighting:
    """Return a person whose depth, mask and joints all depend on `number`."""
    depth, unobserved = np.zeros(CAMERA.shape, dtype=np.float32), np.zeros(CAMERA.shape, dtype=np.bool_)
    rows = slice(number % 7, 20 + number)
    depth[rows, 11:33] = ((1800 + np.arange(22) + number) * float(np.float32(1e-3))).astype(np.float32)
    unobserved[number : number + 3] = True
    joints = Joints2D.of_rows(np.full((20, 3), 0.5) + number) if number % 2 else None
    return Sighting(person, depth, unobserved if number % 3 else None, CAMERA, joints)


def assert_same(one: Sighting | None, other: Sighting | None) -> None:
    assert one is not None and other is not None and one.id == other.id
    np.testing.assert_array_equal(one.depth, other.depth)
    assert (one.unobserved is None) == (other.unobserved is None)
    if one.unobserved is not None and other.unobserved is not None:
        np.testing.assert_array_equal(one.unobserved, other.unobserved)
    assert (one.joints is None) == (other.joints is None)
    if one.joints is not None and other.joints is not None:
        np.testing.assert_array_equal(one.joints.rows, other.joints.rows)


def test_sightings_are_read_back_to_the_bit_in_any_order(tmp_path: Path) -> None:
    kept = SightingFile(tmp_path, CAMERA)
    for frame in range(8):
        nothing = replace(sighting(frame), depth=np.zeros_like(sighting(frame).depth))
        kept.append(frame, [sighting(frame) if frame != 3 else nothing])
        kept.append(frame, [sighting(frame + 10, person=2)])
    first, second = kept.of(1), kept.of(2)
    assert first.frames.tolist() == [0, 1, 2, 4, 5, 6, 7] and second.frames.tolist() == list(range(8))
    assert first[3] is None and first[8] is None
    for frame in (7, 0, 5):
        assert_same(first[frame], sighting(frame))
        assert_same(second[frame], sighting(frame + 10, person=2))
    assert first.pixels[2] == np.count_nonzero(sighting(2).depth)


def test_earlier_sightings_may_lie_in_another_file(tmp_path: Path) -> None:
    kept, earlier = SightingFile(tmp_path / "kept", CAMERA), SightingFile(tmp_path / "earlier", CAMERA)
    for frame in (1, 2, 5, 6):
        (earlier if frame < 5 else kept).append(frame, [sighting(frame)])
    seen = kept.of(1, earlier.of(1))
    assert seen.frames.tolist() == [1, 2, 5, 6] and seen[0] is None and seen[3] is None and seen[7] is None
    assert seen.pixels.tolist() == [np.count_nonzero(sighting(frame).depth) for frame in (1, 2, 5, 6)]
    for frame in (5, 1, 6, 2):
        assert_same(seen[frame], sighting(frame))


def test_sightings_of_a_killed_run_go_on_after_its_last_checkpoint(tmp_path: Path) -> None:
    kept = SightingFile(tmp_path, CAMERA)
    for frame in range(6):
        kept.append(frame, [sighting(frame)])
    kept.flush()  # the killed process wrote two frames more than its checkpoint
    again = SightingFile(tmp_path, CAMERA, frames=4)
    again.append(4, [sighting(14)])
    seen = again.of(1)
    assert seen.frames.tolist() == [0, 1, 2, 3, 4]
    assert_same(seen[3], sighting(3))
    assert_same(seen[4], sighting(14))
    again.close()
    (tmp_path / "sightings.data").write_bytes(b"")
    with pytest.raises(TrackError, match="lost some of its sightings"):
        SightingFile(tmp_path, CAMERA, frames=4)


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
@pytest.mark.parametrize("name", ["sightings.index", "sightings.data", "folder"])
def test_nothing_of_a_second_pass_is_written_through_a_link(
    tmp_path: Path, link: Callable[[Path, Path], None], name: str
) -> None:
    thesis, folder = tmp_path / "thesis.txt", tmp_path / "second"
    thesis.write_text("years")
    if name == "folder":
        (tmp_path / "elsewhere").mkdir()
        folder.symlink_to(tmp_path / "elsewhere")
    else:
        folder.mkdir()
        link(folder / name, thesis)
    with pytest.raises(OutputError, match="is a link|another name"):
        SightingFile(folder, CAMERA)
    assert thesis.read_text() == "years" and not list(tmp_path.glob("elsewhere/*"))


def kept_sighting(window: tuple[int, int, int, int], mask: int = 0, joints: int = 0, pixels: int = 12) -> bytes:
    """Return a stored sighting of a header and some pixels."""
    header = np.array([(window, mask, joints)], dtype=HEADER)
    return zlib.compress(header.tobytes() + np.full(pixels, 2000, "<u2").tobytes())


WINDOW = (0, 3, 0, 4)
"""Window of twelve pixels."""


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"years",
        kept_sighting((0, 3, 0, 99)),
        kept_sighting((-3, 1, 0, 3)),
        kept_sighting((3, 0, 4, 0)),
        kept_sighting(WINDOW, mask=5),
        kept_sighting(WINDOW, joints=-1),
        kept_sighting(WINDOW, joints=8),
        kept_sighting(WINDOW, pixels=11),
        kept_sighting(WINDOW, pixels=1 << 24),
    ],
)
def test_a_sighting_that_this_camera_cannot_have_seen_is_one_sentence(tmp_path: Path, data: bytes) -> None:
    with pytest.raises((ValueError, zlib.error)):
        StoredSighting.unpacked(data, 1, CAMERA)
    kept = SightingFile(tmp_path, CAMERA)
    kept.append(0, [sighting(0)])
    kept.close()
    entries = np.fromfile(tmp_path / "sightings.index", dtype=ENTRY)
    entries["end"] = len(data)
    entries.tofile(tmp_path / "sightings.index")
    (tmp_path / "sightings.data").write_bytes(data)
    with pytest.raises(TrackError, match="frame 0 in .* is damaged"):
        SightingFile(tmp_path, CAMERA, 1).of(1)[0]


def test_an_empty_sighting_is_kept_too() -> None:
    nobody = Sighting(1, np.zeros(CAMERA.shape, dtype=np.float32), None, CAMERA)
    assert_same(StoredSighting.unpacked(StoredSighting.of(nobody).packed(), 1, CAMERA).sighting(), nobody)
