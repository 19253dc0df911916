"""Where compiled kernels are kept: under a digest of all kernels, so that changed sources never run old code.

Numba stamps a cached function with the source of its own file only, although it holds the compiled code of every
function that it calls, from other files too. Here the names of the cached files carry a digest of all sources in this
folder instead. They lie where Numba puts them: in `NUMBA_CACHE_DIR` if that is set, else beside the sources, or in the
user's cache folder where that cannot be written.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching

FOLDER = Path(__file__).resolve().parent
KEPT = 3
"""Sets of compiled kernels in one folder, the newest ones: so many versions can be gone back to without compiling."""
DIGITS = 16

_NAME = re.compile(rf"-([0-9a-f]{{{DIGITS}}})\.py[^-]*\.nb[ic]$")


@cache
def sources_digest(folder: Path = FOLDER) -> str:
    """Hexadecimal digits that name the sources in `folder` and below, read once."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(f"{path.relative_to(folder).as_posix()}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:DIGITS]


class _OfKernels:
    """Mixed into a locator of Numba: serves the functions of this folder alone, under the digest of all of them."""

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        """A locator for a function of this folder, None for any other function."""
        if FOLDER not in Path(file).resolve().parents:
            return None
        locator = super().from_function(function, file)  # type: ignore[misc]
        if locator is not None:
            _prune_once(Path(locator.get_cache_path()))
        return locator

    def get_source_stamp(self) -> str:
        """What a cached function must have been compiled from."""
        return sources_digest()

    def get_disambiguator(self) -> str:
        """Part of the names of a cached function's files: another set of sources has other files."""
        return sources_digest()


def prune(folder: Path, kept: int = KEPT) -> None:
    """Remove the compiled kernels in `folder` except for the newest `kept` sets and that of the present sources."""
    newest: dict[str, float] = {}
    files: dict[str, list[Path]] = {}
    for path in folder.glob("*.nb[ic]"):
        match = _NAME.search(path.name)
        digest = match.group(1) if match else ""
        files.setdefault(digest, []).append(path)
        with contextlib.suppress(OSError):
            newest[digest] = max(newest.get(digest, 0.0), path.stat().st_mtime)
    stay = sorted((d for d in files if d), key=lambda d: newest.get(d, 0.0), reverse=True)[:kept]
    for digest in files.keys() - {*stay, sources_digest()}:
        for path in files[digest]:
            with contextlib.suppress(OSError):
                path.unlink()


_prune_once = cache(prune)


def install() -> None:
    """Have Numba ask these locators first; those of all other functions stay as they were."""
    found = caching.CompileResultCacheImpl._locator_classes
    ours: list[Any] = [type(locator.__name__, (_OfKernels, locator), {}) for locator in found]
    caching.CompileResultCacheImpl._locator_classes = [*ours, *found]
