"""Errors of tracks against truth and references.

Joint errors, agreement with other systems, marker files, extrema and orientation errors, tables.
May import `simulation`, `trackers` and packages below.
"""
