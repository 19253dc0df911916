"""Window of a run: open, play, close; timeline; the message where it cannot open.

Open3D ends its process where Vulkan fails, so that the window has a process of its own.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import run, write_people, write_run
from tests.sensing_scenes import standing
from toolkit.io.errors import UsageError
from toolkit.output.rendering import open3d_ready, open3d_window
from toolkit.output.rendering.open3d_window import Playback
from toolkit.tracks import Track

needs_vulkan = pytest.mark.skipif(
    open3d_ready.obstacle_to_drawing() is not None, reason=f"no Vulkan here: {open3d_ready.VULKAN_PACKAGES}"
)
needs_xvfb = pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="no xvfb-run here: apt-get install xvfb")

SWITCHES = """
import json, sys
from pathlib import Path
import cv2
from open3d.visualization import gui
from toolkit.output.rendering import open3d_window
from toolkit.tracks.runs import load_persons

application = gui.Application.instance
application.initialize()
people, folder = load_persons(sys.argv[1]), Path(sys.argv[2])
window = open3d_window.RunWindow(people, None, title="test", folder=folder)
def switch(box, on):
    box.checked = on
    window.draw()
told = {"labels": []}
steps = {
    "first": lambda: window._show(0),
    "slider": lambda: window._show(2),
    "names": lambda: switch(window._layers["joint names"], True),
    "one": lambda: switch(window._shown[0], False),
    "unwritable": lambda: None,
    "none": lambda: [switch(box, False) for box in window._shown],
}
todo = list(steps)
def next_step(path=None):
    if path is not None:
        picture = cv2.imread(str(path))
        told[path.stem] = int(picture.max(axis=2).astype(int).sum())
        told["labels"].append(len(window._labels))
    if not todo:
        told.update(note=window._note.text, frame=window.playback.frame)
        window.toggle()
        told["played"] = window.playback.playing
        window.window.close()
        return
    name = todo.pop(0)
    steps[name]()
    if name == "unwritable":
        (folder / "file").write_text("")
        window.screenshot(folder / "file" / "scene.png")  # its folder is a file
        name = "one_more"
    window.screenshot(folder / f"{name}.png", next_step)
next_step()
application.run()
told["closed"] = not window.playback.playing
print(json.dumps(told))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a run of a person who walks to the subject's left."""
    return write_run(tmp_path / "run", np.stack([standing(x, 2.8, 1.2) for x in (-0.1, 0.0, 0.1)]))


@needs_vulkan
@needs_xvfb
def test_a_window_opens_switches_slider_names_and_people_plays_and_closes(folder: Path, tmp_path: Path) -> None:
    people = write_people(tmp_path / "people", Track.load(folder).pose)
    place = Path(__file__).parents[1]
    done = subprocess.run(
        ["xvfb-run", "-a", "-s", "-screen 0 640x480x24", sys.executable, "-c", SWITCHES, people, tmp_path],
        capture_output=True, text=True, timeout=300, env=os.environ | {"PYTHONPATH": str(place)}, cwd=place,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    told = json.loads(done.stdout.strip().splitlines()[-1])
    assert told["frame"] == 2 and told["first"] != told["slider"]
    assert told["played"] and told["closed"]
    assert told["labels"] == [0, 0, 40, 20, 20, 0]
    assert "cannot write" in told["note"]
    assert told["slider"] > told["one"] > told["none"], "less is drawn with each person who is switched off"


def test_without_its_recording_a_run_is_shown_and_this_is_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(open3d_window, "obstacle_to_window", lambda: "there is no display")
    with pytest.raises(UsageError, match="no window can be opened"):
        open3d_window.view_run(folder)
    assert "shows bodies and skeletons without the measured points" in caplog.text


@pytest.mark.parametrize("missing", ["display", "vulkan"])
def test_a_missing_part_is_named_with_a_remedy(
    folder: Path, missing: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(open3d_ready, "has_x_display", lambda: missing == "vulkan")
    monkeypatch.setattr(open3d_ready, "_vulkan_devices", lambda: 0)
    assert run("view", folder) == 2
    said = capsys.readouterr().err
    assert ("libvulkan1 mesa-vulkan-drivers" if missing == "vulkan" else "no display") in said and "--browser" in said


def test_a_display_that_does_not_answer_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":4711")
    assert not open3d_ready.has_x_display()


def test_time_passes_at_the_speed_that_is_set() -> None:
    playback = Playback(5.0 + np.arange(10) / 10)
    assert not playback.advance(1.0) and playback.frame == 0
    playback.toggle()
    assert playback.advance(0.25) and playback.frame == 2
    playback.speed = 0.5
    assert not playback.advance(0.01) and playback.advance(0.2) and playback.frame == 3
    playback.show(99)
    assert playback.frame == 9 and playback.seconds == pytest.approx(0.9)
    playback.show(-1)
    assert playback.frame == 0
    playback.speed = 4.0
    assert playback.advance(9.0) and playback.frame == 9 and not playback.playing, "it stops at the end"
    playback.toggle()
    assert playback.playing and playback.frame == 0, "and plays from the start again"
