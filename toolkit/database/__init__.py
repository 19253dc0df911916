"""Pose database: canonical poses, nearest-neighbour query, pose prior, the database of the package.

Owns the database file. May import `toolkit.mocap` and the packages below it.
"""

from pathlib import Path

DEFAULT_DATABASE = Path(__file__).parent / "assets" / "default.npz"
"""Pose database of the package, the default of every command, from motions of the CMU Graphics Lab and of the project
(`scripts/make_default_database.py`). Its notice is `assets/LICENSE.md`; it lists every source with its SHA-256."""
