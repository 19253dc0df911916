"""Signals that end a command: no traceback, no temporary file, an exit code that says so, and the same work again."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from toolkit.app.pipeline.watch import stop_request
from toolkit.io.interrupts import ENDING

SLOW = """
import os, signal, sys
from toolkit.app.cli import info
from toolkit.app.cli.main import main
from toolkit.io import files
from toolkit.recordings import opening

def opened(*a, **k):
    with files.atomic_path(sys.argv[1] + "/out.npz") as temporary:
        temporary.write_bytes(b"half")
        os.kill(os.getpid(), int(sys.argv[2]))
        signal.pause()

opening.open_upright = opened
main(["info", __file__])
"""


@pytest.mark.parametrize("number", ENDING)
def test_a_command_that_is_ended_removes_its_temporary_files(tmp_path: Path, number: signal.Signals) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (tmp_path / "slow.py").write_text(SLOW)
    done = subprocess.run(
        [sys.executable, tmp_path / "slow.py", folder, str(int(number))], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}, timeout=120,
    )  # fmt: skip
    assert done.returncode == 128 + number and done.stderr == ""
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, *ENDING])
def test_a_signal_asks_a_run_to_stop_after_the_frame(number: signal.Signals) -> None:
    usual = signal.getsignal(number)
    with stop_request() as stop:
        signal.raise_signal(number)
        assert stop.is_set() and signal.getsignal(number) is usual  # a second one has its usual effect
    assert signal.getsignal(number) is usual


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    usual = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_request() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop.is_set()
    finally:
        signal.signal(signal.SIGHUP, usual)
