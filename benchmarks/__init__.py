"""Benchmarks: each script measures figures, prints them and stores them as JSON with machine, commit and settings."""
