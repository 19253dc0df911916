"""Compiled loops on plain arrays."""

from toolkit.kernels.cache import install

install()
