"""Pictures by Open3D: silhouettes as those of the toolkit, shadows on the ground, the option of the command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.run_helpers import run, write_run
from tests.sensing_scenes import KINECT, neutral, standing
from toolkit.io.errors import SettingsError
from toolkit.io.files import sha256_of
from toolkit.output.rendering.mesh import draw_mesh
from toolkit.output.rendering.open3d_pictures import ColoredMesh, PicturePainter, PictureView
from toolkit.output.rendering.painter import RenderSettings
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import DEFAULT_UP, level_rotation
from toolkit.simulation.raycast import render_depth
from toolkit.tracks import RunInfo

ROTATION = level_rotation(np.array(DEFAULT_UP))
HEIGHT = 1.2


def person() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices, level frame, and faces of a person before the camera."""
    body = neutral()[0]
    return body.vertex_positions(standing(0.2, 2.6, HEIGHT)), body.faces


def painted(ground: float) -> np.ndarray:
    vertices, faces = person()
    view = PictureView(KINECT, np.zeros(3), ROTATION)
    return PicturePainter(view, ground).paint([ColoredMesh(vertices, faces, np.full(vertices.shape, 90.0))])


def test_silhouettes_are_those_of_the_present_renderer() -> None:
    vertices, faces = person()
    image = np.zeros((*KINECT.shape, 3), dtype=np.uint8)
    ours = np.isfinite(draw_mesh(image, vertices @ ROTATION, faces, np.full(vertices.shape, 90.0), KINECT))
    seen = painted(np.nan).min(axis=2) < 172  # half way from the body, 90, to the paper
    assert np.count_nonzero(seen & ours) > 0.98 * np.count_nonzero(seen | ours)


def test_a_body_throws_a_soft_shadow_on_the_ground_and_on_nothing_else() -> None:
    vertices, _ = person()
    shaded = (painted(float(vertices[:, 1].min())) != painted(np.nan)).any(axis=2)
    rows, _ = np.nonzero(shaded)
    feet = KINECT.project(vertices @ ROTATION)[:, 1].max()
    assert shaded.sum() > 300 and rows.min() > 0.5 * feet
    assert len(np.unique(painted(float(vertices[:, 1].min()))[shaded])) > 20, "the border of the shadow is soft"


def test_the_command_draws_with_either_engine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = np.stack([standing(x, 2.6, HEIGHT) for x in (0.0, 0.1)])
    depth = [np.rint(1000 * render_depth(neutral()[0], pose, KINECT, ROTATION)).astype(np.uint16) for pose in poses]
    save_recording(tmp_path / "take.npz", depth=depth, camera=KINECT, timestamps=[0.0, 0.1], up_camera=DEFAULT_UP)
    folder = write_run(tmp_path / "run", poses, recording=str(tmp_path / "take.npz"))
    info = RunInfo.load(folder)
    replace(info, recording_sha256=sha256_of(tmp_path / "take.npz")).save(folder)
    for engine, light in (("toolkit", False), ("open3d", True)):
        assert run("render", folder, "--engine", engine, "--panels", "body", "--output", tmp_path / engine) == 0
        picture = cv2.imread(str(tmp_path / engine / "00001.png"))
        assert (np.median(picture) > 200) == light
    assert run("render", folder, "--engine", "other", "--output", tmp_path / "x.png") == 2
    assert "toolkit or open3d" in capsys.readouterr().err
    with pytest.raises(SettingsError):
        RenderSettings(engine="other")
