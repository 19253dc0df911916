"""The commands whose calls fail in turn: as they are typed, with the default tracker, on tiny inputs."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from tests.database_helpers import write_bvh
from tests.failing_calls import Command
from tests.fake_tracker import write_recording
from tests.fuzz_files import body_file, database_file
from tests.run_helpers import write_run
from toolkit.app.cli.main import main
from toolkit.app.pipeline import run as pipeline
from toolkit.app.pipeline import second
from toolkit.app.stabilise import workflow
from toolkit.body import skeleton
from toolkit.people import survey
from toolkit.people.evidence import Evidence
from toolkit.people.sighting import PredictedBody, Sighting

FRAMES = 3


class TwoPeople:
    """Finds the same surface twice; the second one from the second frame on."""

    evidence: Mapping[int, Evidence] = MappingProxyType({})

    def __init__(self, camera: Any) -> None:
        self.camera, self._frames = camera, 0

    def find(
        self, depth_mm: np.ndarray, timestamp: float, predicted: Mapping[int, PredictedBody]
    ) -> tuple[Sighting, ...]:
        self._frames += 1
        depth = depth_mm.astype(np.float32) / 1000
        ids = (1, 2) if self._frames > 1 else (1,)
        return tuple(Sighting(i, depth * i, np.zeros(depth.shape, bool), self.camera) for i in ids)

    def redetect(self) -> None:
        pass

    def export_state(self) -> dict[str, Any]:
        return {"frames": self._frames}

    def restore_state(self, state: Mapping[str, Any]) -> None:
        self._frames = state["frames"]


def _take(folder: Path) -> None:
    write_recording(folder / "take.npz", FRAMES)
    database_file(folder)
    body_file(folder)


def _typed(*words: str | Path) -> None:
    """A command as it is typed; raises SystemExit where it fails."""
    try:
        main([str(word) for word in words])
    except SystemExit as stop:
        if stop.code:
            raise


def _track(given: Path, out: Path, *words: str) -> None:
    pipeline.MEMORY_SECONDS = second.MEMORY_SECONDS = -1.0  # a state after every frame
    files = ("--database", given / "poses.npz", "--body", given / "me.npz", "--output", out / "run")
    _typed("track", given / "take.npz", *files, "--resume", *words)


def _track_all(given: Path, out: Path) -> None:
    survey.find_people = lambda recording, *_, **__: TwoPeople(recording.camera)  # type: ignore[assignment]
    _track(given, out, "--people", "all")


def _mocap(folder: Path) -> None:
    for name in ("a", "b"):
        write_bvh(folder / f"{name}.bvh", seed=ord(name), frames=40)


def _build(given: Path, out: Path) -> None:
    options = ("--max-poses", "20", "--no-seated", "--no-parts", "--workers", "1", "--strict")
    _typed("database", "build", given, "--output", out / "poses.npz", *options)


def _index(given: Path, out: Path) -> None:
    _typed("index", given, "--output", out / "motions.index", "--workers", "1")


def _run(folder: Path) -> None:
    write_run(folder / "run", np.zeros((12, skeleton.POSE_SIZE)))


def _export(given: Path, out: Path) -> None:
    for suffix in (".glb", ".bvh", ".csv", ".trc"):
        _typed("export", given / "run", "--output", out / f"motion{suffix}")


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
    _typed("stabilise", given / "wrong", "--classes", given / "classes.npz", "--output", out / "stable")


def _prepare_stabilising(folder: Path) -> None:
    _stabilising(folder)
    _ROUNDS[:] = workflow.stabilise_run(folder / "wrong", folder / "classes.npz", folder / "stable")
    shutil.rmtree(folder / "stable")


COMMANDS = {
    "track": Command(_take, _track),
    "track --people all": Command(_take, _track_all),
    "database build": Command(_mocap, _build),
    "index": Command(_mocap, _index),
    "export": Command(_run, _export),
    "stabilise": Command(_prepare_stabilising, _stabilise),
}
