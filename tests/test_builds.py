"""`depthmocap bench database collections`: a build that fails is a row with its reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import database as builds
from tests.database_helpers import write_bvh
from toolkit.database.database import PoseDatabase


def test_a_build_is_a_row_and_one_that_fails_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(builds, "MOST_FILES", 1)
    monkeypatch.setattr(builds, "SMALL", replace(builds.SMALL, images=12, calibration=6))
    write_bvh(tmp_path / "walk.bvh", 1)
    row = builds.built([tmp_path / "walk.bvh"], np.random.default_rng(0))
    assert row["failure"] == "" and row["files"] == ["walk.bvh"] and row["poses"] > 3
    (tmp_path / "broken.bvh").write_text("nothing")
    assert "MocapError" in builds.built([tmp_path / "broken.bvh"], np.random.default_rng(0))["failure"]

    def broken(path: Path) -> PoseDatabase:
        raise ValueError("negative dimensions")

    monkeypatch.setattr(PoseDatabase, "load", staticmethod(broken))
    assert "negative dimensions" in builds.built([tmp_path / "walk.bvh"], np.random.default_rng(0))["failure"]
