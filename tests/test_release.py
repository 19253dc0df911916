"""Names and numbers of a release agree in each file that contains them."""

import re
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT = (ROOT / "pyproject.toml").read_text()


def test_version_date_and_licence_agree() -> None:
    version = re.search(r'^version = "(.+)"$', PROJECT, re.M)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert version and citation["version"] == version[1]
    newest = re.search(r"^## \[(\d.+)\] - (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert newest and newest.groups() == (version[1], citation["date-released"].isoformat())
    assert f'license = "{citation["license"]}"' in PROJECT
    assert (ROOT / "LICENSE").read_text().startswith(f"{citation['license']} License")


def test_the_citation_file_has_what_its_format_requires() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0" and citation["message"] and citation["title"]
    for entry in (citation, *citation["references"]):
        assert entry["authors"] and all("name" in a or "family-names" in a for a in entry["authors"])
    assert all(entry["type"] and entry["title"] and entry["year"] for entry in citation["references"])


def test_the_changelog_has_the_headings_of_its_format() -> None:
    text = (ROOT / "CHANGELOG.md").read_text()
    versions = re.findall(r"^## (.+)$", text, re.M)
    assert versions[0] == "[Unreleased]"
    assert all(re.fullmatch(r"\[\d+\.\d+\.\d+\] - (\d{4}-\d\d-\d\d|not released)", name) for name in versions[1:])
    kinds = {"Added", "Changed", "Deprecated", "Fixed", "Removed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.M)) <= kinds
    for part in re.split(r"^## ", text, flags=re.M)[1:]:
        there = re.findall(r"^### (.+)$", part, re.M)
        assert len(there) == len(set(there)), f"a heading twice in {part.splitlines()[0]}"


def test_the_range_of_pythons_stands_in_one_place() -> None:
    found = re.search(r'^requires-python = ">=3\.(\d+),<3\.(\d+)"$', PROJECT, re.M)
    assert found
    named = {int(minor) for minor in re.findall(r"Python :: 3\.(\d+)", PROJECT)}
    assert named == set(range(int(found[1]), int(found[2])))
    script = (ROOT / "scripts" / "make_environment.sh").read_text()
    assert "requires-python" in script and not re.search(r"3, 1\d|Python 3\.1\d", script)


@pytest.mark.parametrize("inside", [True, False])
def test_an_interpreter_outside_the_range_is_refused_with_the_range(tmp_path: Path, inside: bool) -> None:
    found = re.search(r'">=3\.(\d+),<3\.(\d+)"', PROJECT)
    assert found
    first, last = int(found[1]), int(found[2]) - 1
    python = tmp_path / "python"
    # an interpreter of some version; after the check the script fails at a missing module
    version = f"(3, {last if inside else last + 1})"
    check = "${2/sys.version_info\\[:2\\]/" + version + "}"
    python.write_text(f'#!/bin/bash\n[ "$1" = -c ] || exit 1\nexec python3 -c "{check}"\n')
    python.chmod(0o755)
    (tmp_path / "scripts").mkdir()
    script = tmp_path / "scripts" / "make_environment.sh"
    script.write_text((ROOT / "scripts" / "make_environment.sh").read_text())
    script.chmod(0o755)
    (tmp_path / "pyproject.toml").write_text(PROJECT)
    done = subprocess.run(
        [script, "environment"], env={"PATH": "/usr/bin:/bin", "PYTHON": str(python)}, capture_output=True, text=True
    )
    assert done.returncode != 0
    assert (f"is not a Python 3.{first} to 3.{last}" in done.stderr) is not inside


@pytest.mark.parametrize("path", re.findall(r'^    "(.*LICENSE.*)",$', PROJECT, re.M))
def test_every_licence_file_exists(path: str) -> None:
    if not path.startswith("/"):
        assert (ROOT / path).read_text().strip()
