"""Tests and benchmarks use public names of the product; names are unique."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PRODUCT = ("toolkit", "database_builder")


def private_names(source: str) -> list[str]:
    """Return names with a leading underscore that a source imports from the product or reads from its modules."""
    nodes, modules, found = [*ast.walk(ast.parse(source))], set(), []
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PRODUCT:
            modules |= {alias.asname or alias.name for alias in node.names}
            found += [f"{node.module}.{alias.name}" for alias in node.names if alias.name.startswith("_")]
            found += [node.module or "" for part in (node.module or "").split(".") if part.startswith("_")]
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules:
            found += [f"{node.value.id}.{node.attr}"] if node.attr.startswith("_") and node.attr[1] != "_" else []
    return found


@pytest.mark.quick
def test_no_test_and_no_benchmark_names_a_private_of_the_product() -> None:
    files = sorted((*(ROOT / "tests").glob("*.py"), *(ROOT / "benchmarks").glob("*.py")))
    assert len(files) > 100
    assert {f"{path.name}: {name}" for path in files for name in private_names(path.read_text())} == set()


def public_classes(folder: Path) -> dict[str, list[str]]:
    """Return each public class with the files that define it; array rows of kernels are left out."""
    found: dict[str, list[str]] = {}
    for path in sorted(folder.rglob("*.py")):
        if not {"kernels", "testing"} & set(path.parts):
            for node in ast.parse(path.read_text()).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found.setdefault(node.name, []).append(str(path))
    return found


@pytest.mark.quick
def test_a_class_s_name_means_one_thing_in_the_whole_product() -> None:
    classes = public_classes(ROOT / "toolkit")
    for name, files in public_classes(ROOT / "database_builder").items():
        classes.setdefault(name, []).extend(files)
    assert len(classes) > 300
    assert {name: files for name, files in classes.items() if len(files) > 1} == {}


def assigned_twice(source: str) -> list[str]:
    """Return constants of a module that are assigned twice."""
    names = [
        target.id
        for node in ast.parse(source).body
        if isinstance(node, (ast.Assign, ast.AnnAssign))
        for part in (node.targets if isinstance(node, ast.Assign) else [node.target])
        for target in ast.walk(part)
        if isinstance(target, ast.Name) and target.id.isupper()
    ]
    return sorted({name for name in names if names.count(name) > 1})


@pytest.mark.quick
def test_a_constant_has_one_value_in_its_module() -> None:
    files = [path for room in (*PRODUCT, "benchmarks", "scripts") for path in sorted((ROOT / room).rglob("*.py"))]
    assert len(files) > 300
    found = {str(path): assigned_twice(path.read_text(encoding="utf-8")) for path in files}
    assert {path: names for path, names in found.items() if names} == {}
