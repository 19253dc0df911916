"""fetch_pose_model.py [WHEEL]: get the pose model that `depthmocap track --joints colour|depth` uses.

The model is a file within the wheel of mediapipe 0.10.21 (Apache-2.0). The wheel is downloaded by pip, or read from
WHEEL; the model is taken out, checked and put into the user's data folder. The wheel itself is never installed.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from toolkit.detector.pose_model import MODEL_FILE, check_model, data_folder
from toolkit.errors import DepthMocapError, ModelError
from toolkit.files import atomic_path

WHEEL = "mediapipe==0.10.21"
MEMBER = f"mediapipe/modules/pose_landmark/{MODEL_FILE}"


def fetch(wheel: Path | None = None) -> Path:
    """Put the model where the toolkit looks for it; its path."""
    with tempfile.TemporaryDirectory() as folder:
        wheel = wheel or _download(Path(folder))
        try:
            with zipfile.ZipFile(wheel) as archive:
                content = archive.read(MEMBER)
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise ModelError(f"{wheel} holds no {MEMBER} ({error}); it has to be the wheel of {WHEEL}") from error
    target = data_folder() / MODEL_FILE
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(target) as temporary:
        temporary.write_bytes(check_model(content, wheel))
    return target


def _download(folder: Path) -> Path:
    options = ("--no-deps", "--only-binary=:all:", "--dest", str(folder))
    if subprocess.run([sys.executable, "-m", "pip", "download", *options, WHEEL], check=False).returncode != 0:
        raise ModelError(f"pip could not download {WHEEL}; get its wheel elsewhere and name it: {sys.argv[0]} WHEEL")
    return next(folder.glob("*.whl"))


if __name__ == "__main__":
    try:
        print(fetch(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
    except DepthMocapError as error:
        sys.exit(f"fetch_pose_model: {error}")
