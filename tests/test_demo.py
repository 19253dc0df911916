"""The demonstrations and the examples run in one folder."""

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from toolkit.app.cli import demo
from toolkit.app.cli.main import main
from toolkit.datasets import registry
from toolkit.tracks import Track
from toolkit.tracks.runs import load_people


def test_the_demo_does_the_main_job_from_motions_to_a_film(tmp_path: Path) -> None:
    doing: list[str] = []
    result = demo.run_demo(tmp_path / "demo", seconds=0.4, show=lambda what, done, total: doing.append(what))
    assert result.table is not None
    row = result.table.rows[0]
    assert row.frames == len(Track.load(tmp_path / "demo" / "run")) > 30
    assert row.error_mm is not None and row.error_mm < 60
    assert row.a100 is not None and row.a100 > 0.8
    assert set(result.summary.stage_ms) == set(row.stages_ms)
    assert all(path.exists() for path in result.files)
    suffixes = {path.suffix for path in result.files}
    assert {".npz", ".csv", ".json", ".png", ".webm", ".html"} <= suffixes
    assert len({what.split(":")[0] for what in doing}) >= 4


def test_without_a_network_the_real_demo_names_the_simulated_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(registry, "GITHUB", "http://127.0.0.1:9/{repository}/{commit}/")
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(tmp_path / "data"))
    with pytest.raises(SystemExit, match="1"):
        main(["demo", "--real", "--output", str(tmp_path / "demo")])
    (line,) = capsys.readouterr().err.splitlines()
    assert "check the network" in line and line.endswith("`depthmocap demo` tracks a simulated recording")
    assert not (tmp_path / "demo").exists()


@pytest.mark.data("two-people")
def test_the_real_demo_tracks_two_men(data_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = registry.DATA_SETS[demo.REAL]
    kept = [line for line in (whole.assets / f"{demo.REAL}.tsv").read_text().splitlines() if "0002" in line]
    others = [line for line in (whole.assets / f"{demo.REAL}.tsv").read_text().splitlines() if ".png" not in line]
    (tmp_path / f"{demo.REAL}.tsv").write_text("\n".join(others + kept[:3]))
    monkeypatch.setitem(registry.DATA_SETS, demo.REAL, replace(whole, assets=tmp_path))
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(data_folder))
    result = demo.run_demo(tmp_path / "demo", real=True)
    assert len(load_people(result.run).people) == 2 and result.summary.frames == 3
    assert all(path.exists() for path in result.files)


EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("0*.py"))

WRITTEN = {
    "01_build_database": ("poses.npz",),
    "02_simulate": ("take.npz",),
    "03_track": ("run/track.npz", "run/run.json"),
    "04_evaluate": ("evaluation/table.csv", "evaluation/table.json", "evaluation/accuracy.png", "evaluation/error.png"),
    "05_render": ("film.webm", "contact_sheet.png", "fitted_depth.png"),
    "06_gestures": (),
    "07_find_motions": ("motions.index", "motions.npz", "labels/squat_2/report.html"),
    "08_open3d_clouds": ("clouds.webm",),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("examples")


def test_there_are_eight_examples_each_a_page() -> None:
    assert [path.stem for path in EXAMPLES] == list(WRITTEN)
    assert all(len(path.read_text().splitlines()) <= 60 for path in EXAMPLES)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_writes_what_it_promises(
    example: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", [str(example)])
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out
    for name in WRITTEN[example.stem]:
        assert (folder / "output" / name).stat().st_size > 0
