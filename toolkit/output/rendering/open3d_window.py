"""A run in an Open3D window: measured cloud, fitted bodies, skeletons, floor, on a timeline."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body.skeleton import REPORTED
from toolkit.io.errors import OutputError, RecordingError, TrackError, UsageError
from toolkit.motion.contact import ground_of
from toolkit.output.rendering.film import save_png
from toolkit.output.rendering.open3d_geometry import (
    body_geometries,
    cloud_geometry,
    confidence_colors,
    ground_geometry,
    skeleton_geometry,
    wireframe,
)
from toolkit.output.rendering.open3d_ready import obstacle_to_window
from toolkit.output.rendering.overlay import Ground
from toolkit.output.rendering.playback import SPEEDS, Playback
from toolkit.output.rendering.style import INK, PAPER
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, STATE_NAMES, RunInfo
from toolkit.tracks.runs import Person, load_persons, person_runs

logger = logging.getLogger(__name__)


def view_run(run: str | Path, recording: str | Path | None = None) -> None:
    """Open a window on a run and return when it is closed.

    Parameters
    ----------
    run : folder of a run of one or several people
    recording : new place of the recording

    Raises
    ------
    UsageError
        There is no display or no Vulkan, or no person was found.
    TrackError
        The folder holds no finished track, or the recording has another number of frames.
    """
    people = load_persons(run)
    info = RunInfo.load(person_runs(run)[0])
    try:
        opened = info.open_recording(recording)
    except RecordingError as error:
        if recording is not None:
            raise
        logger.warning("%s; the window shows bodies and skeletons without the measured points", error)
        opened = None
    if (obstacle := obstacle_to_window()) is not None:
        raise UsageError(f"no window can be opened: {obstacle}; or view the run with --browser")
    gui = _gui()
    gui.Application.instance.initialize()
    RunWindow(people, opened, title=f"depthmocap view {Path(run).name}", folder=Path(run))
    gui.Application.instance.run()


class RunWindow:
    """The window: a scene, and a panel with timeline, people and layers.

    Space plays and pauses, the left and right arrow keys show the previous and the next frame.

    Parameters
    ----------
    people : all of a run, at least one
    recording : with as many frames as their tracks; None shows no measured points
    title : title of the window
    folder : destination of screenshots
    """

    def __init__(self, people: Sequence[Person], recording: Recording | None, *, title: str, folder: Path) -> None:
        from open3d.visualization import rendering

        gui = _gui()

        if recording is not None and len(recording) != len(people[0].track):
            raise TrackError(
                f"the track has {len(people[0].track)} frames and the recording {recording.name} has {len(recording)}; "
                "name the recording that was tracked"
            )
        self._people, self._recording, self._folder = tuple(people), recording, folder
        self.playback = Playback(people[0].track.timestamps)
        size = (1280, 800)  # width and height, pixels
        self.window = gui.Application.instance.create_window(title, *size)
        self.scene = gui.SceneWidget()
        self.scene.scene = rendering.Open3DScene(self.window.renderer)
        self.scene.scene.set_background([*(np.array(PAPER) / 255.0), 1.0])
        self._materials = _materials(self.window.scaling)
        self._labels: list[Any] = []
        self._pictures: list[Callable[[Any], None]] = []
        self._panel = self._make_panel()
        self.window.add_child(self.scene)
        self.window.add_child(self._panel)
        self.window.set_on_layout(self._layout)
        self.window.set_on_tick_event(self._tick)
        self.window.set_on_close(self._closed)
        self.scene.set_on_key(self._key)
        height, _ = ground_of(people)
        if np.isfinite(height):
            ground = ground_geometry(Ground(people).pieces, people[0].R_level_camera)
            self.scene.scene.add_geometry("floor", ground, self._materials["floor"])
        self._place_view()
        self._clock = time.monotonic()
        self.draw()

    def draw(self) -> None:
        """Draw the frame of the timeline."""
        frame, scene = self.playback.frame, self.scene.scene
        for name in [f"{layer}{k}" for layer in ("body", "bones", "joints") for k in range(len(self._people))]:
            scene.remove_geometry(name)
        scene.remove_geometry("cloud")
        # Number of measured points that are shown: with more, they cover the skeletons within the bodies.
        most_points = 20_000
        if self._recording is not None and self._layers["measured cloud"].checked:
            cloud = cloud_geometry(self._recording.depth(frame), self._recording.camera, self._recording.color(frame))
            if len(cloud.points):
                every = -(-len(cloud.points) // most_points)
                scene.add_geometry("cloud", cloud.uniform_down_sample(every), self._materials["cloud"])
        bodies = body_geometries(self._people, frame)
        for label in self._labels:
            self.scene.remove_3d_label(label)
        self._labels = []
        for k, person in enumerate(self._people):
            if person.track.state[frame] != EMPTY and self._shown[k].checked:
                self._draw_person(k, person, bodies[k], frame)
        self._slider.int_value = frame
        self._play.text = "pause" if self.playback.playing else "play"
        states = [STATE_NAMES[person.track.state[frame]] for person in self._people]
        self._state.text = f"frame {frame + 1} of {len(self.playback)}, {self.playback.seconds:.2f} s\n" + "\n".join(
            f"{person.name}: {state}" for person, state in zip(self._people, states, strict=True)
        )
        self.window.post_redraw()

    def screenshot(self, path: Path, done: Callable[[Path], None] = lambda _: None) -> None:
        """Write the scene as it is seen to a PNG file once the window is drawn; `done` is called with its path."""

        def write(image: Any) -> None:
            try:
                save_png(path, np.asarray(image)[..., :3])
            except OutputError as error:  # an exception here ends the process
                self._note.text = str(error)
                return
            done(path)

        self._pictures.append(write)

    def _draw_person(self, k: int, person: Person, body: Any, frame: int) -> None:
        import open3d as o3d

        gui, scene, track = _gui(), self.scene.scene, person.track
        if self._layers["fitted bodies"].checked:
            scene.add_geometry(f"body{k}", wireframe(body), self._materials["body"])
        if self._layers["skeletons"].checked:
            scene.add_geometry(f"bones{k}", skeleton_geometry(person, frame), self._materials["bones"])
            joints = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(track.joints[frame].astype(np.float64)))
            joints.colors = o3d.utility.Vector3dVector(confidence_colors(track.confidence[frame]))
            scene.add_geometry(f"joints{k}", joints, self._materials["joints"])
        if self._layers["joint names"].checked:
            for name, place in zip(REPORTED, track.joints[frame], strict=True):
                label = self.scene.add_3d_label(place, name.replace("_", " "))
                label.color = gui.Color(*(np.array(INK) / 255.0))
                self._labels.append(label)

    def _make_panel(self) -> Any:
        gui = _gui()
        em = self.window.theme.font_size
        panel = gui.Vert(0.4 * em, gui.Margins(0.6 * em, 0.6 * em, 0.6 * em, 0.6 * em))
        self._state = gui.Label("")
        self._slider = gui.Slider(gui.Slider.INT)
        self._slider.set_limits(0, max(len(self.playback) - 1, 1))
        self._slider.set_on_value_changed(lambda value: self._show(int(value)))
        self._play = gui.Button("play")
        self._play.set_on_clicked(self.toggle)
        previous, following, picture = gui.Button("previous"), gui.Button("next"), gui.Button("screenshot")
        previous.set_on_clicked(lambda: self._show(self.playback.frame - 1))
        following.set_on_clicked(lambda: self._show(self.playback.frame + 1))
        picture.set_on_clicked(
            lambda: self.screenshot(self._screenshot_path(), lambda path: setattr(self._note, "text", str(path)))
        )
        speed = gui.Combobox()
        for factor in SPEEDS:
            speed.add_item(f"{factor:g} x speed")
        speed.selected_index = SPEEDS.index(self.playback.speed)
        speed.set_on_selection_changed(lambda _, index: setattr(self.playback, "speed", SPEEDS[index]))
        buttons = gui.Horiz(0.4 * em)
        for button in (previous, self._play, following):
            buttons.add_child(button)
        self._layers = {}
        for name in ("measured cloud", "fitted bodies", "skeletons", "floor", "joint names"):
            box = self._layers[name] = gui.Checkbox(name)
            box.checked = name != "joint names"
            box.set_on_checked(lambda _, name=name: self._switch(name))
        self._shown = []
        for person in self._people:
            box = gui.Checkbox(person.name)
            box.checked = True
            box.set_on_checked(lambda _: self.draw())
            self._shown.append(box)
        self._note = gui.Label("confidence: red 0, yellow 0.5, green 1")
        for child in (self._state, self._slider, buttons, speed, *self._layers.values(), *self._shown):
            panel.add_child(child)
        panel.add_child(picture)
        panel.add_child(self._note)
        return panel

    def toggle(self) -> None:
        """Play or pause."""
        self.playback.toggle()
        self._clock = time.monotonic()
        self.draw()

    def _show(self, frame: int) -> None:
        self.playback.show(frame)
        self.draw()

    def _switch(self, layer: str) -> None:
        if layer == "floor":
            self.scene.scene.show_geometry("floor", self._layers["floor"].checked)
        self.draw()

    def _screenshot_path(self) -> Path:
        return self._folder / f"view_{datetime.now():%Y%m%d_%H%M%S}_frame_{self.playback.frame:05d}.png"

    def _tick(self) -> bool:
        now = time.monotonic()
        changed = self.playback.advance(now - self._clock)
        self._clock = now
        if changed:
            self.draw()
        while self._pictures and self.scene.frame.width > 1:  # before its layout a window has one pixel
            self.scene.scene.scene.render_to_image(self._pictures.pop(0))
            changed = True
        return changed

    def _key(self, event: Any) -> Any:
        gui = _gui()
        result = gui.Widget.EventCallbackResult
        steps = {gui.KeyName.LEFT: -1, gui.KeyName.RIGHT: 1}
        if event.type != gui.KeyEvent.DOWN or (event.key != gui.KeyName.SPACE and event.key not in steps):
            return result.IGNORED
        if event.key == gui.KeyName.SPACE:
            self.toggle()
        else:
            self._show(self.playback.frame + steps[event.key])
        return result.HANDLED

    def _layout(self, context: Any) -> None:
        gui = _gui()
        area = self.window.content_rect
        panel = 15  # width of the panel at the right, in sizes of its letters
        width = panel * context.theme.font_size
        self.scene.frame = gui.Rect(area.x, area.y, area.width - width, area.height)
        self._panel.frame = gui.Rect(area.x + area.width - width, area.y, width, area.height)

    def _closed(self) -> bool:
        self.playback.playing = False
        return True

    def _place_view(self) -> None:
        """Place the view beside the depth camera, towards the people."""
        import open3d as o3d

        joints = np.concatenate([person.track.joints[person.there].reshape(-1, 3) for person in self._people])
        joints = joints.astype(np.float64) if len(joints) else np.array([[0.0, 0.0, 2.0]])
        low, high = np.percentile(joints, (1.0, 99.0), axis=0)
        centre = (low + high) / 2
        up = self._people[0].R_level_camera[1]
        view_angle = 50.0  # vertical angle of view, degrees
        distance = 0.7 * max(float(np.linalg.norm(high - low)), 1.0) / np.tan(np.radians(view_angle / 2))
        ahead = centre - (centre @ up) * up
        ahead /= max(float(np.linalg.norm(ahead)), 1e-6)
        beside = np.cross(ahead, up)
        # By which the first view is turned about the people, and raised, against that of the depth camera.
        first_turn, first_raise = np.radians(25.0), np.radians(10.0)
        away = -np.cos(first_turn) * ahead + np.sin(first_turn) * beside
        eye = centre + distance * (np.cos(first_raise) * away + np.sin(first_raise) * up)
        box = o3d.geometry.AxisAlignedBoundingBox(low - 3.0, high + 3.0)
        self.scene.setup_camera(view_angle, box, centre)
        self.scene.look_at(centre, eye, up)


def _gui() -> Any:
    from open3d.visualization import gui

    return gui


def _materials(scaling: float) -> dict[str, Any]:
    """Return materials by layer; `scaling` is pixels of the screen per pixel of the window's size."""
    from open3d.visualization import rendering

    shaders = {
        "cloud": "defaultUnlit", "body": "unlitLine", "bones": "unlitLine", "joints": "defaultUnlit",
        "floor": "unlitLine",
    }  # fmt: skip
    materials = {}
    for layer, shader in shaders.items():
        material = materials[layer] = rendering.MaterialRecord()
        material.shader = shader
        material.sRGB_color = True
    materials["cloud"].point_size = 2.0 * scaling
    materials["joints"].point_size = 10.0 * scaling
    materials["bones"].line_width = 5.0 * scaling
    materials["floor"].line_width = 1.0 * scaling
    materials["body"].line_width = 1.0 * scaling
    return materials
