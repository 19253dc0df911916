"""What names a release agrees in every file that names it."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]


def test_version_changelog_citation_and_licence_agree() -> None:
    project = (ROOT / "pyproject.toml").read_text()
    version = re.search(r'^version = "(.+)"$', project, re.M)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert version and citation["version"] == version[1]
    assert f"\n## {version[1]}" in (ROOT / "CHANGELOG.md").read_text()
    assert (ROOT / "LICENSE").read_text().startswith(f"{citation['license']} License")


def test_ci_uses_the_wheel_as_somebody_without_a_checkout_does() -> None:
    assert "make wheel" in (ROOT / ".ci" / "run").read_text()
    assert "scripts/check_wheel.sh" in (ROOT / "Makefile").read_text()
