"""Writes `configs/hybrid.yaml` from the settings classes: `python scripts/write_configs.py`."""

from __future__ import annotations

from pathlib import Path

from toolkit.config import explained_text
from toolkit.files import save_text
from toolkit.tracking.settings import HybridSettings

HYBRID = Path(__file__).parents[1] / "configs" / "hybrid.yaml"
HEAD = """# The default tracker: Baak 2013 with what its section 5.5.5 left open. Copy this file to change values;
# what stays may be left out. configs/baak2013.yaml switches back to the paper.
# Written by scripts/write_configs.py from the settings classes, where values, units and reasons stand.

"""


def hybrid_text() -> str:
    """What stands in the file."""
    return HEAD + explained_text(HybridSettings())


if __name__ == "__main__":
    save_text(HYBRID, hybrid_text())
