"""The list of mutants stays true: each breaks what stands there, and names tests that exist."""

from __future__ import annotations

import ast
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def mutants() -> list:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(ROOT / "scripts"), *sys.path])
        from mutants import load_mutants
    return load_mutants()


@cache
def parsed(source: str) -> str:
    """The source as Python understands it, which compiles it: a keyword that is given twice is none before."""
    compile(source, "mutant", "exec")
    return ast.dump(ast.parse(source))


def test_every_mutant_changes_what_stands_in_its_file_once_into_python(mutants: list) -> None:
    for mutant in mutants:
        source = (ROOT / mutant.file).read_text(encoding="utf-8")
        assert parsed(mutant.applied(source)) != parsed(source), mutant.name


def test_there_are_at_least_sixty_of_different_names_with_tests_that_exist(mutants: list) -> None:
    assert len(mutants) >= 60
    assert len({mutant.name for mutant in mutants}) == len(mutants)
    for mutant in mutants:
        for test in mutant.tests:
            path, _, name = test.partition("::")
            assert name in (ROOT / path).read_text(encoding="utf-8"), f"{mutant.name}: {test}"


def test_a_text_that_is_gone_is_named(mutants: list) -> None:
    with pytest.raises(ValueError, match="stands 0 times"):
        mutants[0].applied("nothing of the kind")
