"""Film encoders for browsers: H.264 and VP9 by the optional package av, VP8 and MJPG by OpenCV."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import OutputError, UsageError

FILM_SUFFIXES = (".mp4", ".webm", ".avi")
"""Suffixes of films: H.264 or VP9 in the first two, motion JPEG in the last, for editors (browsers do not play it)."""
CODECS = {
    ".mp4": ("libx264", {"preset": "veryfast", "crf": "23"}),
    ".webm": (
        "libvpx-vp9",
        {"deadline": "realtime", "cpu-used": "5", "tune-content": "screen", "crf": "42", "b": "0"},
    ),
}
"""Encoder and options: constant quality, fast, for drawn pictures."""
INDEX_FIRST = {"movflags": "+faststart"}
"""Container options: a film plays while it is loading."""


def open_encoder(path: Path, suffix: str, rate: float, width: int, height: int) -> AvEncoder | OpenCvEncoder:
    """Return the encoder for a film of this suffix, one of `FILM_SUFFIXES`.

    Raises
    ------
    UsageError
        The suffix needs a package that is not installed.
    OutputError
        OpenCV has no codec for it.
    """
    if suffix == ".avi":
        return OpenCvEncoder(path, "MJPG", rate, width, height)
    if has_av():
        return AvEncoder(path, suffix, rate, width, height)
    if suffix == ".webm":
        return OpenCvEncoder(path, "VP80", rate, width, height)
    raise UsageError(
        f"a {suffix} film (H.264) needs the package av; type `pip install 'depthmocap[film]'`, "
        "or name the output *.webm, *.png for a contact sheet, or a folder for one picture per frame"
    )


def has_av() -> bool:
    """Return whether the optional package av is installed."""
    return importlib.util.find_spec("av") is not None


class AvEncoder:
    """H.264 and VP9 encoder of the package av."""

    def __init__(self, path: Path, suffix: str, rate: float, width: int, height: int) -> None:
        import av

        codec, options = CODECS[suffix]
        self._to_frame: Callable[..., Any] = av.VideoFrame.from_ndarray
        file: Any = av.open(str(path), "w", options=INDEX_FIRST if suffix == ".mp4" else {})
        self._file = file
        rate_denominator = 1001  # maximum denominator of a frame rate (30000/1001 for television)
        exact = Fraction(rate).limit_denominator(rate_denominator)
        stream: Any = file.add_stream(codec, rate=exact, options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        jump = 2.0  # seconds between key pictures; half as many make a film a tenth smaller
        stream.codec_context.gop_size = max(1, round(jump * rate))
        self._stream: Any = stream

    def write(self, picture: np.ndarray) -> None:
        """Append an RGB picture, uint8 (H, W, 3), H and W even."""
        frame = self._to_frame(np.ascontiguousarray(picture), format="rgb24")
        self._file.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Complete the file."""
        self._file.mux(self._stream.encode())
        self._file.close()


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress the output of libraries to the error stream inside the block."""
    kept = os.dup(2)
    try:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), 2)
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


class OpenCvEncoder:
    """VP8 and MJPG encoder of OpenCV."""

    def __init__(self, path: Path, codec: str, rate: float, width: int, height: int) -> None:
        import cv2

        self._path, self._written = path, 0
        with _silence():  # OpenCV warns for each WebM file that the container has no codec tag
            self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), rate, (width, height))
        if not self._writer.isOpened():
            raise OutputError(
                f"OpenCV cannot encode {codec} here; name the output *.png for a contact sheet, "
                "or a folder for one picture per frame"
            )

    def write(self, picture: np.ndarray) -> None:
        """Append an RGB picture, uint8 (H, W, 3), H and W even."""
        self._writer.write(np.ascontiguousarray(picture[:, :, ::-1]))
        self._written += 1

    def close(self) -> None:
        """Complete the file and count its readable pictures, because OpenCV does not report a full disk."""
        import cv2

        self._writer.release()
        film, count = cv2.VideoCapture(str(self._path)), 0
        while film.grab():
            count += 1
        film.release()
        if count != self._written:
            raise OutputError(
                f"only {count} of {self._written} pictures of the film were written; free some space on its disk"
            )
