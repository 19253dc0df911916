"""Compiled kernels of motion retrieval and inertial sensors: warping, keyframe search, relations, correlation.

Owns loops over arrays only. May import other kernels.
"""
