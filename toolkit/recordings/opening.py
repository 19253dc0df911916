"""Opening a recording of any known format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from toolkit.errors import RecordingError
from toolkit.files import is_file, is_folder, link_out_of
from toolkit.recordings.readers import reader_for
from toolkit.sensing.recording import ReaderOptions, Recording


def open_recording(path: str | Path, **options: Any) -> Recording:
    """Open a depth recording of any known format; options are those of `ReaderOptions`.

    Raises
    ------
    RecordingError
        The path is missing, of no known format, or its contents cannot be used.
    UsageError
        An option is unknown.
    """
    target = Path(path)
    if not (is_file(target) or is_folder(target)):
        raise RecordingError(f"there is no recording at {target}, a file or a folder; check the path")
    chosen = ReaderOptions.from_mapping(options)
    read = reader_for(target, chosen.format)
    if target.is_dir() and (link := link_out_of(target)) is not None:
        raise RecordingError(f"{link} is a link that leads out of the recording; put the file itself there")
    return read(target, chosen)
