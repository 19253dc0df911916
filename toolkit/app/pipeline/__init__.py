"""Runs of a tracker over recordings: progress, timing, interruption, resuming, run folders."""

from toolkit.app.pipeline.batch import track_recordings, unreadable
from toolkit.app.pipeline.run import track_recording
from toolkit.app.pipeline.trackers import TrackerRecipe

__all__ = ["TrackerRecipe", "track_recording", "track_recordings", "unreadable"]
