"""Depth sensing: cameras, recordings, conversion and filtering of depth, point clouds, joints in images.

Owns the canonical form of a recording. May import `toolkit.io`, `toolkit.kernels` and `toolkit.body`.
"""
