"""Signals end a command without leftovers; workers end with their parent process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from toolkit.app.pipeline.watch import stop_request
from toolkit.io.interrupts import ENDING

SLOW = """
import os, signal, sys
from toolkit.app.cli import recording_verbs as info
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


PARENT = """
import os, sys, time
from concurrent.futures import ProcessPoolExecutor
from tests.test_signals import told
from toolkit.io.workers import end_with, task_of

def with_joblib():
    import joblib
    list(joblib.Parallel(n_jobs=2)(joblib.delayed(task_of(told))(i) for i in range(2)))

def with_futures():
    with ProcessPoolExecutor(2, initializer=end_with, initargs=(os.getpid(),)) as pool:
        list(pool.map(told, range(2)))

if __name__ == "__main__":
    {"joblib": with_joblib, "futures": with_futures}[sys.argv[1]]()
"""


def told(number: int) -> None:
    """Print the worker's id, then work longer than any test waits."""
    os.write(1, f"{os.getpid()}\n".encode())
    time.sleep(60)


@pytest.mark.skipif(os.name != "posix", reason="kills as POSIX does")
@pytest.mark.parametrize("kind", ["joblib", "futures"])
def test_the_workers_of_a_killed_process_end_soon(kind: str, tmp_path: os.PathLike[str]) -> None:
    script = os.path.join(tmp_path, "parent.py")
    with open(script, "w") as stream:
        stream.write(PARENT)
    parent = subprocess.Popen([sys.executable, script, kind], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    workers = [int(parent.stdout.readline()) for _ in range(2)]
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 20
    while alive := [worker for worker in workers if _lives(worker)]:
        if time.monotonic() > deadline:
            for worker in alive:
                os.kill(worker, signal.SIGKILL)
            pytest.fail(f"{alive} live on")
        time.sleep(0.1)


def _lives(process: int) -> bool:
    try:
        with open(f"/proc/{process}/stat") as stream:
            return stream.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
