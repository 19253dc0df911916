"""Numba, started without what no kernel here uses."""

from __future__ import annotations

import sys
from importlib import import_module

PRODUCTS = "scipy.linalg"
"""What Numba imports for products of matrices in compiled functions."""


def start_without_blas() -> None:
    """Start Numba as if SciPy had no linear algebra, unless either is there already: a command answers 0.2 s sooner.

    No kernel holds a product of matrices. For commands only: nobody else in the process could compile one any more.
    """
    if PRODUCTS in sys.modules:
        return
    sys.modules[PRODUCTS] = None  # type: ignore[assignment]
    try:
        import_module("numba.np.arraymath")
    finally:
        del sys.modules[PRODUCTS]
