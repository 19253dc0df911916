"""What every benchmark writes beside its figures: machine, commit, command."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from toolkit.files import save_json

RESULTS = Path(__file__).parent / "results"


def save_figures(name: str, figures: Any, settings: dict[str, Any]) -> Path:
    """Write `benchmarks/results/<name>.json` and return its path."""
    path = RESULTS / f"{name}.json"
    save_json(
        path,
        {
            "figures": figures,
            "settings": {name: _portable(value) for name, value in settings.items()},
            "command": " ".join([Path(sys.argv[0]).name, *map(_portable, sys.argv[1:])]),
            "machine": {
                "processor": _processor(),
                "processors": os.cpu_count(),
                "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
                "python": platform.python_version(),
                "system": platform.system(),
            },
            "commit": _commit(),
            "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        },
    )
    return path


def _portable(value: Any) -> Any:
    """A path from the root of this machine without its folders; anything else as it is."""
    return Path(value).name if isinstance(value, (str, Path)) and Path(value).is_absolute() else value


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor()


def _commit() -> str:
    """Commit of the checkout, with a plus if it has changes."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"
