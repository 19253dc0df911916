"""Numbers of the papers beside the results; curves are drawn."""

import json
import re
from pathlib import Path

import pytest

from benchmarks import _papers
from benchmarks.all import COMMANDS
from tests.run_helpers import run
from toolkit.app.cli import bench

pytestmark = pytest.mark.quick


@pytest.fixture
def thesis_results(tmp_path: Path) -> Path:
    """Return a folder with one result, of the genetic learning."""
    curves = {"precision": [0.5, 0.7], "recall": [0.6, 0.8], "fitness": [0.55, 0.75]}
    figures = {
        "one_run": {"median_cpu_seconds": 0.25},
        "clips as they are": {"curves": {"generations": [0, 5], "verification": curves}},
    }
    (tmp_path / "keyframe_learning.json").write_text(json.dumps({"figures": figures}), encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("paper", sorted(_papers.papers()))
def test_each_group_names_a_result_that_all_benchmarks_write(paper: str) -> None:
    groups = _papers.papers()[paper]
    named = {group["result"] for group in groups if "here" in group}
    assert named and named <= set(COMMANDS) and set(_papers.results_of(paper)) == named
    assert all(group["source"] and group["values"] for group in groups)


@pytest.mark.parametrize("paper", sorted(_papers.papers()))
def test_each_group_with_a_place_has_numbers_in_the_last_results(paper: str) -> None:
    found = [(one.source, one.figure) for one in _papers.compared(paper) if one.here is not None]
    for group in _papers.papers()[paper]:
        assert ("here" in group) == any(s == group["source"] and f.startswith(group["says"]) for s, f in found)


def test_numbers_are_scaled_to_the_unit_of_the_paper() -> None:
    won = [one for one in _papers.compared("baak2013") if one.source == "5.5.2"]
    assert sum(one.paper or 0.0 for one in won) == pytest.approx(100.0)
    assert sum(one.here or 0.0 for one in won) == pytest.approx(100.0)


def test_a_result_that_is_absent_is_not_measured(thesis_results: Path) -> None:
    cells = {one.source: one.cells() for one in _papers.compared("thesis", thesis_results)}
    assert cells["Chapter 4"] == ("10", "0.2")
    assert cells["Fig. 4.3"] == ("drawn", "0.75")
    assert cells["3.6.2"] == ("12.5", "not measured")


def test_curves_are_drawn_and_absent_pictures_left_out(thesis_results: Path) -> None:
    (picture,) = _papers.plots("thesis", thesis_results)
    assert picture[0] == "Fig. 4.3" and picture[1].read_bytes().startswith(b"\x89PNG")


def test_the_list_names_the_results_of_one_paper(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("reproduce", "lopez2011", "--list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"\d results: .* min together, .*", lines[-1])
    assert all(line.startswith("upper_") for line in lines[:-1])


def test_stored_results_are_compared_without_measuring(
    monkeypatch: pytest.MonkeyPatch, thesis_results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_papers, "RESULTS", thesis_results)
    assert run("reproduce", "thesis", "--stored") == 0
    out = capsys.readouterr().out
    assert re.search(r"Fig\. 4\.3: .*\n.* paper +here\n.*\n  recall +drawn +0\.80\n", out)
    assert out.splitlines()[-1] == f"Fig. 4.3: {thesis_results / 'keyframe_learning.png'}"


def test_an_unknown_paper_is_wrong_use(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("reproduce", "ganapathi2010") == 2
    assert "baak2013" in capsys.readouterr().err


def test_without_a_checkout_there_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "FOLDER", tmp_path)
    assert run("reproduce", "thesis") == 2
    assert capsys.readouterr().err.strip().endswith(bench.NO_CHECKOUT)
