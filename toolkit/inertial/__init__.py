"""Inertial sensors: their files, orientations, synchronisation, calibration, and distance from a track.

Owns the canonical sensor file and `calibration.json`. May import `toolkit.fitting` and the packages below it.
"""
