"""Atomic file writing, output checks, folder locks, checksums and shipped files."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import secrets
import socket
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import OutputError, UsageError, os_errors_as
from toolkit.io.safe_open import is_inside, open_file, read_file

LARGEST_FOLDER = 1_000_000
"""Largest number of files and folders of a recording."""
LOCK_FILE, OWNER_FILE = ".lock", ".lock-owner"


@contextmanager
def atomic_path(path: str | Path, *, lasting: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` on success, remove it on failure.

    The temporary name keeps the suffix of `path`, because writers select their format by it. A `lasting` file is
    flushed to the disk before it replaces an older one, so that a power loss keeps one of the two.

    Raises
    ------
    OutputError
        The folder cannot be made or written, or the disk is full.
    """
    target = Path(path)
    if os.path.exists(target) and not is_file(target):
        raise OutputError(f"cannot write {target}: it is a folder or a device; choose another name")
    with os_errors_as(OutputError, f"cannot write {target}", "choose a folder that can be written"):
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = target.with_name(f".{target.stem[:100]}-{secrets.token_hex(8)}{target.suffix}")
        temporary.open("xb").close()
    try:
        with os_errors_as(OutputError, f"cannot write {target}", "free some space or choose another folder"):
            yield temporary
            if lasting:
                flush_to_disk(temporary, os.O_RDWR)
            os.replace(temporary, target)
            if lasting and os.name == "posix":
                flush_to_disk(target.parent, os.O_RDONLY)
    finally:
        temporary.unlink(missing_ok=True)


def flush_to_disk(path: Path, flags: int) -> None:
    """Wait until the content of a file, or the names in a folder, are on the disk."""
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def save_npz(path: str | Path, arrays: dict[str, Any], *, compressed: bool = True) -> None:
    """Write named arrays as one NPZ file, atomically."""
    writer = np.savez_compressed if compressed else np.savez
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        writer(stream, **arrays)


def save_text(path: str | Path, text: str) -> None:
    """Write a text file (UTF-8), atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(text.encode("utf-8", "backslashreplace"))  # names of files may be invalid UTF-8


def save_csv(path: str | Path, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a CSV file with a line of column names, atomically."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    save_text(path, text.getvalue())


def save_bytes(path: str | Path, data: bytes) -> None:
    """Write a reproducible file such as a picture, atomically and without a flush to the disk."""
    with atomic_path(path, lasting=False) as temporary:
        temporary.write_bytes(data)


def save_json(path: str | Path, value: Any) -> None:
    """Write JSON with an indent of two spaces, atomically; arrays become lists, numbers that are not finite null."""
    save_text(path, json.dumps(_plain(value), indent=2, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def is_file(path: str | Path) -> bool:
    """Return True if there is a regular file at `path`; False for folders, pipes, devices and invalid names."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: str | Path) -> bool:
    """Return True if there is a folder at `path`; False for invalid names."""
    try:
        return Path(path).is_dir()
    except (OSError, ValueError):
        return False


def check_output(output: str | Path, inputs: Iterable[str | Path], *, sealed: Iterable[str | Path] = ()) -> Path:
    """Raise UsageError for an output that would overwrite its inputs.

    Parameters
    ----------
    output : file or folder to write
    inputs : files and folders to read; the output must not be or contain one of them
    sealed : input folders that the output must not lie in, such as a recording's folder of images

    Returns
    -------
    `output` as a path

    Raises
    ------
    UsageError
        The output is an input, contains one, or lies in a sealed one.
    """
    target = _place(output)
    for given in inputs:
        source = _place(given)
        if source == target or _same_file(source, target):
            raise UsageError(f"{output} is read and would be overwritten; choose another output")
        if target in source.parents:
            raise UsageError(f"the output {output} holds {given}, which is read; choose another output")
    for given in sealed:
        if _place(given) in target.parents:
            raise UsageError(f"the output {output} lies inside {given}, which is read; choose a place outside of it")
    return Path(output)


def _place(path: str | Path) -> Path:
    """Return the resolved path, with links followed as far as they exist."""
    try:
        return Path(path).resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle, a name too long, a null character
        return Path(os.path.abspath(path))


def _same_file(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except (OSError, ValueError):
        return False


@contextmanager
def locked(folder: str | Path) -> Iterator[None]:
    """Lock a folder for this process; the lock ends with the process.

    Raises
    ------
    OutputError
        Another process has locked it (the message names it), or the folder cannot be written.
    """
    from filelock import FileLock, Timeout

    if is_file(folder):
        raise OutputError(f"{folder} is a file; name a folder")
    path, owner = Path(folder) / LOCK_FILE, Path(folder) / OWNER_FILE
    lock = FileLock(path, mode=0o666)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if os.path.lexists(path):  # the lock would truncate a link's target
            open_file(path, "a+b", inside=True).close()
        lock.acquire(blocking=False)
        with open_file(owner, "w+b", inside=True) as stream:
            stream.write(f"process {os.getpid()} on {socket.gethostname()}\n".encode())
    except Timeout:
        raise OutputError(f"{path.parent} is being written by {_owner(owner)}; wait until it has ended") from None
    except OSError as error:
        lock.release()
        raise OutputError(
            f"cannot write {path}: {error.strerror or error}; choose a folder that can be written"
        ) from error
    try:
        yield
    finally:
        for file in (owner, path):  # while the lock is held; Windows keeps an open file
            with suppress(OSError):
                file.unlink()
        lock.release()


def _owner(path: Path) -> str:
    """Return the owner of a lock, from a second file, because Windows cannot read a locked one."""
    try:
        return read_file(path, 1000, inside=True).decode("utf-8", "replace").strip() or "another process"
    except OSError:
        return "another process"


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file, or of the sorted names and contents of a folder's files, as hexadecimal digits."""
    root, digest = Path(path), hashlib.sha256()
    folder = root.is_dir()
    for file in filter(is_inside, _below(root)) if folder else [root]:
        if folder:
            digest.update(os.fsencode(file.relative_to(root)))
        with open_file(file, inside=folder) as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def link_out_of(folder: str | Path) -> Path | None:
    """Return the first link below a folder that leads outside of it or to nothing, else None."""
    root = Path(folder).resolve()
    for path in _below(root):
        if path.is_symlink() and (not path.exists() or root not in path.resolve().parents):
            return path
    return None


def _below(folder: Path) -> list[Path]:
    """Return all files, folders and links below a folder, sorted; UsageError for more than `LARGEST_FOLDER`."""
    found = list(islice(folder.rglob("*"), LARGEST_FOLDER + 1))
    if len(found) > LARGEST_FOLDER:
        raise UsageError(f"{folder} holds more than {LARGEST_FOLDER} files, as no recording does; name a recording")
    return sorted(found)


def shipped(*parts: str) -> Path:
    """Return the path of a file under `configs/`, in a checkout as well as in an installed wheel.

    Raises
    ------
    UsageError
        There is no such file; the message lists the ones that exist beside it.
    """
    package = Path(__file__).parents[1]
    roots = [package / "configs", package.parent / "configs"]
    for root in roots:
        if (candidate := root.joinpath(*parts)).exists():
            return candidate
    folder = next((r.joinpath(*parts).parent for r in roots if r.joinpath(*parts).parent.is_dir()), roots[-1])
    files = sorted(p.name for p in folder.iterdir() if p.is_file()) if folder.is_dir() else []
    present = ", ".join(files) or "none"
    raise UsageError(f"no shipped file {'/'.join(parts)}; there are: {present}")
