"""Typical errors of the figures of a report: `depthmocap bench gait`, simulated recordings with exact truth."""

EXPECTED: dict[str, float] = {}
"""Mean absolute errors by figure, in the figure's unit."""
