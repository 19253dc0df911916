"""Stabilisation of finished tracks by recognised motions (`depthmocap stabilise`, thesis Chapter 6).

Owns the second tracking, the selection of trajectories and the result page. May import every other package of
`toolkit`.
"""
