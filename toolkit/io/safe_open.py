"""Safe opening of files: regular files only, and inside an untrusted folder never through a link.

A link in an untrusted folder could redirect a reader to a private file and a writer to a file of the user. A pipe
could block both, and a hard link could overwrite another file.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO, Literal

Mode = Literal["rb", "r+b", "w+b", "a+b"]
_FLAGS: dict[str, int] = {
    "rb": os.O_RDONLY,
    "r+b": os.O_RDWR,
    "w+b": os.O_RDWR | os.O_CREAT,
    "a+b": os.O_RDWR | os.O_CREAT | os.O_APPEND,
}
_ALWAYS = sum(getattr(os, name, 0) for name in ("O_CLOEXEC", "O_NONBLOCK", "O_BINARY"))
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)


def open_file(path: str | Path, mode: Mode = "rb", *, inside: bool = False, buffering: int = -1) -> BinaryIO:
    """Open a regular file; nothing is created, truncated or waited for if the path is anything else.

    Parameters
    ----------
    path : file to open
    mode : as in `open`: "w+b" truncates the file, "a+b" appends to it; both create a missing file
    inside : the file lies in a folder of an untrusted source: it must not be a link, and a written file has one hard
        link
    buffering : as in `open`

    Raises
    ------
    OSError
        The file is missing, not regular or not accessible; `strerror` gives the reason.
    """
    name = os.fspath(path)
    try:
        _check(os.lstat(name) if inside else os.stat(name), mode, name, inside)
    except FileNotFoundError:
        if mode not in ("w+b", "a+b"):
            raise
    handle = os.open(name, _FLAGS[mode] | _ALWAYS | (_NO_LINK if inside else 0), 0o666)
    try:
        _check(os.fstat(handle), mode, name, inside)
        if inside and not _NO_LINK and not os.path.samestat(os.fstat(handle), os.lstat(name)):
            raise OSError(errno.ELOOP, "it is a link", name)
        if mode == "w+b":
            os.ftruncate(handle, 0)
        return os.fdopen(handle, mode, buffering=buffering)
    except BaseException:
        os.close(handle)
        raise


def _check(found: os.stat_result, mode: Mode, name: str, inside: bool) -> None:
    if stat.S_ISLNK(found.st_mode):
        raise OSError(errno.ELOOP, "it is a link; files of this folder are not read or written through links", name)
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is a folder, a pipe or a device", name)
    if inside and mode != "rb" and found.st_nlink > 1:
        raise OSError(errno.EMLINK, "the file has another name (hard link)", name)


def read_file(path: str | Path, most: int, *, inside: bool = False) -> bytes:
    """Return the content of a regular file of at most `most` bytes; raises OSError as `open_file`, or EFBIG."""
    with open_file(path, inside=inside) as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"it has more than {most} bytes, which is too many", os.fspath(path))
    return content


def is_inside(path: str | Path) -> bool:
    """Return True if the path is a regular file and no link."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except (OSError, ValueError):
        return False
