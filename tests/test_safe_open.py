"""Safe opening of files: ordinary files only, and no links in a given folder."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit.io import safe_open as door
from toolkit.io.safe_open import is_inside, open_file, read_file

MODES = ("rb", "r+b", "w+b", "a+b")


@pytest.fixture(params=["as it is", "without O_NOFOLLOW"])
def system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Provide this system, and one whose `open` cannot refuse links."""
    if request.param == "without O_NOFOLLOW":
        monkeypatch.setattr(door, "_NO_LINK", 0)


def test_files_are_read_and_written_as_open_does(tmp_path: Path) -> None:
    for mode, expected in (("w+b", b"new"), ("a+b", b"newnew"), ("r+b", b"newnew"), ("w+b", b"new")):
        with open_file(tmp_path / "a", mode, inside=True) as stream:  # type: ignore[arg-type]
            stream.write(b"new")
        assert read_file(tmp_path / "a", 10) == expected
    with pytest.raises(OSError, match="more than 2 bytes"):
        read_file(tmp_path / "a", 2)
    with pytest.raises(FileNotFoundError):
        open_file(tmp_path / "b", "r+b")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("target", ["thesis", "missing", "folder", "link"])
def test_inside_of_a_folder_no_link_is_followed(tmp_path: Path, mode: str, target: str, system: None) -> None:
    (tmp_path / "thesis").write_text("years")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(OSError):
        open_file(tmp_path / "link", mode, inside=True)  # type: ignore[arg-type]
    assert (tmp_path / "thesis").read_text() == "years" and not (tmp_path / "missing").exists()
    assert not is_inside(tmp_path / "link") and is_inside(tmp_path / "thesis")


def test_a_file_that_the_user_names_may_be_a_link(tmp_path: Path) -> None:
    (tmp_path / "take").write_text("depth")
    (tmp_path / "link").symlink_to("take")
    assert read_file(tmp_path / "link", 10) == b"depth"


def test_a_file_with_another_name_is_read_and_not_written(tmp_path: Path) -> None:
    (tmp_path / "thesis").write_text("years")
    os.link(tmp_path / "thesis", tmp_path / "track.partial")
    assert read_file(tmp_path / "track.partial", 10, inside=True) == b"years"
    for mode in MODES[1:]:
        with pytest.raises(OSError, match="another name"):
            open_file(tmp_path / "track.partial", mode, inside=True)  # type: ignore[arg-type]
    assert (tmp_path / "thesis").read_text() == "years"


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir, lambda path: path.symlink_to("/dev/zero")])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("inside", [False, True])
def test_pipes_folders_and_devices_are_refused_at_once(
    tmp_path: Path, make: Callable[[Path], None], mode: str, inside: bool
) -> None:
    make(tmp_path / "a")
    with pytest.raises(OSError):
        open_file(tmp_path / "a", mode, inside=inside)  # type: ignore[arg-type]
