"""Folder of downloaded data."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "DEPTHMOCAP_DATA"
"""Environment variable that names the folder."""


def data_folder() -> Path:
    """Return the folder of data sets and models: `DEPTHMOCAP_DATA`, else the user's data folder."""
    if own := os.environ.get(VARIABLE):
        return Path(own)
    from platformdirs import user_data_path

    return user_data_path("depthmocap", appauthor=False)
