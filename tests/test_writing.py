"""The texts of the repository use no ruled-out word, and each docstring opens with a verb or a noun."""

from __future__ import annotations

import ast
import re
from collections import Counter
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
CEILING: dict[str, tuple[int, int]] = {
    "benchmarks": (0, 1),
    "database_builder": (7, 16),
    "toolkit/kernels": (0, 2),
    "toolkit/landmarks": (2, 3),
}
"""Folder -> remaining ruled-out words and docstring openings; 0 in all others."""


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


def folder_of(path: Path) -> str:
    """Return the top-level folder of a file; for the product the package, for example toolkit/io."""
    parts = path.relative_to(ROOT).parts
    return "/".join(parts[: 2 if parts[0] == "toolkit" and len(parts) > 2 else 1])


@pytest.mark.quick
def test_no_text_uses_a_ruled_out_word_or_opening() -> None:
    words, opened = Counter[str](), Counter[str]()
    for path in texts():
        content = path.read_text(encoding="utf-8")
        words[folder_of(path)] += len(RULED_OUT.findall(content))
        opened[folder_of(path)] += len(openings(content)) if path.suffix == ".py" else 0
    found = {folder: (words[folder], opened[folder]) for folder in words}
    excess = {
        folder: counts
        for folder, counts in found.items()
        if any(count > most for count, most in zip(counts, CEILING.get(folder, (0, 0)), strict=True))
    }
    assert excess == {}, f"{excess}: words and docstring openings over the ceiling {CEILING}"


def test_a_ruled_out_word_and_an_opening_are_found() -> None:
    source = '"""What a person heads for."""\nX = 1\n"""Seconds until somebody is forgotten."""\n'
    assert openings(source) == ["What a person heads for."]
    assert RULED_OUT.findall(source) == ["somebody"]
