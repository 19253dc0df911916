"""The pose database that lies in the package, for those who name none.

It is made by `scripts/make_default_database.py` of motions of the CMU Graphics Lab and of the project's own; its notice
is `assets/LICENSE.md`, and its file names every source with the SHA-256 of what was read.
"""

from __future__ import annotations

from pathlib import Path

from toolkit.io.errors import DatabaseError
from toolkit.io.files import is_file

DEFAULT_DATABASE = Path(__file__).parent / "assets" / "default.npz"


def default_database_path() -> Path:
    """Path of the pose database of the package.

    Raises
    ------
    DatabaseError
        The package came without it.
    """
    if not is_file(DEFAULT_DATABASE):
        raise DatabaseError(
            f"this installation lacks {DEFAULT_DATABASE}; install it again, or name a database with --database"
        )
    return DEFAULT_DATABASE
