"""The files of compiled kernels, read without trust: a cache may be cut by a loss of power, and it holds code.

Numba keeps pickles. Those of kernels carry their SHA-256; what does not fit it is not unpickled but compiled anew.
They lie in folders that belong to the user and that no other person may write, or in no folder at all.
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
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching

_DIGEST = hashlib.sha256().digest_size


def is_private(folder: Path) -> bool:
    """Whether a folder is the user's own and no other person may write there; a new one, still empty, is made so.

    Where a system has no owners every folder is taken for private.
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
        return not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    except OSError:
        return False


@cache
def last_resort() -> Path:
    """A folder for this process alone, for where no other one is private; it goes with the process."""
    folder = tempfile.mkdtemp(prefix="depthmocap-kernels-")  # 0700
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


class KernelFile(caching.IndexDataCacheFile):
    """Index and code of one kernel: what cannot be read is not there, and what cannot be written is compiled again."""

    def load(self, key: Any) -> Any:
        """The code kept for a signature, None where there is none that can be used."""
        try:
            return super().load(key)
        except Exception:  # damaged in a way that carries a right checksum, or of another version of Numba
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep code for a signature, as far as the disk takes it."""
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
    """The value of a file; raises ValueError, before anything is unpickled, where the checksum does not fit."""
    content = Path(path).read_bytes()
    if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
        raise ValueError(f"{path} is damaged")
    return pickle.loads(content[_DIGEST:])
