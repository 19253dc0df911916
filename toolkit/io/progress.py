"""Callback types for the progress of long operations."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Callback with the name of the operation, the number of steps done and their total."""
Count = Callable[[int, int], None]
"""Callback with the number of steps done and their total."""
RecordingProgress = Callable[[str, str, int, int], None]
"""Callback with a recording's name, the operation ("learning", "tracking", "second pass"), frames done and all."""


def silent(*amounts: object) -> None:
    """Ignore any progress."""
