"""Convolutional networks in whole numbers, run by `cv2.dnn` with the same bits on every processor.

The export (`training.whole_numbers`) keeps every partial sum below 2**24, so that float32 arithmetic rounds nowhere, in
any order of summation. The Winograd algorithm transforms the weights into fractions and is switched off.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from threading import Lock

import numpy as np

from toolkit.io.errors import ModelError


def digest_path(path: Path) -> Path:
    """Return the path of the digest of a network's outputs, beside its file."""
    return path.with_suffix(".sha256")


def write_digest(path: Path, shape: tuple[int, ...], outputs: tuple[str, ...]) -> None:
    """Write the digest of the outputs of the network in `path`; arguments as of `ExactNetwork`."""
    network = ExactNetwork(path, shape, outputs, checked=False)
    digest_path(path).write_text(network.digest() + "\n", encoding="ascii")


class ExactNetwork:
    """A network in whole numbers.

    Parameters
    ----------
    path : ONNX file; beside it lies the digest of its outputs for a fixed input, see `write_digest`
    shape : shape of the input, (1, C, H, W)
    outputs : names of the outputs
    checked : compare the digest with that of the installed OpenCV

    Raises
    ------
    ModelError
        The installed OpenCV cannot read the file, or computes other values than the export.
    """

    def __init__(self, path: Path, shape: tuple[int, ...], outputs: tuple[str, ...], *, checked: bool = True) -> None:
        import cv2

        self._shape, self._outputs = shape, list(outputs)
        self._lock = Lock()  # trackers of one process may run in several threads
        hint = "install another version of opencv-python-headless (4.10 or later)"
        try:
            self._net = cv2.dnn.readNetFromONNX(str(path))
            self._net.enableWinograd(False)
            same = not checked or self.digest() == digest_path(path).read_text(encoding="ascii").strip()
        except (cv2.error, OSError, AttributeError) as error:
            raise ModelError(f"OpenCV {cv2.__version__} cannot run {path.name} ({error}); {hint}") from error
        if not same:
            raise ModelError(f"OpenCV {cv2.__version__} computes other values for {path.name} than its export; {hint}")

    def run(self, whole: np.ndarray) -> tuple[np.ndarray, ...]:
        """Run the network on whole numbers, float32 of its input shape; the outputs in the order of their names."""
        with self._lock:
            self._net.setInput(whole)
            return tuple(self._net.forward(self._outputs))

    def digest(self) -> str:
        """Return the SHA-256 of the outputs for a fixed input."""
        # Different values of the check input, -128 to 128, and the step between neighbours in that range.
        check_levels, check_stride = 257, 7919
        values = (np.arange(np.prod(self._shape)) * check_stride) % check_levels - check_levels // 2
        digest = hashlib.sha256()
        for output in self.run(values.reshape(self._shape).astype(np.float32)):
            digest.update((np.ascontiguousarray(output, dtype=np.float32) + np.float32(0.0)).tobytes())
        return digest.hexdigest()
