"""Tracks as files for other programs: one format, one module; `run.py` knows them all by their suffix."""
