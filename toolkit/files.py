"""Files written whole or not at all, and the places where shipped files lie."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.errors import OutputError, UsageError


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it is renamed to `path`, on any failure it is removed.

    The temporary name keeps the suffix of `path`, because writers choose their format by it.

    Raises
    ------
    OutputError
        The folder cannot be made or written, or the disk is full.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
        os.close(handle)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot write {target}: {reason}; choose a folder that can be written") from error
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot write {target}: {reason}; free some space or choose another folder") from error
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def save_npz(path: str | Path, arrays: dict[str, Any], *, compressed: bool = True) -> None:
    """Write named arrays as one NPZ file, whole or not at all."""
    writer = np.savez_compressed if compressed else np.savez
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        writer(stream, **arrays)


def save_text(path: str | Path, text: str) -> None:
    """Write a text file (UTF-8), whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def save_json(path: str | Path, value: Any) -> None:
    """Write JSON with two spaces of indent, whole or not at all; arrays and NumPy scalars are converted."""
    save_text(path, json.dumps(value, indent=2, default=_plain) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"cannot write {type(value).__name__} as JSON")


def sha256_of(path: str | Path) -> str:
    """SHA-256 of a file, or of the sorted names and contents of a folder's files, as hexadecimal digits."""
    root = Path(path)
    digest = hashlib.sha256()
    files = [root] if root.is_file() else sorted(p for p in root.rglob("*") if p.is_file())
    for file in files:
        if root.is_dir():
            digest.update(str(file.relative_to(root)).encode())
        with file.open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def shipped(*parts: str) -> Path:
    """Path of a file under `configs/`, in a checkout as well as in an installed wheel.

    Raises
    ------
    UsageError
        There is no such file; the message lists the ones that exist beside it.
    """
    package = Path(__file__).parent
    roots = [package / "configs", package.parent / "configs"]
    for root in roots:
        if (candidate := root.joinpath(*parts)).exists():
            return candidate
    folder = next((r.joinpath(*parts).parent for r in roots if r.joinpath(*parts).parent.is_dir()), roots[-1])
    present = ", ".join(sorted(p.name for p in folder.iterdir())) if folder.is_dir() else "none"
    raise UsageError(f"no shipped file {'/'.join(parts)}; there are: {present}")
