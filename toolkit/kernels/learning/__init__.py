"""Compiled kernels of learned models: farthest-first selection, Gaussian mixtures, regression forests.

Owns loops over arrays only. May import other kernels.
"""
