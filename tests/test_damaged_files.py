"""A damaged file of any format is refused in one sentence or read; a checksum excludes other content."""

import zlib
from pathlib import Path

import numpy as np
import pytest

from tests.file_formats import FORMATS, digest
from toolkit.io.errors import DepthMocapError

CHANGES = 4
"""Number of changes of each kind per format."""
INSERTED = (b"\x00", b"-1", b"nan", b"1e308", b"9" * 400, b"[" * 2000, b"null", b"\n")


def damaged(content: bytes, kind: str, rng: np.random.Generator) -> bytes:
    """Return the content with one change: a flipped bit, a removed stretch, an inserted piece, or a cut."""
    at = int(rng.integers(len(content)))
    if kind == "bit":
        return content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :]
    if kind == "gap":
        return content[:at] + content[at + int(rng.geometric(0.1)) :]
    if kind == "piece":
        return content[:at] + INSERTED[int(rng.integers(len(INSERTED)))] + content[at:]
    return content[:at]


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_damaged_file_is_refused_in_one_sentence_or_read(name: str, tmp_path: Path) -> None:
    kind = FORMATS[name]
    path = kind.make(tmp_path)
    content, whole = path.read_bytes(), digest(kind.read(path))
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    for change in ("bit", "gap", "piece", "cut"):
        for _ in range(CHANGES):
            path.write_bytes(damaged(content, change, rng))
            try:
                found = digest(kind.read(path))
            except DepthMocapError as error:
                assert "\n" not in str(error)
            else:
                assert found == whole or not kind.checked, change
