"""Biomechanics of finished tracks: foot contact, joint angles, gait, rises, removal of jitter and sliding.

Owns the ISB angles and the gait events. May import `toolkit.tracks` and the packages below it.
"""
