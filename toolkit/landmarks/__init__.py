"""Landmarks of a person's cloud.

Geodesic extrema (Baak 2013, 5.3), centre, facing and detected joints.
May import `recordings`, `people`, `sensing`, `body` and packages below.
"""
