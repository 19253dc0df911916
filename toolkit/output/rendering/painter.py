"""Painter of run frames: depth with skeletons and extrema, fitted bodies, side view, plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import SettingsError, TrackError
from toolkit.landmarks.extrema import geodesic_extrema
from toolkit.output.rendering import style
from toolkit.output.rendering.open3d_pictures import PicturePainter
from toolkit.output.rendering.overlay import Ground, color_depth, draw_extrema, draw_points, draw_skeleton
from toolkit.output.rendering.views import R_LEVEL_VIEW, OutsideView, outside_view_of, window_on
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.depth_filter import DepthFilter
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.simulation.mesh import Mesh, joined
from toolkit.simulation.shading import draw, visible
from toolkit.tracks import EMPTY, LOST, STATE_NAMES
from toolkit.tracks.runs import Person

PANELS = ("depth", "body", "side", "plan")
TITLES = {
    "depth": "depth, skeleton, extrema", "body": "fitted body", "side": "seen from the subject's left",
    "plan": "seen from above",
}  # fmt: skip
CAMERA_AT = {"side": "camera at the left", "plan": "camera at the bottom"}
ENGINES = ("toolkit", "open3d")


@dataclass(frozen=True)
class RenderSettings:
    """Settings of the drawing.

    Attributes
    ----------
    panels : some of "depth", "body", "side" and "plan", from left to right
    height : height of a panel, pixels, a multiple of 4
    aspect : width of the panels "depth" and "body" relative to their height; the others have 3/4
    extrema : number of drawn geodesic extrema; 0 for none
    engine : "toolkit", or "open3d": bodies on white paper with soft shadows, some ten times slower
    """

    panels: tuple[str, ...] = ("depth", "body", "side")
    height: int = 480
    aspect: float = 4 / 3
    extrema: int = 20
    engine: str = "toolkit"

    def __post_init__(self) -> None:
        if not self.panels or any(panel not in PANELS for panel in self.panels):
            raise SettingsError(f"panels {self.panels} are not some of: {', '.join(PANELS)}")
        if self.engine not in ENGINES:
            raise SettingsError(f"engine {self.engine!r} is unknown; give {' or '.join(ENGINES)}")

    def size(self, panel: str) -> tuple[int, int]:
        """Return width and height of a panel in pixels."""
        width = self.height * (0.75 if panel in R_LEVEL_VIEW else self.aspect)
        return (2 * round(width / 2), self.height)  # even, for film codecs


class FramePainter:
    """Painter of the frames of one run; fixed views keep a film steady.

    One person is drawn in the colours of the sides, with geodesic extrema; several people have one colour each.

    Parameters
    ----------
    people : all of the run, at least one
    recording : with as many frames as their tracks
    sensing : with which the depth was cleaned
    settings : drawn elements

    Raises
    ------
    TrackError
        Tracks and recording have different numbers of frames.
    """

    def __init__(
        self,
        people: Sequence[Person],
        recording: Recording,
        *,
        sensing: SensingSettings | None = None,
        settings: RenderSettings | None = None,
    ) -> None:
        for person in people:
            if len(person.track) != len(recording):
                raise TrackError(
                    f"the track has {len(person.track)} frames and the recording {recording.name} has "
                    f"{len(recording)}; name the recording of this track"
                )
        self.settings = settings or RenderSettings()
        self._people, self._name = tuple(people), recording.name
        self._rotation = people[0].R_level_camera
        self._filter = DepthFilter(recording.camera, sensing or SensingSettings())
        self._colors = style.mesh_colors([person.body for person in people])
        there = [person.track.joints[person.track.state != EMPTY] for person in people]
        seen = np.concatenate(there)
        joints = np.asarray(seen if len(seen) else people[0].track.joints, dtype=np.float64)
        self._window = window_on(joints, recording.camera.undistorted(), self.settings.size("depth"))
        level = joints @ self._rotation.T
        self._views = {panel: outside_view_of(level, self.settings.size(panel), panel) for panel in R_LEVEL_VIEW}
        self._views |= dict.fromkeys(("depth", "body"), OutsideView(self._window.camera, np.zeros(3), self._rotation))
        self._ground = Ground(people)
        self._pictures = {}
        if self.settings.engine == "open3d":
            drawn = {panel: view for panel, view in self._views.items() if panel != "depth"}
            self._pictures = {panel: PicturePainter(view, self._ground.height) for panel, view in drawn.items()}
        depths = joints[:, 0, 2]
        near_share, far_share = 0.4, 0.8  # m of depth range in front of and behind the person on the colour scale
        self._near = float(np.percentile(depths, 5)) - near_share
        self._far = float(np.percentile(depths, 95)) + far_share

    def paint(self, i: int, depth_mm: np.ndarray) -> np.ndarray:
        """Return the RGB picture of frame `i` from its depth, uint16 (H, W) millimetres, frames in order."""
        bodies = [
            Mesh(person.body.vertex_positions(person.track.pose[i]), person.body.faces, self._colors[k])
            for k, person in self._there(i)
        ]
        cloud = self._cloud(depth_mm, joined(bodies))
        backdrop = self._colored(depth_mm, cloud) if set(self.settings.panels) & {"depth", "body"} else None
        panels = []
        for panel in self.settings.panels:
            image, view = self._blank(panel, backdrop), self._views[panel]
            placed = [body._replace(vertices=view.to_camera(body.vertices)) for body in bodies]
            if panel == "depth":  # the measured floor is visible in the depth
                self._draw_depth(image, i, cloud)
            elif self._pictures:
                image[:] = self._pictures[panel].paint(placed)
            else:
                self._ground.draw_floor(image, view.project)
                draw(image, placed, view.camera, style.LIGHTS, style.KEY_LIGHT)
                if panel in R_LEVEL_VIEW:
                    draw_points(image, view.project(cloud.points), style.CLOUD)
                    place = (10, image.shape[0] - 2 * self._text)
                    style.write(image, CAMERA_AT[panel], *place, max(8, self._text - 4), style.FAINT)
            self._ground.draw_soles(image, view.project, i, [k for k, _ in self._there(i)])
            title = "depth, skeletons" if panel == "depth" and not self._extrema else TITLES[panel]
            style.write(image, title, 10, 8, self._text, style.PAPER if panel in self._pictures else style.INK)
            panels.append(image)
        return np.vstack([self._head(i, sum(p.shape[1] for p in panels)), np.hstack(panels), self._legend(panels)])

    @property
    def _several(self) -> bool:
        return len(self._people) > 1

    @property
    def _text(self) -> int:
        return max(9, self.settings.height // 30)

    def _there(self, i: int) -> list[tuple[int, Person]]:
        """Yield index and person of the people in frame `i`."""
        return [(k, person) for k, person in enumerate(self._people) if person.track.state[i] != EMPTY]

    def _cloud(self, depth_mm: np.ndarray, bodies: Mesh) -> Cloud:
        """Return the measured points near a drawn body (level frame), independent of the segmentation."""
        camera = self._filter.camera
        _, inverse, _ = visible(bodies._replace(vertices=bodies.vertices @ self._rotation), camera)
        step = self._filter.step
        depth = (self._filter.checked(depth_mm)[::step, ::step] / 1000.0).astype(np.float32)
        reach = 0.15  # metres between the drawn body and points shown with it
        near = np.where(np.abs(depth * inverse - 1.0) < reach * inverse, depth, np.float32(0.0))
        return Cloud.from_depth(near, camera, self._rotation)

    def _colored(self, depth_mm: np.ndarray, cloud: Cloud) -> np.ndarray:
        person = cloud.depth > 0
        if person.shape != depth_mm.shape:  # cleaned at half resolution
            person = np.repeat(np.repeat(person, 2, axis=0), 2, axis=1)[: depth_mm.shape[0], : depth_mm.shape[1]]
        return self._window.cut(color_depth(depth_mm, person, self._near, self._far), style.PAPER)

    def _blank(self, panel: str, backdrop: np.ndarray | None) -> np.ndarray:
        if panel in R_LEVEL_VIEW or backdrop is None:
            width, height = self.settings.size(panel)
            return np.full((height, width, 3), style.PAPER, dtype=np.uint8)
        behind_body = 2  # factor by which the depth image behind the fitted body is darkened
        return backdrop.copy() if panel == "depth" else backdrop // behind_body

    def _draw_depth(self, image: np.ndarray, i: int, cloud: Cloud) -> None:
        for k, person in self._there(i):
            color = style.person_color(k) if self._several else None
            pixels = self._window.camera.project(person.track.joints[i])
            draw_skeleton(image, pixels, person.track.observed[i], color)
        if self._extrema and len(cloud):
            extrema = geodesic_extrema(cloud, self._extrema)
            draw_extrema(image, self._window.camera.project(extrema.points @ self._rotation))

    @property
    def _extrema(self) -> int:
        return 0 if self._several else self.settings.extrema

    def _head(self, i: int, width: int) -> np.ndarray:
        track, size = self._people[0].track, self._text
        frame, time = f"{self._name}   frame {i + 1}/{len(track)}", f"{track.timestamps[i]:.2f} s"
        longest = f"{self._name}   frame {len(track)}/{len(track)}  {track.timestamps[-1]:.2f} s"
        names = [f"{person.name}  {STATE_NAMES[LOST]}, {STATE_NAMES[EMPTY]}" for person in self._people]
        # The widest text sets the width of a box, so that all pictures of a film have the same height.
        places = style.flowed([style.width_of(text, size) + size for text in (longest, *names)], width, size)
        bar = np.full((2 * size * (1 + places[-1][0]), width, 3), style.BAR, dtype=np.uint8)
        x = style.write(bar, frame, places[0][1], size // 3, size)
        style.write(bar, time, x + size, size // 3, size, style.FAINT)
        for k, (person, (line, x)) in enumerate(zip(self._people, places[1:], strict=True)):
            track, state, y = person.track, int(person.track.state[i]), 2 * size * line + size // 3
            color = style.ALARM if state == LOST else style.INK if state != EMPTY else style.FAINT
            if self._several:
                x = style.write(bar, person.name, x, y, size, style.person_color(k)) + size // 2
            x = style.write(bar, STATE_NAMES[state], x, y, size, color)
            if state != EMPTY and len(track.source_names) and not self._several:
                style.write(bar, track.source_names[int(track.source[i])], x + 2 * size, y, size, style.FAINT)
        return bar

    def _legend(self, panels: list[np.ndarray]) -> np.ndarray:
        size, width = self._text, sum(p.shape[1] for p in panels)
        entries = [("subject's left", style.LEFT), ("subject's right", style.RIGHT), ("trunk, head", style.MIDDLE)]
        if self._several:
            entries = [(person.name, style.person_color(k)) for k, person in enumerate(self._people)]
        if "depth" in self.settings.panels and self._extrema:
            entries.append(("geodesic extrema (the first five larger)", style.EXTREMUM))
        if "side" in self.settings.panels and not self._pictures:
            entries.append(("measured points", style.CLOUD))
        if self._ground.carries:
            entries.append(("foot contact", style.CARRYING))
        places = style.flowed([style.width_of(text, size) + 2 * size for text, _ in entries], width, size)
        bar = np.full((2 * size * (1 + places[-1][0]), width, 3), style.BAR, dtype=np.uint8)
        for (text, color), (line, x) in zip(entries, places, strict=True):
            y = 2 * size * line
            bar[y + size // 2 : y + 3 * size // 2, x : x + size] = color
            style.write(bar, text, x + size + size // 2, y + size // 3, size)
        return bar
