"""The pose database of those who name none: built once of the bundled motions and kept in the user's cache."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from toolkit.errors import DatabaseError, OutputError

Show = Callable[[str, int, int], None]
"""Called with what is being done, the steps done and all steps."""


def cache_folder() -> Path:
    """Where the system keeps what programs can make again, of depthmocap; `DEPTHMOCAP_CACHE` names another folder."""
    if own := os.environ.get("DEPTHMOCAP_CACHE"):
        return Path(own)
    from platformdirs import user_cache_path

    return user_cache_path("depthmocap", appauthor=False)


def default_database(show: Show) -> Path:
    """Path of the default database of this version; it is built if it is not there or cannot be used any more.

    Raises
    ------
    OutputError
        The cache cannot be written.
    """
    from importlib.metadata import version

    from database_builder.build import build_database
    from toolkit.database.database import PoseDatabase

    path = cache_folder() / f"poses-{version('depthmocap')}.npz"
    if path.exists():
        try:
            PoseDatabase.load(path)
            return path
        except DatabaseError:  # of another format, or damaged: it can be made again
            path.unlink()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # In a folder of its own, so that two commands that build at once do not meet.
        with tempfile.TemporaryDirectory(dir=path.parent, prefix="building-") as folder:
            built = Path(folder) / path.name
            build_database(
                None, built, progress=lambda stage, done, total: show(f"default database, once: {stage}", done, total)
            )
            os.replace(built, path)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(
            f"cannot keep the default database in {path.parent}: {reason}; name one with --database, "
            "or another folder as DEPTHMOCAP_CACHE"
        ) from error
    return path
