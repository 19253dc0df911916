"""The command `depthmocap` with one thin verb per stage of work.

Only the option parser is imported here and at the top of the verb modules, so that `--help` is fast.
"""

from __future__ import annotations

import gc
import io
import sys
from typing import Annotated

import typer

from toolkit.app.cli import (
    annotate,
    bench,
    body,
    data,
    database,
    demo,
    evaluate,
    export,
    inertial,
    info,
    joints,
    render,
    report,
    retrieval,
    simulate,
    stabilise,
    track,
)
from toolkit.app.cli.examples import add_examples
from toolkit.io.display_names import shown
from toolkit.io.errors import DepthMocapError, UsageError

app = typer.Typer(
    name="depthmocap",
    help="Tracks a person's full-body motion in depth recordings, stabilised by a database of mocap poses.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
    """Options of the command itself."""


app.command()(demo.demo)
app.add_typer(data.app, name="data")
app.add_typer(database.app, name="database")
app.add_typer(body.app, name="body")
app.command()(info.info)
app.command()(simulate.simulate)
app.command()(joints.joints)
app.command()(track.track)
app.command()(evaluate.evaluate)
app.command()(render.render)
app.command()(report.report)
app.command()(report.view)
app.command()(retrieval.index)
app.command()(retrieval.search)
app.command()(retrieval.learn)
app.command()(annotate.annotate)
app.command()(stabilise.stabilise)
app.add_typer(inertial.app, name="inertial")
app.command()(export.export)
app.command(context_settings=bench.CONTEXT)(bench.bench)
add_examples(app)


COLLECTED = 100_000
"""Allocations between two garbage collections; Python's default of 700 costs 7 % of a short track."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command. Exit code 0 is success, 1 failure, 2 wrong use; an error is one sentence."""
    gc.set_threshold(COLLECTED)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # file names may contain invalid UTF-8
    try:
        app(args=arguments, prog_name="depthmocap")
    except DepthMocapError as error:
        print(f"depthmocap: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, UsageError) else 1)
    except OSError as error:
        where = shown(error.filename or "a file")
        print(f"depthmocap: {where}: {error.strerror or error}; check the path", file=sys.stderr)
        sys.exit(1)
    except MemoryError:
        print("depthmocap: not enough memory; use fewer or smaller inputs", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
