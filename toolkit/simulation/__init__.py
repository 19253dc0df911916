"""Simulated depth recordings with exact truth: people, clothes, rooms, depth and inertial sensors.

Owns sensor models and procedural furniture. May import `toolkit.trackers` and the packages below it.
"""
