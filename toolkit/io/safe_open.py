"""The one door through which files are opened: ordinary files only, and inside of a given folder never through a link.

A folder may come from anywhere. A link in it could lead a reader to a private file and a writer to a thesis, a pipe
could hold either for ever, a second name of the same file could be written under this one.
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
    """Open an ordinary file; nothing is made, cut or waited for where there is something else.

    Parameters
    ----------
    mode : as of `open`: "w+b" empties the file, "a+b" adds to it; both make it where there is none
    inside : the file lies in a folder that may come from anywhere: no link leads to it, and a file that is written has
        no second name elsewhere
    buffering : as of `open`

    Raises
    ------
    OSError
        There is none, it is no ordinary file, it may not be opened; its `strerror` says so in words.
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
        raise OSError(errno.ELOOP, "it is a link, through which nothing in this folder is read or written", name)
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is a folder, a pipe or a device", name)
    if inside and mode != "rb" and found.st_nlink > 1:
        raise OSError(errno.EMLINK, "the same file has another name elsewhere", name)


def read_file(path: str | Path, most: int, *, inside: bool = False) -> bytes:
    """The content of an ordinary file of at most so many bytes; raises OSError as `open_file`, or EFBIG."""
    with open_file(path, inside=inside) as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"it has more than {most} bytes, too many for what it should be", os.fspath(path))
    return content


def is_inside(path: str | Path) -> bool:
    """Whether an ordinary file lies there itself, and not a link to one."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except (OSError, ValueError):
        return False
