"""People in a frame: detection, segmentation, identities.

A `PeopleFinder` returns sightings: the depth of each person and the unobserved pixels; vertical and floor.
May import `sensing`, `body`, `kernels` and `io`.
"""
