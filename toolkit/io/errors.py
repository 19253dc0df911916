"""Error classes of the toolkit; each message gives the problem, the value and the remedy."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from toolkit.io.display_names import printable


class DepthMocapError(Exception):
    """Base of every error that the toolkit raises on purpose; the command prints it as one sentence.

    Messages contain names and values from files. A line break becomes a space, and control characters are escaped.
    """

    def __str__(self) -> str:
        return printable(" ".join(super().__str__().splitlines()))


class PlausibilityWarning(UserWarning):
    """A recording or a track that can be used and is probably not what was meant (`docs/troubleshooting.md`)."""


class UsageError(DepthMocapError):
    """An argument or a combination of options that cannot work (exit code 2)."""


class SettingsError(UsageError):
    """A settings file or value that is unknown, of the wrong type or out of range."""


class RecordingError(DepthMocapError):
    """A depth recording that cannot be read or used."""


class SegmentationError(RecordingError):
    """A depth image that cannot be segmented into exactly one person."""


class SeveralPeopleError(SegmentationError):
    """Several people in view where one is to be selected."""

    @classmethod
    def of(cls, count: int) -> SeveralPeopleError:
        """Return the error about that number of people."""
        return cls(
            f"{count} people are in view; give --people all, --subject nearest or largest, or --segment seed:U,V "
            "(a pixel of the person)"
        )


class MocapError(DepthMocapError):
    """A motion capture file that cannot be read or used."""


class RigError(MocapError):
    """A skeleton whose joints are not the ones that a map or a feature needs."""


class BodyError(DepthMocapError):
    """A body asset, a shape or a pose vector that does not fit."""


class DatabaseError(DepthMocapError):
    """A pose database that cannot be built, read or used."""


class TrackError(DepthMocapError):
    """A run folder that is missing, unfinished or made by another version."""


class RetrievalError(DepthMocapError):
    """An index, a template, a keyframe query or an annotation that cannot be made or used."""


class InertialError(DepthMocapError):
    """Sensor data, a placement, a clock or a calibration that cannot be read or used."""


class ModelError(DepthMocapError):
    """A detector whose model or runtime is missing, or is not the one that is expected."""


class DataError(DepthMocapError):
    """A data set that is not there, cannot be fetched or is another one."""


class OutputError(DepthMocapError):
    """A result that cannot be written: no permission, no space, a name already taken."""


@contextmanager
def os_errors_as(error: type[DepthMocapError], what: str, remedy: str) -> Iterator[None]:
    """Turn an OSError of the block into `error`, with the message "`what`: reason of the system; `remedy`"."""
    try:
        yield
    except OSError as problem:
        raise error(f"{what}: {problem.strerror or problem}; {remedy}") from problem


def optional_package(name: str, extra: str, purpose: str) -> Any:
    """Import a package of an extra; raises UsageError with the purpose and the command that installs it."""
    package = name.partition(".")[0]
    try:
        importlib.import_module(package)  # a loaded submodule does not show that the package is there
        return importlib.import_module(name)
    except ImportError as error:
        raise UsageError(f"{purpose} needs the package {package}; type `pip install 'depthmocap[{extra}]'`") from error
