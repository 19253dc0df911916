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
from toolkit.output.rendering import open3d_geometry as geometry
from toolkit.output.rendering.film import save_png
from toolkit.output.rendering.open3d_ready import obstacle_to_window
from toolkit.output.rendering.overlay import Ground
from toolkit.output.rendering.style import INK, PAPER
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, STATE_NAMES, RunInfo
from toolkit.tracks.runs import Person, load_persons, person_runs

logger = logging.getLogger(__name__)
SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Factors of real time that a viewer offers."""


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
    from open3d.visualization import gui

    gui.Application.instance.initialize()
    RunWindow(people, opened, title=f"depthmocap view {Path(run).name}", folder=Path(run))
    gui.Application.instance.run()


class Playback:
    """Timeline of a track.

    Parameters
    ----------
    timestamps : (T,), seconds, rising, T at least 1

    Attributes
    ----------
    frame : shown now, 0 to T - 1
    playing : True while time advances
    speed : factor of real time
    """

    def __init__(self, timestamps: np.ndarray) -> None:
        self._times = np.asarray(timestamps, dtype=np.float64) - timestamps[0]
        self.frame, self.playing, self.speed = 0, False, 1.0
        self._time = 0.0

    def __len__(self) -> int:
        return len(self._times)

    @property
    def seconds(self) -> float:
        """Seconds of the frame shown, since the first frame."""
        return float(self._times[self.frame])

    def show(self, frame: int) -> None:
        """Show a frame; one beyond either end is the first or the last."""
        self.frame = min(max(frame, 0), len(self) - 1)
        self._time = self.seconds

    def toggle(self) -> None:
        """Play, or pause; at the end play from the first frame."""
        self.playing = not self.playing
        if self.playing and self.frame == len(self) - 1:
            self.show(0)

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` seconds of real time pass; returns True if another frame is shown. It stops at the last one."""
        if not self.playing:
            return False
        before = self.frame
        self._time += self.speed * elapsed
        self.frame = int(np.searchsorted(self._times, self._time, side="right")) - 1
        if self.frame >= len(self) - 1:
            self.playing = False
        return self.frame != before


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
        from open3d.visualization import gui, rendering

        if recording is not None and len(recording) != len(people[0].track):
            raise TrackError(
                f"the track has {len(people[0].track)} frames and the recording {recording.name} has {len(recording)}; "
                "name the recording that was tracked"
            )
        self._people, self._recording, self._folder, self._gui = tuple(people), recording, folder, gui
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
            ground = geometry.ground_geometry(Ground(people).pieces, people[0].R_level_camera)
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
            cloud = geometry.cloud_geometry(
                self._recording.depth(frame), self._recording.camera, self._recording.color(frame)
            )
            if len(cloud.points):
                every = -(-len(cloud.points) // most_points)
                scene.add_geometry("cloud", cloud.uniform_down_sample(every), self._materials["cloud"])
        scene.show_geometry("floor", self._layers["floor"].checked)
        bodies = geometry.body_geometries(self._people, frame)
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

        scene, track = self.scene.scene, person.track
        if self._layers["fitted bodies"].checked:
            scene.add_geometry(f"body{k}", geometry.wireframe(body), self._materials["body"])
        if self._layers["skeletons"].checked:
            scene.add_geometry(f"bones{k}", geometry.skeleton_geometry(person, frame), self._materials["bones"])
            joints = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(track.joints[frame].astype(np.float64)))
            joints.colors = o3d.utility.Vector3dVector(geometry.confidence_colors(track.confidence[frame]))
            scene.add_geometry(f"joints{k}", joints, self._materials["joints"])
        if self._layers["joint names"].checked:
            for name, place in zip(REPORTED, track.joints[frame], strict=True):
                label = self.scene.add_3d_label(place, name.replace("_", " "))
                label.color = self._gui.Color(*(np.array(INK) / 255.0))
                self._labels.append(label)

    def _make_panel(self) -> Any:
        gui = self._gui
        em = self.window.theme.font_size
        panel = gui.Vert(0.4 * em, gui.Margins(0.6 * em, 0.6 * em, 0.6 * em, 0.6 * em))
        self._state = gui.Label("")
        self._slider = gui.Slider(gui.Slider.INT)
        self._slider.set_limits(0, max(len(self.playback) - 1, 1))
        self._slider.set_on_value_changed(lambda value: self._show(int(value)))

        def button(text: str, action: Callable[[], None]) -> Any:
            made = gui.Button(text)
            made.set_on_clicked(action)
            return made

        def box(text: str, checked: bool, action: Callable[[bool], None]) -> Any:
            made = gui.Checkbox(text)
            made.checked = checked
            made.set_on_checked(action)
            return made

        speed = gui.Combobox()
        for factor in SPEEDS:
            speed.add_item(f"{factor:g} x speed")
        speed.selected_index = SPEEDS.index(self.playback.speed)
        speed.set_on_selection_changed(lambda _, index: setattr(self.playback, "speed", SPEEDS[index]))
        self._play = button("play", self.toggle)
        buttons = gui.Horiz(0.4 * em)
        buttons.add_child(button("previous", lambda: self._show(self.playback.frame - 1)))
        buttons.add_child(self._play)
        buttons.add_child(button("next", lambda: self._show(self.playback.frame + 1)))
        layers = ("measured cloud", "fitted bodies", "skeletons", "floor", "joint names")
        self._layers = {name: box(name, name != "joint names", lambda _: self.draw()) for name in layers}
        self._shown = [box(person.name, True, lambda _: self.draw()) for person in self._people]
        self._note = gui.Label("confidence: red 0, yellow 0.5, green 1")
        picture = button("screenshot", self._save_picture)
        boxes = (*self._layers.values(), *self._shown)
        for child in (self._state, self._slider, buttons, speed, *boxes, picture, self._note):
            panel.add_child(child)
        return panel

    def toggle(self) -> None:
        """Play or pause."""
        self.playback.toggle()
        self._clock = time.monotonic()
        self.draw()

    def _show(self, frame: int) -> None:
        self.playback.show(frame)
        self.draw()

    def _save_picture(self) -> None:
        """Write a picture named by time and frame into the folder of the run."""
        name = f"view_{datetime.now():%Y%m%d_%H%M%S}_frame_{self.playback.frame:05d}.png"
        self.screenshot(self._folder / name, lambda path: setattr(self._note, "text", str(path)))

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
        gui = self._gui
        actions = {
            gui.KeyName.LEFT: lambda: self._show(self.playback.frame - 1),
            gui.KeyName.RIGHT: lambda: self._show(self.playback.frame + 1),
            gui.KeyName.SPACE: self.toggle,
        }
        if event.type != gui.KeyEvent.DOWN or event.key not in actions:
            return gui.Widget.EventCallbackResult.IGNORED
        actions[event.key]()
        return gui.Widget.EventCallbackResult.HANDLED

    def _layout(self, context: Any) -> None:
        area, rect = self.window.content_rect, self._gui.Rect
        panel = 15  # width of the panel at the right, in sizes of its letters
        width = panel * context.theme.font_size
        self.scene.frame = rect(area.x, area.y, area.width - width, area.height)
        self._panel.frame = rect(area.x + area.width - width, area.y, width, area.height)

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


def _materials(scaling: float) -> dict[str, Any]:
    """Return materials by layer; `scaling` is pixels of the screen per pixel of the window's size."""
    from open3d.visualization import rendering

    sizes = {"cloud": 2.0, "joints": 10.0, "bones": 5.0, "floor": 1.0, "body": 1.0}  # of points and lines, pixels
    materials = {}
    for layer, size in sizes.items():
        material = materials[layer] = rendering.MaterialRecord()
        points = layer in ("cloud", "joints")
        material.shader, material.sRGB_color = "defaultUnlit" if points else "unlitLine", True
        setattr(material, "point_size" if points else "line_width", size * scaling)
    return materials
