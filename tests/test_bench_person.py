"""The benchmark that tells people from rooms: figures of made-up probabilities, and a run of a few views."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import _record
from benchmarks import regressor as bench
from database_builder.regressor import RegressorSettings, train_regressor
from database_builder.views import ViewSettings
from tests.database_helpers import small_database
from tests.support import suite


def test_a_probability_that_means_what_it_says_has_no_error_whatever_the_share_of_people() -> None:
    rng = np.random.default_rng(0)
    truth = rng.random(60_000) < 0.5
    odds = rng.normal(np.where(truth, 1.0, -1.0), 1.0)
    honest = 1.0 / (1.0 + np.exp(-2.0 * odds))
    few = np.concatenate([np.flatnonzero(truth)[:2000], np.flatnonzero(~truth)])
    assert bench.error_at_even_odds(honest[few], truth[few]) < 0.03
    assert bench.error_at_even_odds(honest[few] ** 3, truth[few]) > 0.1
    figures = bench.figures_of({"pixel": honest[few], "pixel_truth": truth[few]}, "pixel")
    assert figures["auc"] == pytest.approx(0.921, abs=0.01)
    assert figures["people_over_half"] == pytest.approx(0.84, abs=0.02)
    assert figures["rest_over_half"] == pytest.approx(0.16, abs=0.02)


def test_a_small_regressor_is_measured_and_a_database_without_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(suite, "MOCAP", tmp_path / "absent")
    monkeypatch.setattr(_record, "RESULTS", tmp_path)
    monkeypatch.setattr(bench, "takes", lambda split: suite.takes(split)[:2])
    database = small_database()
    settings = RegressorSettings(
        images=30, pixels=60, trees=1, depth=6, smallest_leaf=15, questions=15, calibration=4,
        views=ViewSettings(rooms=1.0),
    )  # fmt: skip
    regressor = train_regressor(database.poses.astype(np.float64), settings)
    replace(database, regressor=regressor).save(tmp_path / "rooms.npz")
    replace(database, regressor=None).save(tmp_path / "alone.npz")
    monkeypatch.setattr(sys, "argv", ["bench", "people", "--views", "1", "--database", str(tmp_path / "rooms.npz")])
    bench.main()
    figures = json.loads((tmp_path / "person_tune.json").read_text())["figures"]
    assert set(figures) == {"pixel", "surface", "ms_per_thousand"} and 0 <= figures["pixel"]["ece"] <= 1
    assert "ms for a thousand pixels" in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", ["bench", "people", "--database", str(tmp_path / "alone.npz")])
    with pytest.raises(SystemExit):
        bench.main()
    assert "has no regressor; build it again" in capsys.readouterr().err
