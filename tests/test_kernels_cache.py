"""Compiled kernels are kept under a digest of what they are made of: changed sources never run old code."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from toolkit.kernels import cache
from toolkit.kernels.cache_files import KernelFile, is_private
from toolkit.kernels.fit import pairs

INNER = "from numba import njit\n\n@njit(cache=True)\ndef inner():\n    return {value}\n"
OUTER = (
    "from numba import njit\nfrom toolkit.kernels.room.inner import inner\n\n"
    "@njit(cache=True)\ndef outer():\n    return inner()\n"
)
RUN = (
    "from toolkit.kernels.outer import outer\nprint(outer())\n"
    "print(len(outer.stats.cache_hits))\nprint(outer.stats.cache_path)"
)


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """An installation with two kernels in two files, of which one holds the compiled code of the other."""
    kernels = tmp_path / "toolkit" / "kernels"
    kernels.mkdir(parents=True)
    for name in ("__init__.py", "cache.py", "cache_files.py"):
        shutil.copy(cache.FOLDER / name, kernels / name)
    (tmp_path / "toolkit" / "__init__.py").touch()
    (kernels / "room").mkdir()
    (kernels / "room" / "inner.py").write_text(INNER.format(value=1))
    (kernels / "other.py").write_text(INNER.format(value=0))
    (kernels / "outer.py").write_text(OUTER)
    return tmp_path


SERVER = """
import json, os, sys
import numba
numba.njit(lambda: 0)()
for line in sys.stdin:
    installation, code, environment = json.loads(line)
    if os.fork() == 0:
        os.environ.clear()
        os.environ.update(environment)
        numba.core.config.reload_config()
        os.chdir(installation)
        sys.path.insert(0, installation)
        exec(code, {"__name__": "__main__"})
        sys.exit()
    print(f"ended {os.wait()[1]}", flush=True)
"""
"""A process that has Numba and no kernel, and forks: importing Numba takes longer than all that is tested."""


class Starter:
    """Starts processes that have Numba already."""

    def __init__(self) -> None:
        variables = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
        self.process = subprocess.Popen(
            [sys.executable, "-c", SERVER], env={**variables, "PYTHONDONTWRITEBYTECODE": "1"}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def said(self, installation: Path, code: str, **environment: str) -> list[str]:
        """The lines that code prints in a new process, which imports the kernels of an installation."""
        assert self.process.stdin is not None and self.process.stdout is not None
        variables = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")} | environment
        self.process.stdin.write(json.dumps([str(installation), code, variables]) + "\n")
        self.process.stdin.flush()
        lines = []
        for line in self.process.stdout:
            if line.startswith("ended "):
                assert line == "ended 0\n", "it failed"
                return lines
            lines.append(line.rstrip("\n"))
        raise AssertionError("the starter ended")


@pytest.fixture(scope="module")
def starter() -> Iterator[Starter]:
    made = Starter()
    yield made
    made.process.communicate()


Run = Callable[..., tuple[int, int, Path]]


@pytest.fixture
def run(starter: Starter) -> Run:
    """What the outer kernel returns in a new process, whether it came from the cache, and where that lies."""

    def found(installation: Path, **environment: str) -> tuple[int, int, Path]:
        value, hits, path = starter.said(installation, RUN, **environment)
        return int(value), int(hits), Path(path)

    return found


def test_a_kernel_follows_an_edit_in_the_file_of_another_one(installed: Path, run: Run) -> None:
    assert run(installed)[:2] == (1, 0)
    assert run(installed)[:2] == (1, 1)
    inner = installed / "toolkit" / "kernels" / "room" / "inner.py"
    before = inner.stat()
    inner.write_text(INNER.format(value=2))
    os.utime(inner, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert run(installed)[:2] == (2, 0)
    inner.write_text(INNER.format(value=1))
    assert run(installed)[:2] == (1, 1)


def test_an_upgraded_installation_never_runs_old_code(installed: Path, run: Run) -> None:
    folder = run(installed)[2]
    kernels = installed / "toolkit" / "kernels"
    (kernels / "room" / "inner.py").write_text(INNER.format(value=3))
    assert run(installed)[:2] == (3, 0)
    # An index whose code was not yet written when the process died leads to nothing, not to the old code.
    for path in folder.glob("*.nbc"):
        if cache.sources_digest(kernels / "outer.py", kernels) in path.name:
            path.unlink()
    assert run(installed)[:2] == (3, 0)


def test_an_installation_that_cannot_be_written_keeps_its_kernels_in_the_users_cache(
    installed: Path, tmp_path: Path, run: Run
) -> None:
    (installed / "toolkit" / "kernels" / "__pycache__").touch()  # in the way of a folder, for root too
    home = {"XDG_CACHE_HOME": str(tmp_path / "home"), "HOME": str(tmp_path / "home")}
    assert run(installed, **home)[:2] == (1, 0)
    value, hits, path = run(installed, **home)
    assert (value, hits) == (1, 1)
    assert tmp_path / "home" in path.parents
    (installed / "toolkit" / "kernels" / "room" / "inner.py").write_text(INNER.format(value=4))
    assert run(installed, **home)[:2] == (4, 0)


def test_no_garbage_is_collected_while_a_kernel_is_compiled(installed: Path, starter: Starter) -> None:
    code = (
        "import gc\nfrom numba.core import event\nfrom toolkit.kernels.outer import outer\nseen = []\n"
        "class Listener(event.Listener):\n    def on_start(self, event): seen.append(gc.isenabled())\n"
        "    def on_end(self, event): pass\n"
        "event.register('numba:compile', Listener())\nouter()\nprint(seen, gc.isenabled())"
    )
    assert starter.said(installed, code) == ["[False, False] True"]


def test_old_sets_of_compiled_kernels_are_removed_and_the_newest_stay(tmp_path: Path) -> None:
    sets = ["a" * 16, "b" * 16, "c" * 16, "d" * 16]
    for age, digest in enumerate(sets):
        for name in (f"pairs.add-{digest}.py311.nbi", f"pairs.add-{digest}.py311.1.nbc"):
            (tmp_path / name).touch()
            os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    (tmp_path / "pairs.add-17.py311.nbi").touch()
    present = cache.sources_digest(cache.FOLDER / "fit" / "pairs.py")
    (tmp_path / f"pairs.add-{present}.py311.nbi").touch()
    os.utime(tmp_path / f"pairs.add-{present}.py311.nbi", (1.0, 1.0))
    (tmp_path / f"swarm.costs-{sets[3]}.py311.nbi").touch()
    (tmp_path / "pairs.cpython-311.pyc").touch()
    cache.prune(tmp_path, kept=2)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {
        *(f"pairs.add-{digest}.py311.{end}" for digest in sets[:2] for end in ("nbi", "1.nbc")),
        f"pairs.add-{present}.py311.nbi",
        f"swarm.costs-{sets[3]}.py311.nbi",
        "pairs.cpython-311.pyc",
    }


def test_a_digest_changes_with_the_sources_that_the_kernel_is_made_of_and_with_no_others(installed: Path) -> None:
    kernels = installed / "toolkit" / "kernels"

    def digest() -> str:
        return cache.sources_digest.__wrapped__(kernels / "outer.py", kernels)

    before = digest()
    (kernels / "other.py").write_text(INNER.format(value=7))
    assert digest() == before
    for path in (kernels / "outer.py", kernels / "room" / "inner.py"):
        path.write_text(path.read_text() + "\n")
        assert digest() != before
        before = digest()


def test_all_that_the_tracker_s_kernels_import_is_in_their_digest() -> None:
    names = {path.relative_to(cache.FOLDER).as_posix() for path in cache.imported(cache.FOLDER / "fit" / "pairs.py")}
    assert names == {"fit/pairs.py", "fit/twists.py", "image/pixel_search.py", "kinematics.py", "linear.py"}


def _of_this_file() -> None:
    pass


def test_functions_of_other_packages_are_cached_as_numba_does() -> None:
    from numba.core.caching import CompileResultCacheImpl

    digest = cache.sources_digest(cache.FOLDER / "fit" / "pairs.py")
    assert digest in CompileResultCacheImpl(pairs.mean_nearest.py_func).filename_base
    assert digest not in CompileResultCacheImpl(_of_this_file).filename_base


def test_help_answers_without_numba() -> None:
    code = (
        "import sys, toolkit.app.cli.main as main\ntry: main.app(['--help'])\nexcept SystemExit: pass\n"
        "assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


class _Trap:
    """What a pickle of a stranger does."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, (str(self.mark),)


DAMAGES: dict[str, Callable[[bytes, Path], bytes]] = {
    "empty": lambda content, mark: b"",
    "cut": lambda content, mark: content[: len(content) // 2],
    "zeros": lambda content, mark: content[:100] + bytes(len(content) - 100),
    "another byte": lambda content, mark: content[:-9] + bytes([content[-9] ^ 1]) + content[-8:],
    "a trap": lambda content, mark: pickle.dumps(_Trap(mark)),
}


def test_what_cannot_be_read_is_compiled_anew_and_never_unpickled(installed: Path, run: Run) -> None:
    folder = run(installed)[2]
    for number, (name, damage) in enumerate((*DAMAGES.items(), ("a trap", DAMAGES["a trap"]))):
        for path in folder.glob(f"*.{'nbi' if number % 2 else 'nbc'}"):
            path.write_bytes(damage(path.read_bytes(), installed / "sprung"))
        assert run(installed)[:2] == (1, 0), name
    assert run(installed)[:2] == (1, 1), "it is whole again"
    assert not (installed / "sprung").exists()


def test_a_folder_that_others_may_write_is_not_used(installed: Path, tmp_path: Path, run: Run) -> None:
    shared = tmp_path / "shared"
    own = {"NUMBA_CACHE_DIR": str(shared), "XDG_CACHE_HOME": str(tmp_path / "home"), "HOME": str(tmp_path / "home")}
    first = run(installed, **own)[2]
    assert shared in first.parents and stat.S_IMODE(first.stat().st_mode) == 0o700
    first.chmod(0o777)
    beside = installed / "toolkit" / "kernels" / "room" / "__pycache__"
    beside.mkdir(exist_ok=True)
    (beside / "planted.nbi").touch()
    beside.chmod(0o777)
    second = run(installed, **own)[2]
    assert shared not in second.parents and run(installed, **own)[:2] == (1, 1)
    second.chmod(0o775)
    third = run(installed, **own)[2]
    assert third not in (first, second) and tmp_path / "home" in third.parents, "the user's cache folder"
    third.chmod(0o777)
    last = run(installed, **own)[2]
    assert last.parent == Path(tempfile.gettempdir()) and not last.exists(), "kept by that process alone"


def test_a_folder_of_somebody_else_is_not_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "link").symlink_to(".")
    assert is_private(tmp_path) and not is_private(tmp_path / "link") and not is_private(tmp_path / "none")
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    assert not is_private(tmp_path)


def test_a_full_disk_only_costs_the_next_compilation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = KernelFile(str(tmp_path), "pairs.add", "stamp")
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    file.save("key", "code")
    assert file.load("key") is None and not list(tmp_path.iterdir())
