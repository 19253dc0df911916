"""An error names the flag that can be typed, never the setting behind it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1] / "toolkit"
OPTIONS = "intrinsics|size|track|skeleton|segment|subject|depth_unit|frame_rate|rotate|axes|up_camera|background|format"
AS_A_SETTING = re.compile(rf"\b(?:the option (?:{OPTIONS})\b|set (?:{OPTIONS}) to|(?<!-)(?:{OPTIONS})=)")


def test_no_error_of_a_recording_speaks_of_settings() -> None:
    spoken = []
    for path in sorted(p for room in ("sensing", "recordings", "people") for p in (ROOT / room).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        documented = {
            id(node.body[0].value)
            for node in ast.walk(tree)
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            if node.body and isinstance(node.body[0], ast.Expr)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
                if AS_A_SETTING.search(node.value):
                    spoken.append(f"{path.name}:{node.lineno}: {node.value}")
    assert not spoken
