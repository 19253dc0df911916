"""Tracking of people over frames (Baak 2013, 5.4).

Followers, searches, state as a value, the multi-person tracker, the second pass.
May import `motion`, `fitting` and packages below.
"""
