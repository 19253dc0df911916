"""The scripts behind `make`, with stubs in the place of the system."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts"
TOOLS = (
    "bash",
    "sh",
    "env",
    "cat",
    "cut",
    "dirname",
    "grep",
    "mkdir",
    "rm",
    "sha256sum",
    "sort",
    "touch",
    "tr",
    "chmod",
)


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A project folder with the scripts, whose `bin` holds the only programs that they can call."""
    shutil.copytree(SCRIPTS, tmp_path / "scripts", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / "bin").mkdir()
    for tool in TOOLS:
        (tmp_path / "bin" / tool).symlink_to(shutil.which(tool) or tool)
    return tmp_path


def stub(machine: Path, name: str, body: str) -> None:
    file = machine / "bin" / name
    file.write_text(f"#!/usr/bin/env bash\n{body}\n")
    file.chmod(0o755)


def call(machine: Path, *command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=machine,
        env={"PATH": str(machine / "bin"), "HOME": str(machine), **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )


LIBRARIES = (
    "libusb-1.0.so.0",
    "libGL.so.1",
    "libEGL.so.1",
    "libX11.so.6",
    "libudev.so.1",
    "libidn2.so.0",
    "libgomp.so.1",
)


def test_with_all_libraries_nothing_is_installed(machine: Path) -> None:
    stub(machine, "ldconfig", "printf '\\t%s => /lib/x\\n' " + " ".join(LIBRARIES))
    stub(machine, "apt-get", "echo called; exit 1")
    done = call(machine, "scripts/check_system_libraries.sh")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_without_root_and_sudo_the_exact_line_is_said(machine: Path) -> None:
    stub(machine, "ldconfig", "printf '\\t%s => /lib/x\\n' " + " ".join(LIBRARIES[2:]))
    stub(machine, "apt-get", "echo called; exit 0")
    stub(machine, "id", "echo 1000")
    done = call(machine, "scripts/check_system_libraries.sh")
    assert done.returncode == 1 and not done.stdout
    line = "apt-get update && apt-get install -y --no-install-recommends libgl1 libusb-1.0-0"
    assert done.stderr.strip().endswith(line)


@pytest.mark.parametrize("user", ["0", "1000"])
def test_with_root_or_sudo_the_missing_libraries_are_installed(machine: Path, user: str) -> None:
    stub(machine, "ldconfig", "printf '\\t%s => /lib/x\\n' " + " ".join(LIBRARIES[1:]))
    stub(machine, "apt-get", 'echo "$@" >> calls')
    stub(machine, "id", f"echo {user}")
    if user != "0":
        stub(machine, "sudo", 'while [[ $1 == -* ]]; do shift; done; "$@"')
        stub(machine, "true", "exit 0")
    assert call(machine, "scripts/check_system_libraries.sh").returncode == 0
    assert (machine / "calls").read_text().splitlines() == [
        "update -q",
        "install -y -q --no-install-recommends libusb-1.0-0",
    ]


def test_a_failing_installation_says_the_line_too(machine: Path) -> None:
    stub(machine, "ldconfig", "true")
    stub(machine, "apt-get", "exit 100")
    stub(machine, "id", "echo 0")
    done = call(machine, "scripts/check_system_libraries.sh")
    assert done.returncode == 1 and "could not be installed" in done.stderr and "libgomp1" in done.stderr


PYTHON = """
if [ "$1" = -c ]; then case "$2" in
    *sys.exit*) exit ${OLD:-0};;
    *ensurepip*) exit ${NO_VENV:-0};;
    *version_info*) echo 3.11; exit 0;;
esac; fi
if [ "$2" = venv ]; then mkdir -p "$3/bin"; cat > "$3/bin/python" <<'END'
#!/usr/bin/env bash
echo "$@" >> pip_calls
exit ${PIP_FAILS:-0}
END
chmod +x "$3/bin/python"; fi
"""


def environment(machine: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    return call(machine, "scripts/make_environment.sh", ".venv", **variables)


def test_an_environment_is_made_once_and_again_when_the_project_changes(machine: Path) -> None:
    stub(machine, "python3", PYTHON)
    for _ in range(2):
        assert environment(machine).returncode == 0
    calls = machine / "pip_calls"
    assert len(calls.read_text().splitlines()) == 1 and "--editable .[dev]" in calls.read_text()
    (machine / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    assert environment(machine).returncode == 0
    assert len(calls.read_text().splitlines()) == 2


def test_a_failed_installation_leaves_no_half_made_environment(machine: Path) -> None:
    stub(machine, "python3", PYTHON)
    done = environment(machine, PIP_FAILS="1")
    assert done.returncode != 0 and "run make again" in done.stderr
    assert not (machine / ".venv").exists()
    assert environment(machine).returncode == 0


def test_an_environment_that_was_killed_in_the_making_is_made_again(machine: Path) -> None:
    stub(machine, "python3", PYTHON)
    (machine / ".venv").mkdir()
    (machine / ".venv" / ".unfinished").write_text("")
    (machine / ".venv" / "rubbish").write_text("")
    assert environment(machine).returncode == 0
    assert not (machine / ".venv" / "rubbish").exists() and not (machine / ".venv" / ".unfinished").exists()


def test_an_environment_of_somebody_else_is_never_removed(machine: Path) -> None:
    stub(machine, "python3", PYTHON)
    (machine / ".venv" / "bin").mkdir(parents=True)
    mine = machine / ".venv" / "bin" / "python"
    mine.write_text("#!/usr/bin/env bash\nexit 1\n")
    mine.chmod(0o755)
    assert environment(machine).returncode != 0
    assert mine.exists()


def test_without_a_fitting_python_the_ways_out_are_said(machine: Path) -> None:
    done = environment(machine)
    assert done.returncode != 0 and "make PYTHON=" in done.stderr
    stub(machine, "python3", PYTHON)
    done = environment(machine, PYTHON="python3", OLD="1")
    assert done.returncode != 0 and "not a Python 3.10 to 3.13" in done.stderr
    assert not (machine / ".venv").exists()


def test_a_python_without_venv_names_the_package_to_install(machine: Path) -> None:
    stub(machine, "python3", PYTHON)
    stub(machine, "apt-get", "exit 0")
    stub(machine, "id", "echo 1000")
    done = environment(machine, NO_VENV="1")
    assert done.returncode != 0
    assert "apt-get update && apt-get install -y --no-install-recommends python3.11-venv" in done.stderr
    assert not (machine / ".venv").exists()


def test_ci_runs_what_the_readme_tells() -> None:
    root = SCRIPTS.parent
    assert "make test" in (root / ".ci" / "run").read_text() and "make test" in (root / "README.md").read_text()
    assert os.access(root / ".ci" / "run", os.X_OK)
