"""Compile the kernels of first commands into a folder: `python scripts/compile_kernels.py FOLDER`.

Two short recordings are drawn, tracked and described: one person before an empty scene and two people in a room, who
are tracked live too. A pose database is built of two motions. A folder with the kernels of these sources is left as it
is.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from toolkit.body.body import Body

FRAMES = 36
"""Frames of each recording: enough for keyframes, lookups and repairs."""
FOCAL, WIDTH, HEIGHT = 285.6, 320, 240
"""Intrinsics of a Kinect at half of its resolution."""
DISTANCE, WALL, FLOOR = 2.6, 4.5, 1.0
"""Metres from the camera to the people and to the wall, and of the camera above the floor."""


def drawn(bodies: Sequence[Body], poses: np.ndarray, noise: np.random.Generator) -> np.ndarray:
    """Return the depth image uint16 (H, W), millimetres, of bodies in poses (N, P), with 4 mm noise."""
    import numpy as np

    from toolkit.kernels.image import raster

    image = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    image[2:14, 2:14] = 2000  # a thing beside the people
    intrinsics = np.array([FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2])
    for body, pose in zip(bodies, poses, strict=True):
        vertices = body.vertex_positions(pose) * [1.0, -1.0, -1.0]
        projected, inverse = np.empty_like(vertices), np.empty(image.shape)
        raster.project(vertices, intrinsics, projected)
        raster.rasterise(projected, body.faces, inverse, np.empty(image.shape, dtype=np.int32))
        depth = 1000.0 / np.maximum(inverse, 1e-3) + noise.normal(0.0, 4.0, image.shape)
        image = np.where((inverse > 0) & ((image == 0) | (depth < image)), depth, image).astype(np.uint16)
    return image


def write_examples(folder: Path) -> tuple[Path, Path]:
    """Write a recording of one person before an empty scene, and one of two people in a room."""
    import numpy as np

    from toolkit.body.shape import subject_body
    from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
    from toolkit.recordings.writer import save_recording
    from toolkit.sensing.camera import Camera

    body, noise = subject_body("slim_male", seed=7), np.random.default_rng(0)
    clips = procedural_clips(SUBJECT_MOTIONS[:2], body=body, variations=1, seed=0)
    poses = np.stack([clip.poses[:FRAMES] for clip in clips])
    poses[..., 1] -= FLOOR
    poses[..., 2] -= DISTANCE
    camera = Camera(FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, WIDTH, HEIGHT)
    drop = (np.arange(HEIGHT)[:, None] - camera.cy) / FOCAL * np.ones(WIDTH)
    room = np.minimum(WALL, FLOOR / np.maximum(drop, 1e-6)) * 1000.0

    def in_room(people: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        for image in people:
            surroundings = (room + noise.normal(0.0, 4.0, room.shape)).astype(np.uint16)
            yield np.where(image > 0, image, surroundings)

    times, up = np.arange(FRAMES) / 30.0, (0.0, -1.0, 0.0)
    one = (drawn([body], poses[:1, frame], noise) for frame in range(FRAMES))
    apart = poses + np.array([[-0.6], [0.6]])[..., None] * np.eye(poses.shape[-1])[0]
    two = (drawn([body, body], apart[:, frame], noise) for frame in range(FRAMES))
    background = room.astype(np.uint16)
    save_recording(
        folder / "person.npz", depth=in_room(one), camera=camera, timestamps=times, background=background, up_camera=up,
        joints=(body.joint_positions(poses[0]) * [1.0, -1.0, -1.0]).astype(np.float32),
    )  # fmt: skip
    save_recording(folder / "room.npz", depth=in_room(two), camera=camera, timestamps=times)
    return folder / "person.npz", folder / "room.npz"


def track_examples(folder: Path) -> Path:
    """Track the two recordings in one pass and in two, score and draw the person; return the recording of the room."""
    import depthmocap
    from toolkit.app.pipeline import TrackerRecipe, track_recording
    from toolkit.database import DEFAULT_DATABASE
    from toolkit.evaluation.evaluate import evaluate_runs
    from toolkit.output.rendering.film import render_run
    from toolkit.recordings.opening import open_recording

    person, room = write_examples(folder)
    track_recording(open_recording(person), TrackerRecipe(database=DEFAULT_DATABASE).build(), folder / "run")
    if find_spec("open3d"):  # the scores of surfaces need it; pip builds without it
        evaluate_runs([folder / "run"])
    for name in ("film.webm", "sheet.png"):
        render_run(folder / "run", folder / name, frames=range(3))
    for passes in (1, 2):
        depthmocap.track(room, people="all", settings={"passes": passes})
    return room


def track_live_example(room: Path) -> None:
    """Track the people of a room frame by frame."""
    import depthmocap
    from toolkit.recordings.opening import open_recording

    tracker = depthmocap.Tracker(intrinsics=(FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2), people="all")
    slow = 5.0  # times as slow as recorded: bodies are learned in 18 of the frames
    for frame in open_recording(room).stream():
        tracker.step(frame.depth_mm, slow * frame.timestamp)
    tracker.finish()


def describe_example(room: Path, folder: Path) -> None:
    """Describe a recording, as `depthmocap info` does."""
    from toolkit.output.rendering.film import save_png
    from toolkit.output.rendering.survey_picture import picture
    from toolkit.people.description import describe
    from toolkit.recordings.opening import open_upright

    save_png(folder / "info.png", picture(describe(open_upright(room))))


def build_example(folder: Path) -> None:
    """Build a pose database of two motions."""
    from database_builder.build import Sampling, build_database
    from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips

    few = 40  # poses, of which the prior is learned
    clips = procedural_clips(SUBJECT_MOTIONS[:2], variations=1, seed=0)
    build_database(clips, folder / "poses.npz", Sampling(max_poses=few, seated=False), workers=1)


def main() -> None:
    """Compile into the folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="files of compiled kernels and their key")
    output = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        os.environ["NUMBA_CACHE_DIR"] = str(work / "cache")  # read when Numba is imported
        from toolkit.kernels.cache import BUILD_FILE, build_key, user_folder

        key = json.dumps(build_key(), indent=1) + "\n"
        if (output / BUILD_FILE).exists() and (output / BUILD_FILE).read_text(encoding="utf-8") == key:
            return
        described = work / "depthmocap-0.dist-info" / "METADATA"  # of a package that is not installed yet
        described.parent.mkdir()
        described.write_text("Metadata-Version: 2.1\nName: depthmocap\nVersion: 0\n", encoding="utf-8")
        sys.path.append(name)
        room = track_examples(work)
        track_live_example(room)
        describe_example(room, work)
        build_example(work)
        shutil.rmtree(output, ignore_errors=True)
        shutil.copytree(user_folder(), output)
        (output / BUILD_FILE).write_text(key, encoding="utf-8")
        print(f"{len(list(output.glob('*.nbc')))} compiled kernels in {output}")


if __name__ == "__main__":
    main()
