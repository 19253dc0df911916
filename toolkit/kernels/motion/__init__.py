"""Compiled loops over motions."""
