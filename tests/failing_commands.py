"""The commands whose calls fail in turn: on tiny inputs, with all their files."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from database_builder.build import Sampling, build_database
from tests.database_helpers import write_bvh
from tests.failing_calls import Command
from tests.fake_tracker import FakeTracker, write_recording
from tests.run_helpers import write_run
from toolkit import skeleton
from toolkit.export.run import export_run
from toolkit.people import survey
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.pipeline import run as pipeline
from toolkit.pipeline import track_recordings
from toolkit.retrieval.workflow.index import index_motions
from toolkit.stabilising import workflow

FRAMES = 4


class TwoPeople:
    """Finds the same surface twice; the second one from the third frame on."""

    def __init__(self, camera: Any) -> None:
        self.camera, self._frames = camera, 0

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        self._frames += 1
        depth = depth_mm.astype(np.float32) / 1000
        ids = (1, 2) if self._frames > 2 else (1,)
        return tuple(Sighting(i, depth * i, np.zeros(depth.shape, bool), self.camera) for i in ids)

    def export_state(self) -> dict[str, Any]:
        return {"frames": self._frames}

    def restore_state(self, state: Mapping[str, Any]) -> None:
        self._frames = state["frames"]


def _recording(folder: Path) -> None:
    write_recording(folder / "take.npz", FRAMES)


def _track(given: Path, out: Path) -> None:
    pipeline.MEMORY_SECONDS = -1.0  # a state after every frame
    track_recordings([given / "take.npz"], FakeTracker(), out / "run", resume=True)


def _track_all(given: Path, out: Path) -> None:
    pipeline.MEMORY_SECONDS = -1.0
    survey.find_people = lambda recording, *_, **__: TwoPeople(recording.camera)  # type: ignore[assignment]
    track_recordings([given / "take.npz"], FakeTracker(), out / "run", people=None, resume=True)


def _mocap(folder: Path) -> None:
    for name in ("a", "b"):
        write_bvh(folder / f"{name}.bvh", seed=ord(name), frames=40)


def _build(given: Path, out: Path) -> None:
    build_database([given], out / "poses.npz", Sampling(max_poses=20, seated=False), parts=None, workers=1)


def _index(given: Path, out: Path) -> None:
    index_motions([given], out / "motions.index")


def _run(folder: Path) -> None:
    write_run(folder / "run", np.zeros((12, skeleton.POSE_SIZE)))


def _export(given: Path, out: Path) -> None:
    for suffix in (".glb", ".bvh", ".csv", ".trc"):
        export_run(given / "run", out / f"motion{suffix}")


def _stabilising(folder: Path) -> None:
    from tests.test_stabilising import road

    class Factory:
        def mktemp(self, _: str) -> Path:
            return folder

    road.__wrapped__(Factory())  # type: ignore[attr-defined]


_ROUNDS: list[Any] = []


def _stabilise(given: Path, out: Path) -> None:
    """The command with its files; what it computes between reading and writing is computed once."""
    workflow.stabilise = lambda source, wanted, settings, **_: _ROUNDS  # type: ignore[assignment]
    workflow.stabilise_run(given / "wrong", given / "classes.npz", out / "stable")


def _prepare_stabilising(folder: Path) -> None:
    _stabilising(folder)
    _ROUNDS[:] = workflow.stabilise_run(folder / "wrong", folder / "classes.npz", folder / "stable")
    shutil.rmtree(folder / "stable")


COMMANDS = {
    "track": Command(_recording, _track),
    "track --people all": Command(_recording, _track_all),
    "database build": Command(_mocap, _build),
    "index": Command(_mocap, _index),
    "export": Command(_run, _export),
    "stabilise": Command(_prepare_stabilising, _stabilise),
}
