from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from toolkit.cli import demo
from toolkit.mocap.clip import PoseClip
from toolkit.skeleton import POSE_SIZE
from toolkit.track import Track


def test_motions_are_joined_without_a_jump() -> None:
    first, second = np.zeros((300, POSE_SIZE)), np.zeros((300, POSE_SIZE))
    first[:, 0] = np.linspace(0, 1, 300)
    second[:, 0], second[:, 1], second[:, 10] = 5.0, 0.2, 0.3
    joined = demo.joined_clips([PoseClip("a", first, 30.0, ""), PoseClip("b", second, 30.0, "")], demo.SECONDS).poses
    assert len(joined) == 2 * int(30 * demo.SECONDS) + demo.BLEND
    assert np.abs(np.diff(joined, axis=0)).max() < 0.06
    assert joined[-1, 1] == pytest.approx(0.2)  # the height above the floor stays that of the clip


def test_the_demo_does_the_main_job_from_motions_to_a_film(tmp_path: Path) -> None:
    doing: list[str] = []
    result = demo.run_demo(tmp_path / "demo", seconds=0.4, show=lambda what, done, total: doing.append(what))
    row = result.table.rows[0]
    assert row.frames == len(Track.load(tmp_path / "demo" / "run")) > 30
    assert row.error_mm is not None and row.error_mm < 60
    assert row.a100 is not None and row.a100 > 0.8
    assert set(result.summary.stage_ms) == set(row.stages_ms)
    assert all(path.exists() for path in result.files)
    suffixes = {path.suffix for path in result.files}
    assert {".npz", ".csv", ".json", ".png", ".webm", ".html"} <= suffixes
    assert len({what.split(":")[0] for what in doing}) >= 4
