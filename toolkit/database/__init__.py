"""Pose database: canonical poses, nearest-neighbour query, pose prior, the database of the package.

Owns the database file. May import `toolkit.mocap` and the packages below it.
"""
