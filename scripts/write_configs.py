"""Writes the settings files that show a tracker's defaults: `python scripts/write_configs.py`."""

from __future__ import annotations

from pathlib import Path

from toolkit.config import explained_text
from toolkit.files import save_text
from toolkit.hybrid.settings import HybridSettings
from toolkit.lopez2011.tracker import ParticleTrackerSettings
from toolkit.qammaz.tracker import SwarmTrackerSettings

FOLDER = Path(__file__).parents[1] / "configs"
HEADS: dict[type, str] = {
    HybridSettings: """
# The default tracker: Baak 2013 with what its section 5.5.5 left open. Copy this file to change values;
# what stays may be left out. configs/baak2013.yaml switches back to the paper.
""",
    SwarmTrackerSettings: """
# The swarm tracker: joints in the image and the depth are all it is told; no motion capture, no regressor,
# no database. A particle swarm (Qammaz) looks for the pose, the local optimisation of the hybrid tracker
# refines it, and the nearer of swarm and previous pose wins. Copy this file to change values; what stays may
# be left out. configs/qammaz.yaml is the paper's own variant.
""",
    ParticleTrackerSettings: """
# The particle filter of Lopez-Mendez 2011 for people seen from the waist up, without any motion capture, with
# local optimisation in competition. Copy this file to change values; what stays may be left out.
# configs/lopez2011.yaml is the paper's own variant.
""",
}
"""What stands above the settings of each class."""
WRITTEN = "# Written by scripts/write_configs.py from the settings classes, where values, units and reasons stand.\n\n"


def config_text(kind: type) -> str:
    """What stands in the file of a settings class."""
    return HEADS[kind].lstrip() + WRITTEN + explained_text(kind())


if __name__ == "__main__":
    for settings in HEADS:
        save_text(FOLDER / f"{settings().tracker}.yaml", config_text(settings))
