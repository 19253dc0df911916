"""Workers end with their parent process."""

import os
import signal
import subprocess
import sys
import time

import pytest

PARENT = """
import os, sys, time
from concurrent.futures import ProcessPoolExecutor
from tests.test_workers import told
from toolkit.io.workers import Task, end_with

def with_joblib():
    import joblib
    list(joblib.Parallel(n_jobs=2)(joblib.delayed(Task.of(told))(i) for i in range(2)))

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
