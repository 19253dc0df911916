"""Fields of settings classes that stand in no settings file: constants of the code, with their reasons beside them."""

from __future__ import annotations

from dataclasses import Field, field
from typing import Any

_MARK = "constant"


def constant(value: Any) -> Any:
    """A field of a settings dataclass that is none of its users' settings.

    It can be changed by its dotted name for an experiment, as the papers' variants do in `configs/`; what was changed
    is written beside the results like any setting.
    """
    return field(default=value, metadata={_MARK: True})


def is_constant(item: Field[Any]) -> bool:
    """Whether a field was made by `constant`."""
    return _MARK in item.metadata
