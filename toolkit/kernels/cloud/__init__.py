"""Compiled loops over clouds of points."""
