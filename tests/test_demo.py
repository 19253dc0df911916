from __future__ import annotations

from pathlib import Path

from toolkit.app.cli import demo
from toolkit.tracks import Track


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
