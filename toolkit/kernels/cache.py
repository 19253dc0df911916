"""Cache of compiled kernels: the ones that the wheel contains, or else those of the user's cache folder.

Numba stamps a cached function with its own source file only, although the cached code contains the functions that it
calls from other files. Here all kernels carry one digest of the whole package, so that changed sources never run old
code. A kernel is loaded from `compiled/` in the package if its digest, Python, Numba and processor match
(`scripts/compile_kernels.py` fills that folder when a wheel is built). Otherwise it is compiled at its first use and
stored under the digest in `NUMBA_CACHE_DIR`, if that is set, or in the user's cache folder. Numba stores pickles, which
are code: a folder of another user, or that others can write, is not used.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import json
import logging
import os
import platform
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

try:
    import numba
    from numba.core import caching
    from numba.core import config as numba_config
except ValueError as error:
    from toolkit.io.errors import UsageError

    threads = os.environ.get("NUMBA_NUM_THREADS")
    raise UsageError(f"NUMBA_NUM_THREADS is {threads!r}; give a positive number, or leave it unset") from error

FOLDER = Path(__file__).resolve().parent
COMPILED = FOLDER / "compiled"
BUILD_FILE = "build.json"
"""In the folder of compiled kernels: the values of `build_key` that they were compiled for."""
PORTABLE_CPU = "x86-64-v3"
"""Processor that kernels are compiled for on x86 (AVX2, in desktop processors since 2013 to 2015)."""
X86_FEATURES = ("avx2", "bmi2", "fma")
"""Features of x86-64-v3 as LLVM names them; a processor that lacks one has its kernels compiled for itself."""

config: Any = numba_config
"""Numba's settings, whose names it makes while it is imported."""
logger = logging.getLogger(__name__)


@cache
def sources_digest() -> str:
    """Return 16 hexadecimal digits that identify the sources of all kernels.

    Kernels with bounds checks (`NUMBA_BOUNDSCHECK`) are different code that Numba does not distinguish.
    """
    digest = hashlib.sha256(b"bounds" if config.BOUNDSCHECK else b"")
    for path in sorted(FOLDER.rglob("*.py")):
        digest.update(f"{path.relative_to(FOLDER).as_posix()}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def portable_cpu() -> str | None:
    """Return the name of the processor that kernels are compiled for, or None for the processor of this machine."""
    from llvmlite import binding

    if platform.machine() not in ("x86_64", "AMD64"):
        return None
    features = binding.get_host_cpu_features()
    return PORTABLE_CPU if all(features.get(name) for name in X86_FEATURES) else None


def build_key() -> dict[str, str]:
    """Return the values that compiled kernels depend on, by name."""
    return {
        "Python": f"{sys.implementation.name} {sys.version_info[0]}.{sys.version_info[1]}",
        "Numba": numba.__version__,
        "system": f"{sys.platform} {platform.machine()}",
        "processor": str(config.CPU_NAME or "of this machine"),
        "sources": sources_digest(),
    }


@cache
def compiled_folder() -> tuple[Path | None, str]:
    """Return the package's folder of compiled kernels; or None, with the reason why it cannot be used."""
    if not COMPILED.is_dir():
        return None, "this installation has no compiled kernels"
    try:
        built = json.loads((COMPILED / BUILD_FILE).read_text(encoding="utf-8"))
        wrong = [f"{name} {built[name]}, not {value}" for name, value in build_key().items() if built[name] != value]
    except (OSError, ValueError, KeyError, TypeError):
        return None, f"{COMPILED / BUILD_FILE} cannot be read"
    return (None, f"the installed ones are for {'; '.join(wrong)}") if wrong else (COMPILED, "")


@cache
def user_folder() -> Path:
    """Return the folder where this process stores compiled kernels: private, writable, named by their digest.

    Without such a folder it is a temporary one, which is removed at the end of the process.
    """
    chosen = config.CACHE_DIR
    usual = Path(platformdirs.user_cache_dir("depthmocap", appauthor=False), "kernels")
    for parent in ([Path(chosen, "depthmocap")] if chosen else []) + [usual]:
        folder = parent / sources_digest()
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_private(folder):
                continue
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
            prune(parent)
            return folder
    temporary = tempfile.mkdtemp(prefix="depthmocap-kernels-")
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return Path(temporary)


def is_private(folder: Path) -> bool:
    """Return whether a folder is the user's own and no other user can write it; always on a system without owners."""
    found = os.lstat(folder)
    others = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return not hasattr(os, "geteuid") or (stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not others)


def prune(parent: Path, kept: int = 3) -> None:
    """Remove the kernels of all digests in `parent` but the `kept` latest used ones: versions of the package."""
    folders = [path for path in parent.iterdir() if path.is_dir() and len(path.name) == len(sources_digest())]
    for folder in sorted(folders, key=lambda path: path.stat().st_mtime, reverse=True)[kept:]:
        shutil.rmtree(folder, ignore_errors=True)


class KernelLocator(caching._CacheLocator):
    """Location of the compiled code of one function of this package."""

    def __init__(self, source: Path) -> None:
        self._source = self._py_file = source

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        """Return the locator of a function of this package, None for any other function."""
        source = Path(file).resolve()
        return cls(source) if FOLDER in source.parents else None

    def get_cache_path(self) -> str:
        """Return the folder where the function is stored when it has been compiled."""
        return str(user_folder())

    def get_source_stamp(self) -> str:
        """Return the digest of the sources that a cached function must have been compiled from."""
        return sources_digest()

    def get_disambiguator(self) -> str:
        """Return the part of a file name that distinguishes functions of equal names: the module's path."""
        return ".".join(self._source.relative_to(FOLDER).with_suffix("").parts)


@cache
def announce_compiling() -> None:
    """Log once that kernels are being compiled, and why."""
    reason = compiled_folder()[1] or "some are used for the first time"
    logger.warning("compiling kernels, which takes up to a minute, once: %s", reason)


class KernelFile(caching.IndexDataCacheFile):
    """Index and code of one kernel: what cannot be read is compiled again, and what cannot be written is not stored.

    Parameters
    ----------
    cache_path, filename_base, source_stamp : as Numba names them
    readonly : the same kernel in a folder that is read first and never written
    """

    def __init__(
        self, cache_path: str, filename_base: str, source_stamp: str, readonly: KernelFile | None = None
    ) -> None:
        super().__init__(cache_path, filename_base, source_stamp)
        self._readonly = readonly

    def load(self, key: Any) -> Any:
        """Return the code stored for a signature; without any, log once that kernels are compiled, and return None."""
        for file in (self._readonly, self):
            if file is not None and (code := file.stored(key)) is not None:
                return code
        announce_compiling()
        return None

    def stored(self, key: Any) -> Any:
        """Return the code stored in this file for a signature, None where there is none that can be used."""
        try:
            return super().load(key)
        except Exception:  # cut by a loss of power, or of another version of Numba
            return None

    def save(self, key: Any, data: Any) -> None:
        """Store code for a signature, if the disk takes it."""
        with contextlib.suppress(OSError):
            super().save(key, data)

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # as in `stored`
            return {}


def _cache_file(usual: Callable[..., Any]) -> Callable[..., Any]:
    def file(cache_path: str, filename_base: str, source_stamp: Any) -> Any:
        if source_stamp != sources_digest():
            return usual(cache_path=cache_path, filename_base=filename_base, source_stamp=source_stamp)
        compiled = compiled_folder()[0]
        readonly = KernelFile(str(compiled), filename_base, source_stamp) if compiled else None
        return KernelFile(cache_path, filename_base, source_stamp, readonly)

    return file


def install() -> None:
    """Make Numba compile for the portable processor and use this cache for functions of this package.

    Functions of other packages keep Numba's own cache. A processor that the user names (`NUMBA_CPU_NAME`) is kept.
    """
    if config.CPU_NAME is None and (name := portable_cpu()) is not None:
        config.CPU_NAME, config.CPU_FEATURES = name, ""
    impl: Any = caching.CompileResultCacheImpl
    impl._locator_classes = [KernelLocator, *impl._locator_classes]
    caching.IndexDataCacheFile = _cache_file(caching.IndexDataCacheFile)  # type: ignore[assignment, misc]
