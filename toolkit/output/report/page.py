"""Report of runs as a single HTML file without server, network or installation."""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

from toolkit.evaluation.evaluate import find_runs
from toolkit.io.errors import UsageError
from toolkit.io.files import check_output, save_text
from toolkit.io.progress import Progress, silent
from toolkit.output.report.content import RunContent, describe_run

ASSETS = Path(__file__).parent / "assets"


def write_report(
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    recording: str | Path | None = None,
    references: Sequence[str | Path] = (),
    frames: range | None = None,
    progress: Progress = silent,
) -> Path:
    """Write one self-contained page about runs: film, scene, errors, confidence, times, settings.

    The page works offline: it contains all its data, and its content security policy forbids requests.

    Parameters
    ----------
    runs : run folders, of one person or several, or folders that hold some
    output : the file, `.html`
    recording : new place of the recording, for a single run
    references : references of the errors, see `evaluate_runs`; default: the recording of each run
    frames : range of frames; default: the first 3,000
    progress : called as the page is made

    Raises
    ------
    UsageError
        The output is no `.html` file or one of the inputs, there is no run, or one recording is named for several.
    TrackError
        A folder contains no finished track.
    OutputError
        The page cannot be written.
    """
    if Path(output).suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"cannot write the report to {output}; name it *.html")
    folders = find_runs(runs)
    if not folders or (recording is not None and len(folders) > 1):
        raise UsageError(f"{len(folders)} runs do not fit; give at least one, and --recording only with one")
    check_output(output, [*folders, *references, *([] if recording is None else [recording])])
    contents = []
    for i, folder in enumerate(folders):
        progress("describing the runs", i, len(folders))
        contents.append(
            describe_run(
                folder, f"run{i}", recording=recording, references=references, frames=frames, progress=progress
            )
        )
    progress("describing the runs", len(folders), len(folders))
    save_text(output, page(contents))
    return Path(output)


def page(contents: Sequence[RunContent]) -> str:
    """Return the text of a page about runs; names are escaped."""
    names = ", ".join(content.data["name"] for content in contents)
    blocks = [
        f'<script type="text/plain" id="{html.escape(key)}">{base64.b64encode(data).decode()}</script>'
        for key, data in _blocks(contents).items()
    ]
    values = {
        "title": html.escape(f"depthmocap: {names}"),
        "blocks": "\n".join(blocks),
        "movement": "\n".join(content.movement for content in contents),
        "licence": html.escape((ASSETS / "LICENSE.three.txt").read_text(encoding="utf-8")),
    }
    template = (ASSETS / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda match: values[match[1]], template)


def _blocks(contents: Sequence[RunContent]) -> dict[str, bytes]:
    """Return the compressed parts of a page: viewer, data, and blocks."""
    data = json.dumps({"runs": [content.data for content in contents]}, separators=(",", ":"), allow_nan=False)
    named = {key: block for content in contents for key, block in content.blocks.items()}
    plain = {"viewer": (ASSETS / "viewer.js").read_bytes(), "data": data.encode(), **named}
    return {key: zlib.compress(block, 9) for key, block in plain.items()}
