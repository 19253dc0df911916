"""Names of recordings, people, labels and files on their way to where they are shown: nothing in them acts there."""

from __future__ import annotations

import re
from typing import Literal

Place = Literal["text", "plot", "table"]
LONGEST_NAME = 120
"""Characters of a name that are shown."""
_FORMULA_START = re.compile(r"(^|[;\t]\s*)(?=[=+\-@'\uff1d\uff0b\uff0d\uff20])")
"""Where a cell may begin that spreadsheets calculate, also in full-width characters and behind a semicolon, which
separates cells in many countries; or the mark that says that a cell is text."""


def shown(name: object, on: Place = "text") -> str:
    """A name as it can be shown.

    Line breaks, terminal escapes, marks that turn the direction of writing and bytes that are no text become visible as
    `\\x1b`, and a name longer than `LONGEST_NAME` loses its middle, but in a table.

    Parameters
    ----------
    on : "text" is a terminal, a film or a page that escapes its own; "plot" reads mathematics between dollars,
        "table" is a cell of CSV, which must not become a formula
    """
    text = printable(str(name))
    if len(text) > LONGEST_NAME and on != "table":
        half = (LONGEST_NAME - 3) // 2
        text = f"{text[:half]}...{text[-half:]}"
    if on == "plot":
        return text.replace("$", "\\$")
    return re.sub(_FORMULA_START, r"\1'", text) if on == "table" else text


def printable(text: str) -> str:
    """A text of any length in which what is not printed is written as Python writes it in a string."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode("ascii") for c in text)
