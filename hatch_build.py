"""Build hook of the wheel: adds the kernels, compiled for the Python and the system that build it.

Without them, where they cannot be compiled or `DEPTHMOCAP_WITHOUT_KERNELS` is set, the wheel is one for every system
and compiles at first use.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NEEDED = (
    "filelock", "matplotlib", "numba", "numpy", "opencv-python-headless", "platformdirs", "pyyaml", "scikit-learn",
    "scipy",
)  # fmt: skip
"""Dependencies of the package that `scripts/compile_kernels.py` imports."""


class CompiledKernels(BuildHookInterface):
    """Adds `toolkit/kernels/compiled` to a wheel; an editable installation compiles at first use."""

    def dependencies(self) -> list[str]:
        """Return what a build in an environment of its own installs."""
        if os.environ.get("DEPTHMOCAP_WITHOUT_KERNELS"):
            return []
        return [text for text in self.metadata.core.dependencies if text.split(">")[0] in NEEDED]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and have the wheel named for this Python and system."""
        if version == "editable" or os.environ.get("DEPTHMOCAP_WITHOUT_KERNELS"):
            return
        folder = Path(self.root, "build", "kernels")  # kept: a build asks twice, for metadata and for the wheel
        path = os.pathsep.join(filter(None, [self.root, os.environ.get("PYTHONPATH")]))
        done = subprocess.run(
            [sys.executable, str(Path(self.root, "scripts", "compile_kernels.py")), str(folder)],
            env={**os.environ, "PYTHONPATH": path},
            check=False,
        )
        if done.returncode:
            self.app.display_warning("the kernels were not compiled: the wheel compiles them at first use")
            return
        build_data["force_include"][str(folder)] = "toolkit/kernels/compiled"
        build_data["pure_python"], build_data["infer_tag"] = False, True
