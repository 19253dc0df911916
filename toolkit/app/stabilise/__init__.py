"""Stabilisation of finished tracks by recognised motions (`depthmocap stabilise`, thesis Chapter 6).

Owns the second tracking and the selection of trajectories. May import every other package of `toolkit`.
"""
