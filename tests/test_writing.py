"""The texts of the repository use no ruled-out word, and each docstring opens with a verb or a noun."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("toolkit", "database_builder", "depthmocap", "benchmarks", "scripts", "examples", "docs", "configs")
LEFT_OUT = ("notebook.md", "results", "assets", "node_modules")
"""Files and folders without text of the current version."""
RULED_OUT = re.compile(
    r"\b(whoever|whom|whence|anew|afresh|nobody|somebody|everybody|anybody|meanwhile|\w*manieth|hopelessly|beforehand"
    r"|of theirs|is told|that says)\b",
    re.IGNORECASE,
)
OPENINGS = re.compile(r"(What|Who|Whose|Whom|Whether|Where|How|That|As|Like)\b")


def texts() -> list[Path]:
    """Return the files of code and pages."""
    files = [
        path
        for folder in FOLDERS
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".md", ".yaml", ".sh", ".jinja")
    ]
    return [ROOT / "README.md", *sorted(path for path in files if not set(LEFT_OUT) & set(path.parts))]


def openings(source: str) -> list[str]:
    """Return the first lines of docstrings and of constants' docstrings that open with a ruled-out word."""
    strings = [
        node.value.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    return [text.strip().splitlines()[0] for text in strings if OPENINGS.match(text.strip())]


@pytest.mark.quick
def test_no_text_uses_a_ruled_out_word_or_opening() -> None:
    found = {}
    for path in texts():
        content = path.read_text(encoding="utf-8")
        wrong = RULED_OUT.findall(content) + (openings(content) if path.suffix == ".py" else [])
        if wrong:
            found[str(path.relative_to(ROOT))] = wrong
    assert found == {}


def test_a_ruled_out_word_and_an_opening_are_found() -> None:
    source = '"""What a person heads for."""\nX = 1\n"""Seconds until somebody is forgotten."""\n'
    assert openings(source) == ["What a person heads for."]
    assert RULED_OUT.findall(source) == ["somebody"]
