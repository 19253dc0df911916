"""The examples run one after the other in one folder and one process."""

import runpy
import sys
from pathlib import Path

import pytest

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
