"""Compile the kernels of a first track into a folder: `python scripts/compile_kernels.py FOLDER`."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

SECONDS = 1.2
"""Seconds of each recording: enough for keyframes, lookups and repairs."""


def track_examples(folder: Path) -> None:
    """Simulate and track the two recordings in one pass and in two, score and draw the person."""
    import depthmocap
    from toolkit.app.pipeline import TrackerRecipe, track_recording
    from toolkit.body.shape import subject_body
    from toolkit.database.default import default_database_path
    from toolkit.evaluation.evaluate import evaluate_runs
    from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
    from toolkit.output.rendering.film import render_run
    from toolkit.simulation.person import SimulatedPerson
    from toolkit.simulation.simulate import CaptureSettings, simulate_scene

    body = subject_body("slim_male", seed=7)
    clips = [
        replace(clip, poses=clip.poses[: int(SECONDS * clip.frame_rate)])
        for clip in procedural_clips(SUBJECT_MOTIONS[:2], body=body, variations=1, seed=0)
    ]
    first = SimulatedPerson(clips[0], body=body)
    person = simulate_scene([first], folder / "person.npz", CaptureSettings(sensor="tof"))
    pair = [replace(first, at=(-0.6, 0.0)), SimulatedPerson(clips[1], at=(0.6, 0.0))]
    room = simulate_scene(pair, folder / "room.npz", CaptureSettings(sensor="kinect", background=False))
    track_recording(person, TrackerRecipe(database=default_database_path()).build(), folder / "run")
    evaluate_runs([folder / "run"])
    for name in ("film.webm", "sheet.png"):
        render_run(folder / "run", folder / name, frames=range(3))
    for passes in (1, 2):
        depthmocap.track(room.path, people="all", settings={"passes": passes})


def main() -> None:
    """Compile into the folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="created; files of compiled kernels and their key")
    output = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        os.environ["NUMBA_CACHE_DIR"] = str(work / "cache")  # read when Numba is imported
        from toolkit.kernels.cache import BUILD_FILE, build_key, user_folder

        track_examples(work)
        shutil.copytree(user_folder(), output)
        (output / BUILD_FILE).write_text(json.dumps(build_key(), indent=1) + "\n", encoding="utf-8")
        print(f"{len(list(output.glob('*.nbc')))} compiled kernels in {output}")


if __name__ == "__main__":
    main()
