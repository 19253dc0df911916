"""Procedural rooms and furniture.

Owns meshes, pieces and furnished rooms. May import `toolkit.kernels` and `toolkit.io`.
"""
