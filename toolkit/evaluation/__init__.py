"""Errors of tracks against truth and references.

Joint errors, agreement with other systems, marker files, extrema, checks by inertial sensors, tables.
May import `simulation`, `trackers` and packages below.
"""
