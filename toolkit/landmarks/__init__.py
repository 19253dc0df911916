"""Geodesic extrema, centre and facing of a person's cloud."""
