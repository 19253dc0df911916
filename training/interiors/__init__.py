"""Randomly furnished rooms for training images and benchmarks."""
