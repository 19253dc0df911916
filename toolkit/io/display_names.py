"""Safe display of names of recordings, people, labels and files."""

from __future__ import annotations

import re
from typing import Literal

Place = Literal["text", "plot", "table"]
LONGEST_NAME = 120
"""Largest number of displayed characters of a name."""
_FORMULA_START = re.compile(r"(^|[;\t]\s*)(?=[=+\-@'\uff1d\uff0b\uff0d\uff20])")
"""Starts of spreadsheet formulas, also in full-width characters and after a semicolon (the cell separator of many
countries), and the mark for text."""


def shown(name: object, on: Place = "text") -> str:
    """Return a name in displayable form.

    Line breaks, terminal escapes, direction marks and bytes that are no text become visible as `\\x1b`. A name longer
    than `LONGEST_NAME` is shortened in the middle, except in a table.

    Parameters
    ----------
    name : name to display
    on : "text" is a terminal, a film or an escaped page; "plot" interprets dollars as mathematics; "table" is a CSV
        cell, which must not become a formula
    """
    text = printable(str(name))
    if len(text) > LONGEST_NAME and on != "table":
        half = (LONGEST_NAME - 3) // 2
        text = f"{text[:half]}...{text[-half:]}"
    if on == "plot":
        return text.replace("$", "\\$")
    return re.sub(_FORMULA_START, r"\1'", text) if on == "table" else text


def printable(text: str) -> str:
    """Return the text with non-printable characters escaped as in a Python string."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode("ascii") for c in text)
