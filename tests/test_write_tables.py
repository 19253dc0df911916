"""The tables of the pages agree with the results; each listed benchmark exists and is on a page."""

import re
import subprocess
from pathlib import Path

import pytest

from benchmarks import all as everything
from benchmarks._data import check_data, commands, needed
from scripts import write_tables
from toolkit.app.cli.bench import benchmarks
from toolkit.datasets.registry import DATA_SETS
from toolkit.io.errors import DataError
from toolkit.output.report.gait import EXPECTED

pytestmark = pytest.mark.quick


def current_pages() -> str:
    """Return the text of all pages but the notebook."""
    return " ".join(p.read_text(encoding="utf-8") for p in write_tables.pages() if p.name != "notebook.md")


def test_pages_and_results_agree() -> None:
    tables = set()
    for path in write_tables.pages():
        text = path.read_text(encoding="utf-8")
        assert write_tables.written(text) == text, f"{path.name} is stale: python scripts/write_tables.py"
        tables |= {name for _, name, _ in write_tables.MARKED.findall(text)}
    assert tables == set(write_tables.TABLES)


def test_the_typical_errors_of_a_report_are_those_that_were_measured() -> None:
    found = write_tables.figures("gait")
    measured = found["mean_absolute_errors"]["tracked"] | found["ranges"]
    assert {name: float(f"{measured[name]:.3g}") for name in EXPECTED} == EXPECTED


def test_every_result_is_of_a_commit_of_this_history() -> None:
    command = ["git", "-C", str(write_tables.ROOT), "rev-parse", "--is-shallow-repository"]
    if subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() != "false":
        pytest.skip("needs the full git history")
    assert write_tables.strangers() == []


def test_every_benchmark_that_is_listed_or_named_on_a_page_exists() -> None:
    named = {command.split()[0] for command in everything.COMMANDS.values()}
    named |= set(re.findall(r"bench ([a-z]\w+)", current_pages()))
    assert named <= set(benchmarks())


def test_every_result_of_all_benchmarks_is_shown_on_a_page() -> None:
    tables = (write_tables.ROOT / "scripts" / "tables.jinja").read_text(encoding="utf-8")
    for name, command in everything.COMMANDS.items():
        words = [word for word in command.split()[:2] if re.fullmatch(r"[a-z]\w+", word)]
        assert f'"{name}"' in tables or re.search(rf"bench {' '.join(words)}\b", current_pages()), name


def test_every_benchmark_names_data_sets_of_the_registry() -> None:
    needs = commands()["data"]
    assert {key.split()[0] for key in needs} <= set(benchmarks())
    assert {name for names in needs.values() for name in names} <= set(DATA_SETS)
    assert needed(["upper", "track", "--real", "--rows", "x"]) == ("skeltrack", "realsense")
    assert needed(["real", "offsets"]) == ("utd-mhad", "msr-action3d") and needed(["real", "tracked"]) == ("utd-mhad",)


def test_a_benchmark_without_its_data_names_the_command_that_fetches_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(tmp_path))
    with pytest.raises(DataError, match="depthmocap data fetch utd-mhad$"):
        check_data(["real", "tracked"])
    check_data(["real", "--help"])
    check_data(["speed", "hybrid"])
