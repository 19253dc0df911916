"""Numba without SciPy's linear algebra: what the commands start with, and that it changes no result."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
{first}
from toolkit.kernels import dtw
import numpy as np
bits, mask = np.array([1, 2], np.uint64), np.array([3, 3], np.uint64)
cost, start = dtw.distance_function(bits, mask, np.array([0.5, 0.25]), np.array([1, 3, 2], np.uint64))
print(cost.tolist(), start.tolist(), "scipy.linalg" in sys.modules)
"""
QUICK = "from toolkit.kernels.start import start_without_blas; start_without_blas()"


def printed(first: str) -> str:
    return subprocess.run([sys.executable, "-c", PROGRAM.format(first=first)], capture_output=True, text=True).stdout


def test_a_command_starts_without_the_linear_algebra_of_scipy_and_its_kernels_say_the_same() -> None:
    quick, usual = printed(QUICK), printed("")
    assert quick.split()[-1] == "False" and usual.split()[-1] == "True"
    assert quick.split()[:-1] == usual.split()[:-1] != []


def test_scipy_can_be_imported_afterwards_and_what_was_imported_before_stays() -> None:
    assert printed(QUICK + "; import scipy.linalg; assert scipy.linalg.norm([3, 4]) == 5").split()[-1] == "True"
    assert printed("import scipy.linalg; " + QUICK).split()[-1] == "True"
