"""Seeded mutations of files, and what became of reading them.

A damaged file may be refused with an error of the project, or read with its meaning unchanged. A foreign exception is a
finding; so is another meaning where the format carries a checksum. Text and plain images carry none: a digit that is
another digit is another file. What the formats are stands in `tests/fuzz_formats.py`.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from toolkit.io.archives import CHECKSUM, checksum_of
from toolkit.io.errors import DepthMocapError

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
NUMBERS = (0, -1, 1, 2, 127, 65535, 2**31 - 1, -(2**31), 1e-30, 1e30, np.nan, np.inf)
"""Numbers that mutations put into arrays, as far as their types hold them."""
KINDS = (0, 0, 1, 1, 1, 2, 3, 3, 4, 5, 5, 6)
"""Kinds of changes of bytes; a cut is rare, for nearly every cut file is refused."""

VALUES: tuple[Any, ...] = (
    None, True, 0, 1, -1, 2.5, 1e-30, 1e30, 1e308, 2**31, 2**53 + 1, 10**30, "", "x", "-1", "nan", "a\nb", "\x1b[31m",
    "../x", "/", "x" * 3000, [], {}, [[]], [None], [1.5] * 40, {"a": 1},
)  # fmt: skip
"""What mutations put in place of a value of JSON or YAML."""

Mutation = Callable[[bytes, np.random.Generator], bytes]


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Random changes of the bytes; half the time of a zip's, those of one file in it, packed again."""
    if data.startswith(b"PK") and rng.random() < 0.5:
        return _repacked(data, rng, lambda _: changed)
    return changed(data, rng)


def changed(data: bytes, rng: np.random.Generator) -> bytes:
    """Mostly one or two changes: a flipped bit, a byte, a cut, a hole, a copy, a piece put in, bytes swapped."""
    out = bytearray(data)
    for _ in range(int(rng.geometric(0.6))):
        size = max(1, len(out))
        at, other = (int(p) for p in rng.integers(0, size, 2))
        length = int(min(rng.geometric(0.1), size))
        kind = KINDS[int(rng.integers(len(KINDS)))]
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


def revalued(data: bytes, rng: np.random.Generator) -> bytes:
    """JSON, its first line, or YAML, in which one or two values are others, stand twice or are left out.

    What is neither (any more) has its bytes changed.
    """
    known = _plain(data)
    if known is None:
        return changed(data, rng)
    value, dumped, after = known
    for _ in range(int(rng.geometric(0.7))):
        places = list(_places(value))
        if not places:
            break
        inside, key = places[int(rng.integers(len(places)))]
        kind = int(rng.integers(10))
        if kind == 0:
            del inside[key]
        elif kind == 1 and isinstance(inside, list):
            inside.insert(key, inside[key])
        else:
            inside[key] = deepcopy(VALUES[int(rng.integers(len(VALUES)))])
    return dumped(value).encode() + (b"\n" + after if after else b"")


def _plain(data: bytes) -> tuple[Any, Callable[[Any], str], bytes] | None:
    """The value of JSON or YAML, what writes such a value, and the lines after it; None of anything else."""
    line, _, rest = data.partition(b"\n")
    for text, after in ((data, b""), (line, rest)):
        with suppress(ValueError):
            return json.loads(text), json.dumps, after
    with suppress(ValueError, yaml.YAMLError):
        return yaml.safe_load(data), yaml.safe_dump, b""
    return None


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every value within a value, as what holds it and its name or number there."""
    for key, item in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield value, key
        yield from _places(item)


def handed_over(data: bytes, rng: np.random.Generator) -> bytes:
    """A zip of a folder in which one file means something else, under a right checksum."""
    how = {".npz": resealed, ".json": revalued, ".yaml": revalued}
    return _repacked(data, rng, lambda name: how.get(Path(name).suffix, changed))


def _repacked(data: bytes, rng: np.random.Generator, mutation: Callable[[str], Mutation]) -> bytes:
    """A zip in which one file's content is changed, as is said for its name, so that the zip itself is whole."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    chosen = sorted(content)[int(rng.integers(len(content)))]
    content[chosen] = mutation(chosen)(content[chosen], rng)
    return zipped(content)


def zipped(content: dict[str, bytes]) -> bytes:
    """A zip of these files."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, piece in content.items():
            archive.writestr(name, piece)
    return out.getvalue()


def resealed(data: bytes, rng: np.random.Generator) -> bytes:
    """Arrays of an NPZ file changed in type, size or value, and its checksum put right: only their meaning is wrong."""
    with np.load(io.BytesIO(data)) as archive:
        arrays = dict(archive)
    sealed = arrays.pop(CHECKSUM, None) is not None
    for _ in range(int(rng.integers(1, 3))):
        chosen = sorted(arrays)[int(rng.integers(len(arrays)))]
        arrays[chosen] = _changed_array(arrays[chosen], rng)
        if rng.random() < 0.05 and len(arrays) > 1:
            del arrays[chosen]
    if sealed:
        arrays[CHECKSUM] = np.array(checksum_of(arrays))
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def _changed_array(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One change of an array: a value, a row more or less, its axes, its type, the bytes of its text."""
    out, kind = array.copy(), int(rng.integers(5))
    if array.dtype.kind == "U" and array.size:
        at = int(rng.integers(array.size))
        whole = str(array.flat[at])
        how = revalued if whole.startswith("{") and rng.random() < 0.8 else changed
        text = how(whole.encode(), rng).decode("utf-8", "replace").rstrip("\0")
        values = [str(value) for value in array.flat]
        return np.array([*values[:at], text, *values[at + 1 :]]).reshape(array.shape)
    if kind == 0 and array.ndim:
        return out[: int(rng.integers(len(out) + 1))]
    if kind == 1:
        return out.T if out.ndim > 1 else np.repeat(out, 2)
    if kind == 2:
        return out.astype(("i1", "u2", "f4", "f8", "U4", "?")[int(rng.integers(6))])
    if out.size:
        with np.errstate(all="ignore"):
            value = np.asarray(NUMBERS[int(rng.integers(len(NUMBERS)))], np.float64).astype(out.dtype)
        out.flat[rng.integers(out.size, size=int(rng.integers(1, 4)))] = value
    return out


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


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes
    ----------
    make : writes a small whole file into an empty folder, and says where it is
    read : everything that is read from it
    checked : a checksum forbids another meaning
    mutate : what is done to its bytes
    share : how many of its mutations are done for each one of others; what is read takes long
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]
    checked: bool = False
    mutate: Mutation = mutated
    share: float = 1.0


FINDING = "FINDING"
"""How outcomes begin that must not be."""


def outcome(kind: Format, path: Path, original: str) -> str:
    """What reading a mutated file came to: refused, same, other, or a finding."""
    try:
        read = meaning(kind.read(path))
    except DepthMocapError as error:
        return "refused" if "\n" not in str(error) else f"{FINDING}: {len(str(error).splitlines())} lines"
    except Exception as error:
        return f"{FINDING}: {type(error).__name__}: {error}"[:200].replace("\n", " ")
    if read == original:
        return "same"
    return f"{FINDING}: another meaning" if kind.checked else "other"


def outcomes(name: str, kind: Format, folder: Path, numbers: range, seed: int) -> Iterator[str]:
    """The outcome of every mutation of these numbers, in order; a number always gives the same mutation.

    The file of a mutation that makes trouble stays in `folder`, which must be empty: that of a finding under a name of
    its own, and that of a crash as it is.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = kind.make(folder)
    whole = path.read_bytes()
    original = meaning(kind.read(path))
    for number in numbers:
        rng = np.random.default_rng([seed, zlib.crc32(name.encode()), number])
        data = kind.mutate(whole, rng)
        path.write_bytes(data)
        came = outcome(kind, path, original)
        if came.startswith(FINDING):
            (folder / f"finding_{number}_{path.name}").write_bytes(data)
        yield came


def fuzz(name: str, kind: Format, folder: Path, mutations: int, seed: int) -> Counter[str]:
    """How often each outcome came up among the first so many mutations."""
    return Counter(outcomes(name, kind, folder, range(mutations), seed))
