"""Compiled kernels: the package's, else the user cache's; changed sources never run old code."""

import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from toolkit.kernels import cache
from toolkit.kernels.cache import KernelFile, is_private

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
    """Return an installation with two kernels in two files; the compiled code of one contains that of the other."""
    kernels = tmp_path / "toolkit" / "kernels"
    kernels.mkdir(parents=True)
    for name in ("__init__.py", "cache.py"):
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
"""Process with Numba and no kernel that forks, because importing Numba takes longer than the tests."""


class Starter:
    """Starter of processes that have imported Numba."""

    def __init__(self) -> None:
        variables = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
        self.process = subprocess.Popen(
            [sys.executable, "-c", SERVER], env={**variables, "PYTHONDONTWRITEBYTECODE": "1"}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def said(self, installation: Path, code: str, **environment: str) -> list[str]:
        """Return the lines that code prints in a new process with the installation's kernels."""
        assert self.process.stdin is not None and self.process.stdout is not None
        home = str(installation / "home")
        own = {"HOME": home, "XDG_CACHE_HOME": home} | environment
        variables = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")} | own
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
    """Return the outer kernel's result in a new process, whether it came from the cache, and the cache's path."""

    def found(installation: Path, **environment: str) -> tuple[int, int, Path]:
        value, hits, path = starter.said(installation, RUN, **environment)
        return int(value), int(hits), Path(path)

    return found


def test_a_kernel_follows_an_edit_in_the_file_of_another_one(installed: Path, run: Run) -> None:
    value, hits, path = run(installed)
    assert (value, hits) == (1, 0) and path.parent == installed / "home" / "depthmocap" / "kernels"
    assert not list((installed / "toolkit").rglob("*.nb[ic]")), "nothing is written into the package"
    assert run(installed)[:2] == (1, 1)
    inner = installed / "toolkit" / "kernels" / "room" / "inner.py"
    before = inner.stat()
    inner.write_text(INNER.format(value=2))
    os.utime(inner, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert run(installed)[:2] == (2, 0)
    inner.write_text(INNER.format(value=1))
    assert run(installed)[:2] == (1, 1)


def compile_into_package(installed: Path, starter: Starter) -> None:
    """Fill the package's folder of compiled kernels, as `scripts/compile_kernels.py` does."""
    code = """
        import json, shutil
        from toolkit.kernels import cache
        from toolkit.kernels.outer import outer
        outer()
        shutil.copytree(cache.user_folder(), cache.COMPILED)
        (cache.COMPILED / cache.BUILD_FILE).write_text(json.dumps(cache.build_key()))
    """
    starter.said(installed, textwrap.dedent(code), NUMBA_CACHE_DIR=str(installed / "building"))


RUN_WITH_LOG = "import logging, sys\nlogging.basicConfig(stream=sys.stdout, format='%(message)s')\n" + RUN


@pytest.fixture
def shipped(installed: Path, starter: Starter) -> Path:
    """Return an installation with compiled kernels in a read-only package."""
    compile_into_package(installed, starter)
    folder = installed / "toolkit" / "kernels" / "compiled"
    for path in folder.iterdir():
        path.chmod(0o444)
    folder.chmod(0o555)
    return installed


def test_compiled_kernels_of_the_package_are_used(shipped: Path, starter: Starter) -> None:
    value, hits, _ = starter.said(shipped, RUN_WITH_LOG)
    assert (value, hits) == ("1", "1"), "and no line says that something is compiled"
    assert not list((shipped / "home").rglob("*.nb[ic]"))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"Numba": "0.1"}, "for Numba 0.1, not"),
        ({"processor": "z80", "system": "cpm"}, "processor z80, not"),
        (None, "build.json cannot be read"),
    ],
)
def test_kernels_of_another_build_are_compiled_and_the_reason_is_logged_once(
    change: dict[str, str] | None, reason: str, shipped: Path, starter: Starter
) -> None:
    folder = shipped / "toolkit" / "kernels" / "compiled"
    key = folder / "build.json"
    folder.chmod(0o755)
    key.chmod(0o644)
    key.write_text(json.dumps(json.loads(key.read_text()) | change) if change else "{}")
    line, value, hits, _ = starter.said(shipped, RUN_WITH_LOG)
    assert line.startswith("compiling kernels") and reason in line
    assert (value, hits) == ("1", "0")
    assert starter.said(shipped, RUN_WITH_LOG)[:2] == ["1", "1"], "the second time from the user's cache"


def test_a_damaged_kernel_of_the_package_is_compiled(shipped: Path, run: Run) -> None:
    for path in (shipped / "toolkit" / "kernels" / "compiled").glob("outer*.nbc"):
        path.chmod(0o644)
        path.write_bytes(path.read_bytes()[:-1])
    assert run(shipped)[:2] == (1, 0)
    assert run(shipped)[:2] == (1, 1)


def test_the_latest_used_versions_of_all_kernels_are_kept(tmp_path: Path) -> None:
    for age, name in enumerate("abcd"):
        (tmp_path / (name * 16)).mkdir()
        (tmp_path / (name * 16) / "pairs.add-fit.pairs.py311.nbi").touch()
        os.utime(tmp_path / (name * 16), (1e9 - age, 1e9 - age))
    (tmp_path / "other").mkdir()
    cache.prune(tmp_path, kept=2)
    assert {path.name for path in tmp_path.iterdir()} == {"a" * 16, "b" * 16, "other"}


def test_help_answers_without_numba() -> None:
    code = (
        "import sys, toolkit.app.cli.main as main\ntry: main.app(['--help'])\nexcept SystemExit: pass\n"
        "assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_a_cut_cache_is_recompiled(installed: Path, run: Run) -> None:
    folder = run(installed)[2]
    for suffix in ("nbi", "nbc"):
        for share in (0.0, 0.5):
            for path in folder.glob(f"*.{suffix}"):
                path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
            assert run(installed)[:2] == (1, 0), suffix
    assert run(installed)[:2] == (1, 1), "it is whole again"


def test_a_folder_that_others_may_write_is_not_used(installed: Path, tmp_path: Path, run: Run) -> None:
    chosen, home = tmp_path / "chosen", tmp_path / "home"
    own = {"NUMBA_CACHE_DIR": str(chosen)}
    first = run(installed, **own)[2]
    assert chosen in first.parents and stat.S_IMODE(first.stat().st_mode) == 0o700
    first.chmod(0o777)
    second = run(installed, **own)[2]
    assert home in second.parents and run(installed, **own)[:2] == (1, 1), "the user's cache folder"
    second.chmod(0o775)
    last = run(installed, **own)[2]
    assert last.parent == Path(tempfile.gettempdir()) and not last.exists(), "stored for that process alone"


def test_a_folder_of_another_user_is_not_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "link").symlink_to(".")
    assert is_private(tmp_path) and not is_private(tmp_path / "link")
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    assert not is_private(tmp_path)


def test_a_full_disk_only_costs_the_next_compilation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = KernelFile(str(tmp_path), "pairs.add", "stamp")
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    file.save("key", "code")
    assert file.load("key") is None and not list(tmp_path.iterdir())
