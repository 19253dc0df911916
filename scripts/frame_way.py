"""Draws the way of a depth frame through the house by watching it: `python scripts/frame_way.py`.

A simulated recording is tracked twice, once for longer. What is called more often in the longer run is called for every
frame; who calls whom, file by file, is drawn as a Mermaid flowchart into `docs/architecture.md`. Compiled loops, and
what is called on the way in floor 0, are left out.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from toolkit.body.shape import load_body
from toolkit.database.canonical import canonicalise
from toolkit.database.database import PoseDatabase
from toolkit.files import save_text
from toolkit.fitting.shape import ShapeSettings
from toolkit.pipeline.run import track_recording
from toolkit.sensing.opening import open_recording
from toolkit.testing.subjects import moving_poses, write_recording
from toolkit.tracking.hybrid import HybridTracker
from toolkit.tracking.settings import HybridSettings

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- written by scripts/frame_way.py -->", "<!-- until here -->"
FRAMES = (10, 22)
POSES, PIXELS = 300, 3000
GROUND = ("kernels", "errors.py", "files.py", "archives.py")
MOST_NAMES = 4

Call = tuple[str, str, str]
"""File of the caller, file of the callee, name of the callee."""


def watched(frames: int) -> Counter[Call]:
    """How often one file called a function of another while so many frames were tracked, in order of the first call."""
    calls: Counter[Call] = Counter()

    @cache
    def inside(filename: str) -> str:
        path = Path(filename)
        return path.relative_to(ROOT / "toolkit").as_posix() if path.is_relative_to(ROOT / "toolkit") else ""

    def watch(frame: FrameType, event: str, argument: Any) -> None:
        name = frame.f_code.co_name
        callee = inside(frame.f_code.co_filename)
        if event != "call" or not callee or name.startswith(("_", "<")):
            return
        above = frame.f_back
        while above is not None and not inside(above.f_code.co_filename):
            above = above.f_back  # through caches and the like, back into the house
        if above is not None and (caller := inside(above.f_code.co_filename)) != callee:
            calls[caller, callee, name] += 1

    with tempfile.TemporaryDirectory() as folder:
        write_recording(Path(folder) / "take.npz", PIXELS, frames)
        body = load_body("neutral")
        poses = canonicalise(moving_poses(POSES, np.random.default_rng(0)))[0]
        database = PoseDatabase.of_poses(
            poses, body, sources=["moving"], hashes=["0"], pose_source=np.zeros(POSES), pose_frame=np.arange(POSES),
            mirrored=np.zeros(POSES),
        )  # fmt: skip
        tracker = HybridTracker(database, HybridSettings(shape=ShapeSettings(seconds=0.0)))
        recording = open_recording(Path(folder) / "take.npz")
        track_recording(recording, tracker, Path(folder) / "compiled")
        sys.setprofile(watch)
        try:
            track_recording(recording, tracker, Path(folder) / "run")
        finally:
            sys.setprofile(None)
    return calls


def way() -> dict[tuple[str, str], list[str]]:
    """Names of the functions that one file calls in another for every frame or in turns, by both files."""
    few, many = (watched(frames) for frames in FRAMES)
    edges: dict[tuple[str, str], list[str]] = {}
    for (caller, callee, name), count in many.items():
        if count > few[caller, callee, name] and not callee.startswith(GROUND) and not caller.startswith(GROUND):
            edges.setdefault((caller, callee), []).append(name)
    return edges


def flowchart(edges: dict[tuple[str, str], list[str]]) -> str:
    """The edges as a Mermaid flowchart, a box for each room."""
    files = list(dict.fromkeys(file for edge in edges for file in edge))
    number = {file: f"n{k}" for k, file in enumerate(files)}
    lines = ["flowchart LR"]
    for room in dict.fromkeys(file.rpartition("/")[0] for file in files):
        lines.append(f'  subgraph {room.replace("/", "_") or "toolkit"}["{room or "toolkit"}/"]')
        lines += [f'    {number[f]}["{f.rpartition("/")[2]}"]' for f in files if f.rpartition("/")[0] == room]
        lines.append("  end")
    for (caller, callee), names in edges.items():
        told = ", ".join(names[:MOST_NAMES]) + (", ..." if len(names) > MOST_NAMES else "")
        lines.append(f'  {number[caller]} -->|"{told}"| {number[callee]}')
    return "\n".join(lines)


def shown(page: str) -> str:
    """The flowchart that stands in a page."""
    return page.partition(BEGIN)[2].partition(END)[0].strip().removeprefix("```mermaid\n").removesuffix("\n```")


if __name__ == "__main__":
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    save_text(PAGE, f"{before}{BEGIN}\n```mermaid\n{flowchart(way())}\n```\n{END}{after}")
