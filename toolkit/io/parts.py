"""Work in parts, so that a live tracker can spread a long step over several frames."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

Result = TypeVar("Result")
Parts = Generator[None, None, Result]
"""A computation that stops between its parts, of 10 to 30 ms each; its return value is the result."""


def whole(parts: Parts[Result]) -> Result:
    """Run all parts and return the result."""
    while True:
        try:
            next(parts)
        except StopIteration as ended:
            result: Result = ended.value
            return result
