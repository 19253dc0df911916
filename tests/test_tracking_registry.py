"""Trackers by name: the steps of `docs/extending.md`."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.fake_tracker import FakeTracker, write_recording
from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.io.errors import SettingsError, UsageError
from toolkit.recordings.opening import open_recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracking import registry
from toolkit.tracking.registry import Registration, names, register, registered
from toolkit.tracks import RunInfo, Track


@dataclass(frozen=True)
class ToySettings:
    tracker: str = "toy"
    seed: int = 0
    weight: float = 0.5
    smallest_person: int = 1
    sensing: SensingSettings = field(default_factory=SensingSettings)


class ToyTracker(FakeTracker):
    """Tracker with its own settings."""

    def __init__(self, settings: ToySettings) -> None:
        super().__init__(weight=settings.weight)
        self.settings = settings  # type: ignore[assignment]


def build(settings: ToySettings, database: object, path: str) -> ToyTracker:
    assert database is None and path == ""
    return ToyTracker(settings)


TOY = Registration(ToySettings, needs_database=False, build=build)


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(registry, "REGISTERED", {})
    register("toy", TOY)
    yield


@pytest.mark.usefixtures("toy")
def test_a_tracker_that_the_settings_name_runs_without_a_database(tmp_path: Path) -> None:
    (tmp_path / "toy.yaml").write_text("tracker: toy\nweight: 0.25\n")
    tracker = TrackerRecipe(tmp_path / "toy.yaml", {"seed": 3}).build()
    assert isinstance(tracker, ToyTracker) and tracker.settings.weight == 0.25
    recording = open_recording(write_recording(tmp_path / "take.npz"))
    track_recording(recording, tracker, tmp_path / "run")
    info = RunInfo.load(tmp_path / "run")
    assert (info.tracker, info.seed) == ("toy", 3)
    assert len(Track.load(tmp_path / "run")) == len(recording)
    assert "tracker: toy" in (tmp_path / "run" / "config.yaml").read_text()


@pytest.mark.usefixtures("toy")
def test_an_unknown_tracker_is_named_with_the_registered_ones() -> None:
    with pytest.raises(SettingsError, match="no tracker 'magic'; there are: .*hybrid.*toy"):
        TrackerRecipe(None, {"tracker": "magic"}).build()
    assert {"hybrid", "toy"} <= set(names())


@pytest.mark.usefixtures("toy")
def test_a_name_is_given_once() -> None:
    register("toy", TOY)  # a module that is imported again changes nothing
    with pytest.raises(UsageError, match="'toy' already"):
        register("toy", Registration(ToySettings, needs_database=True, build=build))


def test_the_hybrid_tracker_needs_a_database() -> None:
    assert registered("hybrid").needs_database
    with pytest.raises(UsageError, match="needs a pose database"):
        TrackerRecipe().build()
