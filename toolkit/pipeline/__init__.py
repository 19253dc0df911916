"""A tracker run over recordings: progress, timing, interruption, resuming and the run folder."""

from toolkit.pipeline.batch import track_recordings, unreadable
from toolkit.pipeline.joints import JointChoice
from toolkit.pipeline.manifest import Manifest, ManifestRow
from toolkit.pipeline.run import track_recording
from toolkit.pipeline.summary import RunSummary
from toolkit.pipeline.trackers import TrackerRecipe
from toolkit.progress import RecordingProgress

__all__ = [
    "JointChoice",
    "Manifest",
    "ManifestRow",
    "RecordingProgress",
    "RunSummary",
    "TrackerRecipe",
    "track_recording",
    "track_recordings",
    "unreadable",
]
