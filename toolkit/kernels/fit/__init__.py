"""Compiled loops of the fit: placing, drawing and pulling a body."""
