"""Single-file HTML pages with text, tables and matplotlib pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """body{font:15px/1.5 sans-serif;max-width:72em;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{padding:.25em .8em;border-bottom:1px solid #ccc;text-align:left}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}img{max-width:100%}
.ok{color:#060}.no{color:#a00}
@media(max-width:600px){table{display:block;overflow-x:auto}}"""


def page(name: str, parts: Iterable[str], *, about: str = "") -> str:
    """Return a page with a title, a heading (the name and what the page is `about`) and HTML parts."""
    title = escape(name)
    head = (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{title}</title><style>{_STYLE}</style>"
    )
    return "\n".join([head, f"</head><body><h1>{title}{about}</h1>", *parts]) + "</body></html>\n"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of HTML cells; columns of numbers are aligned right."""
    numbers = [bool(rows) and all(row[k].replace(".", "").isdigit() for row in rows) for k in range(len(head))]

    def line(tag: str, cells: Sequence[str]) -> str:
        classes = (" class=n" if number else "" for number in numbers)
        return "".join(f"<{tag}{name}>{cell}</{tag}>" for cell, name in zip(cells, classes, strict=True))

    lines = (line("th", head), *(line("td", row) for row in rows))
    return "<table><tr>" + "</tr>\n<tr>".join(lines) + "</tr></table>"


def png_of(figure: Figure, dpi: int = 110) -> bytes:
    """Return a figure as a PNG file."""
    stream = io.BytesIO()
    figure.savefig(stream, dpi=dpi, format="png")
    return stream.getvalue()


def picture(png: bytes, words: str) -> str:
    """Return an image element with an embedded PNG file and its description."""
    return f"<img alt='{escape(words)}' src='data:image/png;base64,{base64.b64encode(png).decode('ascii')}'>"
