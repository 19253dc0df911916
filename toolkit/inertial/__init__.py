"""Inertial sensors: their files, orientations, synchronisation, calibration, and guide of the tracker.

Owns the canonical sensor file and `calibration.json`. May import `toolkit.fitting` and the packages below it.
"""
