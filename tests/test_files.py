"""Outputs never damage inputs, locks name their owner, text is not trusted."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit.io import files
from toolkit.io.errors import MocapError, OutputError, UsageError
from toolkit.io.files import (
    LOCK_FILE,
    OWNER_FILE,
    check_output,
    locked,
    sha256_of,
)
from toolkit.io.yaml_reader import parse_json, parse_yaml, read_json


@pytest.mark.parametrize(
    ("output", "inputs"),
    [
        ("a.bvh", ["a.bvh"]),
        ("sub/../a.bvh", ["a.bvh"]),
        ("link.bvh", ["a.bvh"]),
        ("hard.bvh", ["a.bvh"]),
        ("a.bvh", ["linked/a.bvh"]),
        ("sub", ["sub"]),
        ("sub", ["sub/inner/b.bvh"]),
        (".", ["a.bvh"]),
    ],
)
def test_an_output_that_is_or_holds_an_input_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, output: str, inputs: list[str]
) -> None:
    (tmp_path / "sub" / "inner").mkdir(parents=True)
    for name in ("a.bvh", "sub/inner/b.bvh"):
        (tmp_path / name).write_text("motion")
    (tmp_path / "link.bvh").symlink_to("a.bvh")
    (tmp_path / "linked").symlink_to(".")
    os.link(tmp_path / "a.bvh", tmp_path / "hard.bvh")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="choose another output"):
        check_output(output, inputs)


def test_an_output_inside_of_an_input_is_refused_where_the_input_is_sealed(tmp_path: Path) -> None:
    assert check_output(tmp_path / "frames" / "run", [tmp_path / "frames"]) == tmp_path / "frames" / "run"
    with pytest.raises(UsageError, match="outside of it"):
        check_output(tmp_path / "frames" / "run", [tmp_path / "frames"], sealed=[tmp_path / "frames"])


HOLD = """import sys, time
from toolkit.io.files import locked
with locked(sys.argv[1]):
    print('held', flush=True)
    time.sleep(60)
"""


def test_a_lock_names_its_owner_and_ends_with_it(tmp_path: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        with pytest.raises(OutputError, match=f"process {holder.pid} on "), locked(tmp_path):
            pass
    finally:
        holder.kill()
        holder.wait()
    with locked(tmp_path):
        assert {p.name for p in tmp_path.iterdir()} == {".lock", ".lock-owner"}
    assert not list(tmp_path.iterdir())


def _pipe(path: Path) -> None:
    os.mkfifo(path)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "there is no file"),
        (lambda path: path.mkdir(), "it is a folder, a pipe or a device"),
        (_pipe, "it is a folder, a pipe or a device"),
        (lambda path: path.write_bytes(b"\xff\xfe\x00"), "cannot read"),
        (lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 1 << 30), "too many"),
    ],
)
def test_what_is_no_text_file_is_one_sentence(tmp_path: Path, make: Callable[[Path], None], words: str) -> None:
    make(tmp_path / "a.json")
    with pytest.raises(MocapError, match=f"{words}.*; name a motion"):
        read_json(tmp_path / "a.json", MocapError, "name a motion")


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, '{"a": NaN}', "[Infinity]", "9" * 400, "9" * 10_000, "\x00"])
def test_what_is_no_json_is_one_sentence(text: str) -> None:
    with pytest.raises(MocapError, match="the notes is no JSON .*; write them again"):
        parse_json(text, "the notes", MocapError, "write them again")


@pytest.mark.parametrize(
    "text", ["a: &a [1]\nb: *a", "a: [", "a: " + "9" * 400, "a: 2026-99-99", "[" * 5000, "!!python/object:os.system x"]
)
def test_what_is_no_plain_yaml_is_one_sentence(text: str) -> None:
    with pytest.raises(MocapError, match="the notes is no YAML .*; write them again") as error:
        parse_yaml(text, "the notes", MocapError, "write them again")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", [LOCK_FILE, OWNER_FILE])
@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to, lambda path, to: os.mkfifo(path)])
def test_a_lock_never_writes_through_what_lies_in_its_folder(
    tmp_path: Path, name: str, link: Callable[[Path, Path], None]
) -> None:
    (tmp_path / "thesis.txt").write_text("years")
    (tmp_path / "run").mkdir()
    link(tmp_path / "run" / name, tmp_path / "thesis.txt")
    with pytest.raises(OutputError, match="cannot write"), locked(tmp_path / "run"):
        pass
    assert (tmp_path / "thesis.txt").read_text() == "years"


def test_a_digest_of_a_folder_leaves_links_out_and_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "take").mkdir()
    (tmp_path / "take" / "0.png").write_bytes(b"depth")
    before = sha256_of(tmp_path / "take")
    (tmp_path / "take" / "1.png").symlink_to("/dev/zero")
    (tmp_path / "take" / "up").symlink_to("/")
    assert sha256_of(tmp_path / "take") == before
    monkeypatch.setattr(files, "LARGEST_FOLDER", 2)
    with pytest.raises(UsageError, match="more than 2 files"):
        sha256_of(tmp_path / "take")
