"""Where compiled kernels are kept: under a digest of what they are made of, so that changed sources never run old code.

Numba stamps a cached function with the source of its own file only, although it holds the compiled code of every
function that it calls, from other files too. Here the names of the cached files carry a digest of the file and of all
kernels that it imports, directly or through others: an edit compiles anew what can be other code, and nothing else.
They lie where Numba puts them: in `NUMBA_CACHE_DIR` if that is set, else beside the sources, or in the user's cache
folder where that cannot be written, and only where no other user can write (`cache_files`).
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching, config, event

from toolkit.kernels.cache_files import KernelFile, is_private, last_resort

FOLDER = Path(__file__).resolve().parent
KEPT = 3
"""Sets of one file's compiled kernels, the newest ones: so many versions can be gone back to without compiling."""
DIGITS = 16

_NAME = re.compile(rf"^(?P<stem>\w+)\..*-(?P<digest>[0-9a-f]{{{DIGITS}}})\.py[^-]*\.nb[ic]$")
_IMPORT = re.compile(r"^\s*from toolkit\.(kernels[\w.]*) import (\([^)]*\)|.+)", re.MULTILINE)


def imported(path: Path, folder: Path = FOLDER) -> set[Path]:
    """Files of kernels in `folder` that the file imports, directly or through others, with the file itself."""
    found, waiting = set[Path](), [path]
    while waiting:
        this = waiting.pop()
        if this in found:
            continue
        found.add(this)
        for module, names in _IMPORT.findall(this.read_text(encoding="utf-8")):
            place = folder.parent.joinpath(*module.split("."))
            candidates = [place, *(place / name for name in re.findall(r"\w+", names))]
            waiting += [file for file in (each.with_suffix(".py") for each in candidates) if file.is_file()]
    return found


@cache
def sources_digest(path: Path, folder: Path = FOLDER) -> str:
    """Hexadecimal digits that name the sources of one kernel's file and of what it imports in `folder`, read once.

    Kernels that look at their bounds (`NUMBA_BOUNDSCHECK`) are other code: Numba would not tell them apart.
    """
    digest = hashlib.sha256(b"bounds" if getattr(config, "BOUNDSCHECK", None) else b"")
    for each in sorted(imported(path, folder)):
        digest.update(f"{each.relative_to(folder).as_posix()}\0{each.stat().st_size}\0".encode())
        digest.update(each.read_bytes())
    return digest.hexdigest()[:DIGITS]


_OURS: set[str] = set()
"""Stamps of kernels: their files are the sealed ones."""


class _LastResort(caching.UserWideCacheLocator):
    """Where a process keeps its kernels for itself."""

    def __init__(self, function: Any, file: str) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno

    def get_cache_path(self) -> str:
        return str(last_resort())


class _OfKernels:
    """Mixed into a locator of Numba: serves the functions of this folder alone, under the digest of their sources."""

    _source: Path

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        """A locator for a function of this folder, None for any other function."""
        source = Path(file).resolve()
        if FOLDER not in source.parents:
            return None
        locator = super().from_function(function, file)  # type: ignore[misc]
        if locator is None or not is_private(Path(locator.get_cache_path())):
            return None
        locator._source = source
        _prune_once(Path(locator.get_cache_path()))
        return locator

    def get_source_stamp(self) -> str:
        """What a cached function must have been compiled from."""
        _OURS.add(sources_digest(self._source))
        return sources_digest(self._source)

    def get_disambiguator(self) -> str:
        """Part of the names of a cached function's files: another set of sources has other files."""
        return sources_digest(self._source)


class _NoCollection(event.Listener):
    """Numba makes millions of objects that stay until a function is compiled: looking for garbage among them takes a
    fifth of the time."""

    def __init__(self) -> None:
        self._depth, self._collected = 0, False

    def on_start(self, event: Any) -> None:
        """A compilation begins, perhaps within another one."""
        if self._depth == 0:
            self._collected = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """It is over."""
        self._depth -= 1
        if self._depth == 0 and self._collected:
            gc.enable()


def prune(folder: Path, kept: int = KEPT) -> None:
    """Remove compiled kernels in `folder` except, of each source, its newest `kept` sets and its present one."""
    sets: dict[str, dict[str, list[Path]]] = {}
    for path in folder.glob("*.nb[ic]"):
        match = _NAME.match(path.name)
        stem, digest = match.group("stem", "digest") if match else ("", "")
        sets.setdefault(stem, {}).setdefault(digest, []).append(path)
    present = {sources_digest(path) for path in FOLDER.rglob("*.py")}
    for stem, of_digest in sets.items():
        newest = sorted(of_digest, key=lambda digest: _changed(of_digest[digest]), reverse=True)
        for digest in set(newest[kept:] if stem else newest) - present:
            for path in of_digest[digest]:
                with contextlib.suppress(OSError):
                    path.unlink()


def _changed(paths: Iterable[Path]) -> float:
    """When the last of these files was written, seconds since 1970."""
    latest = 0.0
    for path in paths:
        with contextlib.suppress(OSError):
            latest = max(latest, path.stat().st_mtime)
    return latest


_prune_once = cache(prune)


def install() -> None:
    """Have Numba ask these locators first, and keep kernels in sealed files; all other functions stay as they were."""
    event.register("numba:compile", _NoCollection())
    found = caching.CompileResultCacheImpl._locator_classes
    ours: list[Any] = [type(locator.__name__, (_OfKernels, locator), {}) for locator in (*found, _LastResort)]
    caching.CompileResultCacheImpl._locator_classes = [*ours, *found]
    usual = caching.IndexDataCacheFile

    def file(cache_path: str, filename_base: str, source_stamp: str) -> Any:
        kind = KernelFile if source_stamp in _OURS else usual
        return kind(cache_path=cache_path, filename_base=filename_base, source_stamp=source_stamp)

    caching.IndexDataCacheFile = file  # type: ignore[assignment, misc]
