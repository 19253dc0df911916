"""Files of compiled kernels, read without trust: a cache can be truncated by a loss of power, and it contains code.

Numba stores pickles. Those of kernels carry their SHA-256; a file that does not match it is compiled again and never
unpickled. They lie in folders that belong to the user and that no other user can write, or in no folder at all.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import pickle
import shutil
import stat
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching

_DIGEST = hashlib.sha256().digest_size
_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def is_private(folder: Path) -> bool:
    """Return whether a folder is the user's own and no other user can write it; an empty one is made so.

    On a system without owners each folder is private.
    """
    if not hasattr(os, "geteuid"):
        return True
    try:
        found = os.lstat(folder)
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
            return False
        if not os.listdir(folder):
            os.chmod(folder, 0o700)
            return True
        return not found.st_mode & _OTHERS
    except OSError:
        return False


def is_protected(folder: Path, package: Path) -> bool:
    """Return whether a folder has the owner of `package`, whose code runs anyway, and no more writers than it has."""
    try:
        found, around = os.lstat(folder), os.stat(package)
    except OSError:
        return False
    return (
        stat.S_ISDIR(found.st_mode) and found.st_uid == around.st_uid and not found.st_mode & ~around.st_mode & _OTHERS
    )


@cache
def temporary_folder() -> Path:
    """Return a folder for this process alone, where no other one is private; it is removed at the process's end."""
    folder = tempfile.mkdtemp(prefix="depthmocap-kernels-")  # 0700
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


class KernelFile(caching.IndexDataCacheFile):
    """Index and code of one kernel: what cannot be read is compiled again, and what cannot be written is not stored.

    Parameters
    ----------
    cache_path, filename_base, source_stamp : as Numba names them
    readonly : the same kernel in a folder that is read first and never written
    missing : called when neither has the code
    """

    def __init__(
        self, cache_path: str, filename_base: str, source_stamp: str, readonly: KernelFile | None = None,
        missing: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        super().__init__(cache_path, filename_base, source_stamp)
        self._readonly, self._missing = readonly, missing

    def load(self, key: Any) -> Any:
        """Return the code stored for a signature, None where there is none that can be used."""
        if self._readonly is not None and (code := self._readonly.load(key)) is not None:
            return code
        try:
            code = super().load(key)
        except Exception:  # damaged in a way that carries a right checksum, or of another version of Numba
            code = None
        if code is None:
            self._missing()
        return code

    def save(self, key: Any, data: Any) -> None:
        """Store code for a signature, if the disk takes it."""
        with contextlib.suppress(OSError):
            super().save(key, data)

    def _load_index(self) -> Any:
        try:
            version, stamp, overloads = _unsealed(self._index_path)
        except (OSError, ValueError):
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: Any) -> None:
        self._write(self._index_path, self._dump((self._version, self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        return _unsealed(self._data_path(name))

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as stream:
            stream.write(hashlib.sha256(content).digest() + content)


def _unsealed(path: str) -> Any:
    """Return the value of a file; raise ValueError, before anything is unpickled, where the checksum does not match."""
    content = Path(path).read_bytes()
    if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
        raise ValueError(f"{path} is damaged")
    return pickle.loads(content[_DIGEST:])
