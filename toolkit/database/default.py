"""Pose database of the package, the default of every command.

`scripts/make_default_database.py` builds it from motions of the CMU Graphics Lab and of the project. Its notice is
`assets/LICENSE.md`; the file lists every source with its SHA-256.
"""

from __future__ import annotations

from pathlib import Path

from toolkit.io.errors import DatabaseError
from toolkit.io.files import is_file

DEFAULT_DATABASE = Path(__file__).parent / "assets" / "default.npz"


def default_database_path() -> Path:
    """Return the path of the pose database of the package.

    Raises
    ------
    DatabaseError
        The package has no database.
    """
    if not is_file(DEFAULT_DATABASE):
        raise DatabaseError(
            f"this installation lacks {DEFAULT_DATABASE}; install it again, or name a database with --database"
        )
    return DEFAULT_DATABASE
