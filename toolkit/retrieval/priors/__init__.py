"""Motion priors for occluded limbs of a track (thesis Chapter 6).

Owns gap detection, allocation to class templates, predicted angles, foot contact and candidate trajectories.
May import the rest of `toolkit.retrieval` and the packages below it.
"""
