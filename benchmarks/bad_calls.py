"""What should not be typed: every verb with files of every bad kind and options of impossible values, at random.

    python -m benchmarks.bad_calls [--calls 2000] [--seed 0] [--first 0]

A call is right if it ends soon, with exit code 0, 1 or 2, without a traceback or an escape on the terminal, and leaves
the files of others as they were. Each runs in a forked process; a number always makes the same call.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import json
import os
import resource
import signal
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures

VALUES = (
    "", "0", "-1", "nan", "inf", "-inf", "1e9", "1e-9", "1e308", "9" * 40, "x", "[/red]", "$\\foo$", "a\nb", "\x1b[31m",
    "caf\udce9", "..", "/", "/dev/zero", "~", "a,b", "1,2,3", "-", "--", "null", "x" * 300, "=1+1", "0,0", "kinect",
    "\u202ezpn", "/dev/full", "/proc/self/mem", "1e400", "0x10", "٣", "%s%n", "{}", "*", "\t", "NaN,NaN,NaN", "1;2",
)  # fmt: skip
IMPORTED = (
    "toolkit.app.pipeline", "toolkit.evaluation.evaluate", "toolkit.output.report.page", "toolkit.output.export.run",
    "toolkit.simulation.simulate", "toolkit.inertial.workflow", "toolkit.retrieval.workflow.search_files",
    "toolkit.retrieval.workflow.annotate", "toolkit.retrieval.workflow.learn", "database_builder.build",
    "toolkit.trackers.hybrid.tracker", "toolkit.app.stabilise.workflow", "toolkit.app.pipeline.events",
)  # fmt: skip
"""Modules that every call would import anew."""
PATIENCE = 120
"""Seconds."""
MEMORY = 8 << 30


def options_of(verb: list[str]) -> list[str]:
    """Names of the options of a verb."""
    import typer

    from toolkit.app.cli.main import app

    command: Any = typer.main.get_command(app)
    for word in verb:
        command = getattr(command, "commands", {}).get(word, command)
    return [
        p.opts[0] for p in command.params if p.opts[0].startswith("--") and not p.is_flag and p.opts[0] != "--output"
    ]


def call(number: int, seed: int, folder: Path) -> list[str]:
    """The words of a call; what it reads is written into the folder."""
    from tests.test_bad_input import KINDS, NAMES, VERBS

    rng = np.random.default_rng([seed, number])
    (folder / "read").mkdir(parents=True)
    words = list(VERBS[sorted(VERBS)[rng.integers(len(VERBS))]])
    kinds = [kind for kind in KINDS if kind != "missing"]
    name = (*NAMES[:1], "bad.bvh", "bad.pcd", "bad.mkv", "bad.csv", "bad.yaml", "caf\udce9", "[red]",
            "a\nb.npz", "\x1b[31m.npz", "\u202ezpn.npz", "$\\foo$.npz")[rng.integers(12)]  # fmt: skip
    if rng.random() < 0.9:
        KINDS[kinds[rng.integers(len(kinds))]](folder / "read" / name)
    good = str(folder.parent / ("take.npz" if rng.random() < 0.7 else "run"))
    bad = good if rng.random() < 0.4 else str(folder / "read" / name)
    known_files = {"POSES": "poses.npz", "TAKE": "take.npz", "RUN": "run"}
    filled = {"BAD": bad, **{word: str(folder.parent / file) for word, file in known_files.items()}}
    words = [filled.get(w, str(folder / w) if w.startswith("OUT") else w) for w in words]
    known = options_of(words[:2])
    for _ in range(int(rng.integers(0, 4))):
        if known:
            words += [known[rng.integers(len(known))], VALUES[rng.integers(len(VALUES))]]
    return words


def outcome(number: int, seed: int, work: Path) -> tuple[str, list[str]]:
    """What a call came to, and its words."""
    folder = Path(tempfile.mkdtemp(dir=work))
    words = call(number, seed, folder)
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        said, code = io.StringIO(), 1
        try:
            signal.alarm(PATIENCE)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            os.chdir(folder)
            os.dup2(os.open(os.devnull, os.O_RDWR), 0)
            from toolkit.app.cli.main import main as command

            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                try:
                    command(words)
                    code = 0
                except SystemExit as stop:
                    code = stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 1
            text = said.getvalue()
            wrong = "FINDING: an escape" if "\x1b[31m" in text or "\u202e" in text else ""
            wrong = "FINDING: a traceback" if "Traceback" in text else wrong
            os.write(write, (wrong or f"exit code {code}").encode())
        except BaseException as error:
            os.write(write, f"FINDING: {type(error).__name__}: {error}"[:300].encode(errors="replace"))
        finally:
            os._exit(0)
    os.close(write)
    with open(read, "rb") as stream:
        told = stream.read().decode(errors="replace")
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        told = "FINDING: a hang" if os.WTERMSIG(status) == signal.SIGALRM else f"FINDING: signal {os.WTERMSIG(status)}"
    return told if told in ("exit code 0", "exit code 1", "exit code 2") else f"FINDING: {told}", words


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first call")
    options = parser.parse_args()
    work = Path(tempfile.mkdtemp(prefix="bad-calls-"))
    os.environ["NUMBA_BOUNDSCHECK"] = "1"
    from tests.database_helpers import small_database
    from tests.fake_tracker import write_recording
    from tests.run_helpers import write_run
    from toolkit.body import skeleton

    for module in IMPORTED:
        importlib.import_module(module)
    small_database(12).save(work / "poses.npz")
    write_recording(work / "take.npz", 3)
    write_run(work / "run", np.zeros((3, skeleton.POSE_SIZE)), recording=str(work / "take.npz"))
    others = {p: p.read_bytes() for p in work.rglob("*") if p.is_file()}
    table: Counter[str] = Counter()
    for number in range(options.first, options.first + options.calls):
        told, words = outcome(number, options.seed, work)
        if any(p.read_bytes() != content for p, content in others.items()):
            told = "FINDING: another's file was changed"
        table[told] += 1
        if told.startswith("FINDING"):
            print(number, told, json.dumps(words), flush=True)
    print(json.dumps(table))
    save_figures("bad_calls", dict(table), {"calls": options.calls, "seed": options.seed, "first": options.first})


if __name__ == "__main__":
    main()
