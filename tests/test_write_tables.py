"""The pages say what the benchmarks measured, and every benchmark that is listed can be run."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from benchmarks import _record
from benchmarks import all as everything
from scripts import write_tables
from toolkit.app.cli.bench import benchmarks
from toolkit.output.report.gait import EXPECTED


@pytest.mark.quick
def test_pages_and_results_agree() -> None:
    tables = set()
    for path in write_tables.pages():
        text = path.read_text(encoding="utf-8")
        assert write_tables.written(text) == text, f"{path.name} is stale: python scripts/write_tables.py"
        tables |= {name for _, name, _ in write_tables.MARKED.findall(text)}
    assert tables == set(write_tables.TABLES)


@pytest.mark.quick
def test_the_typical_errors_of_a_report_are_those_that_were_measured() -> None:
    found = write_tables.figures("gait")
    measured = found["mean_absolute_errors"]["tracked"] | found["ranges"]
    assert {name: float(f"{measured[name]:.3g}") for name in EXPECTED} == EXPECTED


@pytest.mark.quick
def test_every_result_is_of_a_commit_of_this_history() -> None:
    told = ["git", "-C", str(write_tables.ROOT), "rev-parse", "--is-shallow-repository"]
    if subprocess.run(told, capture_output=True, text=True, check=False).stdout.strip() != "false":
        pytest.skip("the history is not here")
    assert write_tables.strangers() == []


@pytest.mark.quick
def test_a_table_is_written_anew_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(write_tables.TABLES, "crowd", lambda: "| people | ms |\n| 1 |  |\n")
    page = "before\n<!-- table: crowd -->\nold\n<!-- end -->\nafter\n"
    found = write_tables.written(page)
    assert found == "before\n<!-- table: crowd -->\n| people | ms |\n|---|---|\n| 1 | |\n<!-- end -->\nafter\n"


@pytest.mark.quick
def test_what_has_a_result_of_this_commit_is_not_measured_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(everything, "RESULTS", tmp_path)
    monkeypatch.setattr(everything, "commit", lambda: "abc1234")
    for name, commit in (("here", "abc1234"), ("old", "0123456"), ("changed", "abc1234+")):
        (tmp_path / f"{name}.json").write_text(json.dumps({"commit": commit}))
    assert list(everything.left(dict.fromkeys(("here", "old", "changed", "missing"), ""))) == [
        "old",
        "changed",
        "missing",
    ]


@pytest.mark.quick
def test_the_list_tells_what_is_due_and_what_it_took_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(everything, "RESULTS", tmp_path)
    (tmp_path / "gait.json").write_text(json.dumps({"commit": "0123456", "processor_seconds": 90.0}))
    monkeypatch.setattr("sys.argv", ["all.py", "--list", "--only", "gait", "extrema"])
    everything.main()
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines[:2]] == [
        ["gait", "1.5", "min", "bench", "gait"],
        ["extrema", "bench", "lookup", "extrema"],
    ]
    assert lines[2] == "of 2 results 1 say their processor time: 1.5 min together, 0.0 hours on two processors"


def test_benchmarks_that_fail_are_said_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands = {"time": "speed --no-such-option", "size": "scale --help", "rest": "feet --no-such-option"}
    monkeypatch.setattr(everything, "COMMANDS", commands)
    monkeypatch.setattr(everything, "RESULTS", tmp_path)
    monkeypatch.setattr(everything, "WORK", tmp_path)
    monkeypatch.setattr("sys.argv", ["all", "--only", *commands, "--database", "poses.npz"])
    with pytest.raises(SystemExit, match="failed: time, rest"):
        everything.main()
    assert "size: done" in capsys.readouterr().out
    assert "usage" in (tmp_path / "logs" / "size.txt").read_text(encoding="utf-8")


@pytest.mark.quick
def test_every_benchmark_that_is_listed_or_named_on_a_page_is_there() -> None:
    named = {command.split()[0] for command in everything.COMMANDS.values()}
    for path in write_tables.pages():
        if path.name not in ("notebook.md", "CHANGELOG.md"):
            named |= set(re.findall(r"bench ([a-z]\w+)", path.read_text(encoding="utf-8")))
    assert named <= set(benchmarks())


@pytest.mark.quick
def test_every_result_of_all_benchmarks_is_shown_on_a_page() -> None:
    """A figure that no reader needs is dropped."""
    pages = [path for path in write_tables.pages() if path.name not in ("notebook.md", "CHANGELOG.md")]
    told = " ".join(path.read_text(encoding="utf-8") for path in pages)
    tables = (write_tables.ROOT / "scripts" / "tables.jinja").read_text(encoding="utf-8")
    for name, command in everything.COMMANDS.items():
        words = [word for word in command.split()[:2] if re.fullmatch(r"[a-z]\w+", word)]
        assert f'"{name}"' in tables or re.search(rf"bench {' '.join(words)}\b", told), name


@pytest.mark.quick
def test_a_figure_names_a_commit_that_stays() -> None:
    assert re.fullmatch(r"[0-9a-f]{7}\+?|unknown", _record.commit())


def test_pages_and_results_make_no_figure_old_and_code_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*words: str) -> str:
        who = ("-c", "user.name=n", "-c", "user.email=e")
        command = ["git", "-C", str(tmp_path), *who, *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    def committed(name: str, text: str) -> str:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
        git("add", "-A")
        git("commit", "-qm", name)
        return git("rev-parse", "HEAD")[:7]

    git("init", "-q", "-b", "main")
    monkeypatch.setattr(_record, "__file__", str(tmp_path / "benchmarks" / "_record.py"))
    code = committed("benchmarks/speed.py", "")
    assert _record.commit() == code
    assert committed("benchmarks/results/speed.json", "{}") != code == _record.commit()
    git("checkout", "-q", "-b", "mine")
    (tmp_path / "benchmarks" / "speed.py").write_text("changed")
    assert _record.commit() == f"{code}+"
    committed("toolkit/tracks.py", "")
    assert _record.commit() == f"{code}+"
