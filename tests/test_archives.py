"""The project's NPZ files: round trip, and the error for each kind of bad file."""

import io
import os
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from toolkit.io import archives
from toolkit.io.archives import Column, check_columns, checksum_of, load_archive, save_archive
from toolkit.io.errors import MocapError, TrackError


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def archive(path: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as out:
        for name, data in members.items():
            out.writestr(name, data)
    return path


def header(text: str, data: bytes = b"") -> bytes:
    """Return an NPY file of version 1.0 with this header."""
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode() + data


@given(
    array=arrays_of.arrays(
        st.sampled_from(["<f4", ">f8", "<i4", ">u2", "?", "<U3"]), arrays_of.array_shapes(min_side=0)
    )
)
def test_arrays_come_back_in_this_machine_s_byte_order(
    array: np.ndarray, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("archives") / "a.npz"
    save_archive(path, {"a": array, "b": np.asfortranarray(array)})
    read = load_archive(path, MocapError, "")
    for name in "ab":
        np.testing.assert_array_equal(read[name], array)
        assert read[name].dtype.isnative and read[name].dtype == array.dtype.newbyteorder("=")


def test_the_checksum_covers_names_types_shapes_and_values_but_no_order() -> None:
    array = np.arange(6, dtype=np.int32)
    same = [checksum_of({"a": array, "b": array}), checksum_of({"b": array, "a": array})]
    others = [{"a": array}, {"a": array.astype(np.uint32), "b": array}, {"a": array.reshape(2, 3), "b": array}]
    others += [{"a": array + 1, "b": array}, {"c": array, "b": array}]
    assert len({*same}) == 1 and len({same[0], *map(checksum_of, others)}) == 6


def _flip(path: Path) -> None:
    save_archive(path, {"a": np.zeros(100)}, compressed=False)
    data = bytearray(path.read_bytes())
    data[200] ^= 1
    path.write_bytes(bytes(data))


def _swap(path: Path) -> None:
    np.savez(path, a=np.ones(3), checksum=checksum_of({"a": np.zeros(3)}))


def _encrypt(path: Path) -> None:
    data = bytearray(archive(path, {"a.npy": npy(np.zeros(3))}).read_bytes())
    for mark in (b"PK\x03\x04", b"PK\x01\x02"):
        data[data.index(mark) + (6 if mark == b"PK\x03\x04" else 8)] |= 1
    path.write_bytes(bytes(data))


def _method(path: Path) -> None:
    data = bytearray(archive(path, {"a.npy": npy(np.zeros(3))}).read_bytes())
    for mark in (b"PK\x03\x04", b"PK\x01\x02"):
        place = data.index(mark) + (8 if mark == b"PK\x03\x04" else 10)
        data[place : place + 2] = (99).to_bytes(2, "little")
    path.write_bytes(bytes(data))


def _hide(path: Path) -> None:
    """Return a directory entry whose length covers the second entry as its comment."""
    data = bytearray(archive(path, {"a.npy": npy(np.zeros(3)), "b.npy": npy(np.zeros(3))}).read_bytes())
    entry, end = data.index(b"PK\x01\x02"), data.index(b"PK\x05\x06")
    data[entry + 32 : entry + 34] = (end - data.rindex(b"PK\x01\x02")).to_bytes(2, "little")
    path.write_bytes(bytes(data))


class Evil:
    """Class that runs code when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, ("unpickled",)


BAD: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "a folder": lambda path: path.mkdir(),
    "a pipe": lambda path: os.mkfifo(path),
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("hello, world"),
    "a single array": lambda path: path.write_bytes(npy(np.zeros(3))),
    "a flipped byte": _flip,
    "another checksum": _swap,
    "a hidden member": _hide,
    "an encrypted member": _encrypt,
    "a compression of tomorrow": _method,
    "a pickle": lambda path: archive(path, {"a.npy": npy(np.array([Evil()], dtype=object))}),
    "a pickle called an array": lambda path: archive(path, {"a.npy": pickle.dumps(Evil())}),
    "no array": lambda path: archive(path, {"a.npy": b"none"}),
    "a foreign file": lambda path: archive(path, {"readme.txt": b"none"}),
    "an array twice": lambda path: archive(path, {"a.npy": npy(np.zeros(3)), "a": b""}),
    "complex numbers": lambda path: archive(path, {"a.npy": npy(np.zeros(3, complex))}),
    "dates": lambda path: archive(path, {"a.npy": npy(np.zeros(3, "M8[s]"))}),
    "a record type": lambda path: archive(path, {"a.npy": npy(np.zeros(3, [("x", "f4")]))}),
    "a billion frames": lambda path: archive(
        path, {"a.npy": header("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000, 480, 640)}\n", b"1234")}
    ),
    "fewer than no frames": lambda path: archive(
        path, {"a.npy": header("{'descr': '<f4', 'fortran_order': False, 'shape': (-3, -1)}\n", b"x" * 12)}
    ),
    "a nested header": lambda path: archive(path, {"a.npy": header("(" * 5000)}),
    "a header that is no table": lambda path: archive(path, {"a.npy": header("[1, 2]\n")}),
    "characters that do not exist": lambda path: archive(
        path, {"a.npy": header("{'descr': '<U1', 'fortran_order': False, 'shape': (1,)}\n", b"\xff\xff\xff\x7f")}
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_one_sentence_of_the_caller_s_family(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    BAD[kind](tmp_path / "a.npz")
    with pytest.raises(MocapError) as problem:
        load_archive(tmp_path / "a.npz", MocapError, "make it again")
    assert str(tmp_path / "a.npz") in str(problem.value) and "\n" not in str(problem.value)
    assert "pickle" not in str(problem.value).lower() and "unsafe" not in str(problem.value)
    assert not (tmp_path / "unpickled").exists()


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        (Column("f"), np.zeros(3, int), "must be numbers"),
        (Column("iu"), np.zeros(3), "must be whole numbers"),
        (Column("U"), 3.0, "must be text"),
        (Column("f", (3,)), np.zeros(4), r"shape \(4,\); expected \(3\)"),
        (Column("f", ("n", "n")), np.zeros((2, 3)), "shape"),
        (Column("f"), [1.0, np.nan], "not finite"),
        (Column("f", gaps=True, high=1.0), [np.nan, 2.0], "holds 2, outside -inf to 1"),
        (Column("iu", low=0), [3, -1], "holds -1"),
    ],
)
def test_a_column_that_is_not_what_it_must_be_is_named(column: Column, value: object, words: str) -> None:
    with pytest.raises(MocapError, match=f"^size of the take .*{words}.*; record it again$"):
        check_columns({"size": value}, {"size": column}, MocapError, "the take", "record it again")


def test_columns_that_are_as_they_must_be_pass() -> None:
    columns = {"a": Column("f", ("n", 2), -1, 1, gaps=True), "b": Column("b", ("n",)), "absent": Column("f")}
    check_columns({"a": [[1.0, np.nan]], "b": [True]}, columns, MocapError, "", "")
    with pytest.raises(MocapError, match="shape"):
        check_columns({"a": [[1.0, np.nan]], "b": [True, False]}, columns, MocapError, "", "")


def test_what_unpacks_to_more_than_it_could_need_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_archive(tmp_path / "a.npz", {"joints": np.zeros(100_000), "small": np.zeros(3)})
    monkeypatch.setattr(archives, "_read_whole", lambda *_: pytest.fail("it was unpacked"))
    with pytest.raises(TrackError, match="unpacks to 800128 bytes, more than the 1000 that it could need"):
        load_archive(tmp_path / "a.npz", TrackError, "", only=["joints"], most=1000)
