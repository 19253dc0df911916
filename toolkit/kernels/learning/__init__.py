"""Compiled kernels of learned models: farthest-first selection, Gaussian mixtures, crops for the joint network.

Owns loops over arrays only. May import other kernels.
"""
