"""Compiled loops: arrays in, arrays out.

Numba kernels by theme (image, cloud, fit, motion, learning), exact linear algebra, their cache.
May import `io` only.
"""

from toolkit.kernels.cache import install

install()
