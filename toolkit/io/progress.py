"""How long work tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called with what is being done, or to what, how much of it is done, and how much there is."""
Count = Callable[[int, int], None]
"""Called with how much is done, and how much there is."""
RecordingProgress = Callable[[str, str, int, int], None]
"""Called with a recording's name, what is done to it ("compiling", "learning", "tracking"), frames done, all frames."""


def silent(*told: object) -> None:
    """Progress of any kind that is not shown."""
