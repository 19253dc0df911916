"""A tracker run over recordings: progress, timing, interruption, resuming and the run folder."""

from toolkit.pipeline.batch import run_folders, track_recordings, unreadable
from toolkit.pipeline.joints import JointChoice
from toolkit.pipeline.manifest import Manifest, ManifestRow
from toolkit.pipeline.many import track_many
from toolkit.pipeline.run import track_recording
from toolkit.pipeline.summary import BatchReport, RunSummary
from toolkit.pipeline.trackers import TrackerRecipe, load_tracker, tracker_settings
from toolkit.progress import RecordingProgress

__all__ = [
    "BatchReport",
    "JointChoice",
    "Manifest",
    "ManifestRow",
    "RecordingProgress",
    "RunSummary",
    "TrackerRecipe",
    "load_tracker",
    "run_folders",
    "track_many",
    "track_recording",
    "track_recordings",
    "tracker_settings",
    "unreadable",
]
