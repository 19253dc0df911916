"""Command-line options that the benchmarks of the trackers share."""

from __future__ import annotations

import argparse
from pathlib import Path

from database_builder.build import THRESHOLD
from database_builder.regressor import RegressorSettings
from toolkit.testing.suite import LONGEST, WORK, database


def add_take_options(parser: argparse.ArgumentParser) -> None:
    """Which part of the simulated suite."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--takes", type=int, help="at most so many takes of each group")
    parser.add_argument("--frames", type=int, default=LONGEST, help="at most so many frames of each take")


def add_database_options(parser: argparse.ArgumentParser) -> None:
    """With which database, settings of the trackers and work folder; see `poses_of`."""
    parser.add_argument("--database", type=Path, help="another database than the simulated suite's own")
    parser.add_argument("--threshold", type=float, default=THRESHOLD, help="of the suite's own database, Eq. 5.1")
    parser.add_argument("--images", type=int, default=RegressorSettings.images, help="that train its joint regressor")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of all trackers")
    parser.add_argument("--work", type=Path, default=WORK)


def poses_of(options: argparse.Namespace) -> Path:
    """The database that was asked for; the suite's own is made if it is not there yet."""
    return options.database or database(options.work, options.threshold, RegressorSettings(images=options.images))
