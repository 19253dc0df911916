"""The command `depthmocap` with one thin verb per stage of work.

Only the option parser is imported here and at the top of the verb modules, so that `--help` is fast.
"""

from __future__ import annotations

import atexit
import gc
import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, TextIO

import typer

from toolkit.app.cli import (
    bench,
    data,
    database,
    demo,
    evaluate,
    inertial,
    live,
    motion_verbs,
    recording_verbs,
    retrieval,
    run_verbs,
    simulate,
    track,
)
from toolkit.app.cli.terminal import next_commands
from toolkit.io.display_names import printable, shown
from toolkit.io.errors import DepthMocapError, PlausibilityWarning, SeveralPeopleError, UsageError
from toolkit.io.interrupts import endings_as_exits

EXAMPLES: dict[str, tuple[str, ...]] = {
    "demo": ("depthmocap demo --output demo", "depthmocap demo --real --output demo"),
    "data list": ("depthmocap data list", "depthmocap data list hdm05"),
    "data fetch": ("depthmocap data fetch two-people", "depthmocap data fetch cmu-mocap hdm05 --data recordings"),
    "data where": ("depthmocap data where hdm05",),
    "database build": (
        "depthmocap database build --output poses.npz",
        "depthmocap database build mocap/cmu mocap/hdm05 --output poses.npz --max-poses 25000",
    ),
    "database info": ("depthmocap database info poses.npz",),
    "body scan": ("depthmocap body scan front.npz left.npz back.npz right.npz --output me.npz",),
    "info": ("depthmocap info take.npz",),
    "simulate": (
        "depthmocap simulate walk.bvh --output take.npz",
        "depthmocap simulate kick.bvh --body heavy_female --sensor kinect --distance 3 --yaw 45 --output take.npz",
    ),
    "joints": (
        "depthmocap joints --fetch",
        "depthmocap joints take.npz --joints colour --output take_joints.npz",
    ),
    "track": (
        "depthmocap track take.npz --output run",
        "depthmocap track recordings/a.mat recordings/b.mat --database poses.npz --output runs",
        "depthmocap track frames/ --segment person --subject nearest --output run",
        "depthmocap track raw/ --intrinsics 575,575,320,240 --size 640,480 --output run",
    ),
    "live": (
        "depthmocap live realsense --record take.npz --stream udp://127.0.0.1:9000",
        "depthmocap live file:take.npz --people all",
    ),
    "evaluate": (
        "depthmocap evaluate run",
        "depthmocap evaluate runs --reference truth/ --output scores",
    ),
    "render": (
        "depthmocap render run --output run/film.webm",
        "depthmocap render run --output sheet.png --from 100 --to 200",
        "depthmocap render run --output plan.webm --panels depth,plan",
    ),
    "report": (
        "depthmocap report run --output report.html",
        "depthmocap report runs --output report.html --reference truth/",
    ),
    "export": (
        "depthmocap export run --output motion.glb",
        "depthmocap export run --output motion.bvh --rig mixamo",
    ),
    "index": ("depthmocap index mocap/hdm05 --output mocap.index",),
    "search": (
        "depthmocap search mocap.index --queries queries.json --label kick",
        "depthmocap search mocap.index --by-example kick.bvh",
    ),
    "learn": (
        "depthmocap learn clips/ --others mocap/cmu --output motions.npz",
        "depthmocap learn clips/ --templates --output classes.npz",
        "depthmocap learn clips/ --output queries.json",
    ),
    "annotate": ("depthmocap annotate long.amc --classes motions.npz --output annotated",),
    "stabilise": ("depthmocap stabilise run --classes classes.npz --output stable",),
    "inertial read": ("depthmocap inertial read sensors.csv --output sensors.npz",),
    "inertial calibrate": ("depthmocap inertial calibrate run --sensors sensors.npz --output calibration.json",),
    "inertial check": ("depthmocap inertial check run --sensors sensors.npz --output check",),
    "bench": ("depthmocap bench", "depthmocap bench accuracy --split report"),
    "reproduce": ("depthmocap reproduce baak2013 --list", "depthmocap reproduce thesis"),
}
"""Verb -> command lines that run without changes if their files exist."""

app = typer.Typer(
    name="depthmocap",
    help="Tracks a person's full-body motion in depth recordings, stabilised by a database of mocap poses.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def add_examples(app: typer.Typer, prefix: str = "") -> None:
    """Add the examples to the help of each command of `app` and of its groups."""
    for command in app.registered_commands:
        name = command.name or str(getattr(command.callback, "__name__", ""))
        if lines := EXAMPLES.get(prefix + name):
            command.epilog = "\n\n".join((f"Example{'s' if len(lines) > 1 else ''}:", *lines))
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_examples(group.typer_instance, f"{prefix}{group.name} ")


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        print(version("depthmocap"))
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Handle the options of the command itself."""


app.command()(demo.demo)
app.add_typer(data.app, name="data")
app.add_typer(database.app, name="database")
app.add_typer(recording_verbs.app, name="body")
app.command()(recording_verbs.info)
app.command()(simulate.simulate)
app.command()(recording_verbs.joints)
app.command()(track.track)
app.command()(live.live)
app.command()(evaluate.evaluate)
app.command()(run_verbs.render)
app.command()(run_verbs.report)
app.command()(run_verbs.view)
app.command()(retrieval.index)
app.command()(retrieval.search)
app.command()(retrieval.learn)
app.command()(motion_verbs.annotate)
app.command()(motion_verbs.stabilise)
app.add_typer(inertial.app, name="inertial")
app.command()(run_verbs.export)
app.command(context_settings=bench.CONTEXT)(bench.bench)
app.command()(bench.reproduce)
add_examples(app)


def main(arguments: list[str] | None = None) -> None:
    """Run the command; print an error as one sentence.

    Exit codes: 0 success, 1 failure, 2 wrong use, 3 success without a tracked person. A closed terminal or pipe does
    not stop the work and does not change the exit code.
    """
    # Allocations between two garbage collections; Python's default of 700 costs 7 % of a short track.
    collected = 100_000
    gc.set_threshold(collected)
    atexit.register(gc.freeze)  # a collection at the end of the process takes 0.4 s and frees what ends anyway
    with standard_streams(), endings_as_exits(), warnings.catch_warnings():
        warnings.simplefilter("always", PlausibilityWarning)
        warnings.showwarning = _show_warning
        _run(arguments)


def _run(arguments: list[str] | None) -> None:
    try:
        app(args=arguments, prog_name="depthmocap")
    except DepthMocapError as error:
        print(f"depthmocap: {error}", file=sys.stderr)
        typed = tuple(sys.argv[1:] if arguments is None else arguments)
        if isinstance(error, SeveralPeopleError) and typed[:1] == ("track",):
            next_commands(
                {
                    (*typed, "--people", "all"): "tracks each of them",
                    (*typed, "--subject", "largest"): "tracks the person with the largest area",
                }
            )
        sys.exit(2 if isinstance(error, UsageError) else 1)
    except OSError as error:
        where = shown(error.filename or "a file")
        print(f"depthmocap: {where}: {error.strerror or error}; check the path", file=sys.stderr)
        sys.exit(1)
    except MemoryError:
        print("depthmocap: not enough memory; use fewer or smaller inputs", file=sys.stderr)
        sys.exit(1)


class _LossyStream(io.TextIOBase):
    """A standard stream that drops what its terminal or pipe no longer takes."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text, or nothing where the other end is closed."""
        self._do(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush, or do nothing where the other end is closed."""
        self._do(self._stream.flush)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @property
    def closed(self) -> bool:
        """Return whether the stream below is closed."""
        return self._stream.closed

    def isatty(self) -> bool:
        """Return whether a terminal shows it."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Return the descriptor of the stream."""
        return self._stream.fileno()

    def _do(self, action: Callable[[], object]) -> None:
        try:
            action()
        except OSError:  # what is left in its buffer must not fail at the end of the process
            handle = os.open(os.devnull, os.O_WRONLY)
            os.dup2(handle, self._stream.fileno())
            os.close(handle)


@contextmanager
def standard_streams() -> Iterator[None]:
    """Make the standard streams accept all text while the block runs, even if their other end is closed."""
    before = sys.stdout, sys.stderr
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream is None:  # it was closed at the start: no other file may get its descriptor
            handle = os.open(os.devnull, os.O_WRONLY)
            if handle != number:
                os.dup2(handle, number)
                os.close(handle)
            stream = open(number, "w", closefd=False)  # noqa: SIM115
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files may be no UTF-8
        setattr(sys, name, _LossyStream(stream))
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        sys.stdout, sys.stderr = before


def _show_warning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
    """Print a warning as one sentence on the standard error."""
    print(f"depthmocap: warning: {printable(str(message))}", file=sys.stderr)


if __name__ == "__main__":
    main()
