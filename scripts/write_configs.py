"""Writes the settings files that show a tracker's defaults: `python scripts/write_configs.py`."""

from __future__ import annotations

import inspect
import textwrap
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import yaml

from toolkit.io.files import save_text
from toolkit.io.typed_values import is_constant
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.lopez2011.tracker import ParticleTrackerSettings
from toolkit.trackers.qammaz.tracker import SwarmTrackerSettings

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


def explained_text(settings: Any, indent: str = "") -> str:
    """The settings, without constants, with what its class says of each value above it.

    The settings dataclasses tell of every field in the `Attributes` of their docstring what it is, in which unit, and
    why it has its value: there and nowhere else.
    """
    lines: list[str] = []
    said = attributes_of(type(settings))
    for field in (field for field in fields(settings) if not is_constant(field)):
        value = getattr(settings, field.name)
        for names, text in said.items():
            if names.split(", ")[0] == field.name:
                told = f"{names}: {text}" if ", " in names else text
                lines += textwrap.wrap(
                    told, 110, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ", break_on_hyphens=False
                )
        if is_dataclass(value):
            lines += [f"{indent}{field.name}:", explained_text(value, indent + "  "), ""]
        else:
            plain = list(value) if isinstance(value, tuple) else value
            flow = yaml.safe_dump(plain, default_flow_style=True, width=1000).removesuffix("\n...\n").strip()
            lines.append(f"{indent}{field.name}: {flow}")
    return "\n".join(lines).rstrip("\n") + ("\n" if not indent else "")


def attributes_of(kind: type) -> dict[str, str]:
    """What the docstring of a class says of its attributes: text by name, or by names with commas between them."""
    told: dict[str, str] = {}
    _, _, section = inspect.cleandoc(kind.__doc__ or "").partition("Attributes\n----------\n")
    for line in section.splitlines():
        if line and not line.startswith(" "):
            names, _, text = line.partition(" : ")
            told[names] = text
        elif line:
            told[names] += " " + line.strip()
        else:
            break
    return told


def config_text(kind: type) -> str:
    """What stands in the file of a settings class."""
    return HEADS[kind].lstrip() + WRITTEN + explained_text(kind())


if __name__ == "__main__":
    for settings in HEADS:
        save_text(FOLDER / f"{settings().tracker}.yaml", config_text(settings))
