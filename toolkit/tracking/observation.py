"""What a tracker knows of a frame before it decides: the cloud of one sighting and its landmarks (Baak 2013, 5.3)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from toolkit.database.origin import ADULT_HEIGHT
from toolkit.fitting.scene import Scene
from toolkit.kernels import linear
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import Extrema, extrema_of_graph, source_node
from toolkit.landmarks.facing import FacingFilter, estimate_facing
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.landmarks.parts import JointEstimate, JointForest
from toolkit.landmarks.settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.joints2d import Joints2D, LiftedJoints, lift
from toolkit.tracking.guide import Guide, NoGuide
from toolkit.tracking.state import PersonState

FIRST_STEP = 1.0 / 30.0
"""Seconds between the first frame and the one before that there never was."""

CUT_PIXELS = 3
"""An extremum nearer to the image's border than this, where the person reaches the border, lies on a cut."""
HAND_WIDTH = 0.2
"""Metres: what leaves by the upper border or a side and is narrower is an arm with little missing."""
CUT_SHARE = 0.4
"""Of the pixels around an extremum: an occluder's edge leaves about half of them unobserved, the shadow that a depth
camera throws beside a limb less."""


@dataclass(frozen=True, eq=False)
class Observer:
    """How sightings are looked at: settings and tools that all observations of a person share.

    Attributes
    ----------
    landmarks : of the graph, the centre and the facing
    extrema : how many geodesic extrema
    samples, search : of the scene, see `Scene`
    forest, vote_samples : the joint regressor, None for no votes, and how many pixels vote
    guide : what is known besides the depth
    """

    landmarks: LandmarkSettings
    extrema: int
    samples: int
    search: str
    forest: JointForest | None
    vote_samples: int
    guide: Guide = field(default_factory=NoGuide)

    @cached_property
    def workspace(self) -> Workspace:
        """Buffers of the graph, kept from frame to frame."""
        return Workspace()

    def observe(
        self,
        cloud: Cloud,
        timestamp: float,
        state: PersonState,
        unobserved: np.ndarray | None = None,
        joints: Joints2D | None = None,
    ) -> Observation:
        """A frame of the person, seconds; `unobserved` and `joints` as in `Sighting`."""
        return Observation(self, cloud, timestamp, state, unobserved, joints)


class Observation:
    """One frame of one person; each part is computed when it is first asked for.

    Attributes
    ----------
    cloud : the person's points, level frame
    timestamp : seconds
    unobserved : bool (H, W), pixels that say nothing about the person, or None
    joints : the person's joints in the image, in pixels of the cloud's camera, or None
    observer, state : how it is looked at, and what was known of the person before
    scale : size of the person against an adult
    """

    def __init__(
        self,
        observer: Observer,
        cloud: Cloud,
        timestamp: float,
        state: PersonState,
        unobserved: np.ndarray | None = None,
        joints: Joints2D | None = None,
    ) -> None:
        self.cloud, self.timestamp, self.unobserved, self.joints = cloud, timestamp, unobserved, joints
        self.observer, self.state = observer, state
        self.scale = state.body.height / ADULT_HEIGHT

    @cached_property
    def centre(self) -> np.ndarray:
        """Float64 (3,), metres, level frame (Baak 2013, 5.3.4)."""
        return cloud_centre(self.cloud.points, self.state.centre, self.observer.landmarks, self.scale)

    @cached_property
    def facing(self) -> np.ndarray:
        """Float64 (2,): the smoothed direction that the person faces, in the ground plane."""
        before, landmarks = self.state.timestamp, self.observer.landmarks
        dt = FIRST_STEP if before is None else self.timestamp - before
        smooth = FacingFilter(landmarks, self.state.facing)
        smooth.update(estimate_facing(self.cloud.points, self.centre, landmarks, self.scale), dt, self.centre)
        assert smooth.direction is not None
        return smooth.direction

    @property
    def yaw(self) -> float:
        """Radians, facing of the person."""
        return float(np.arctan2(*self.facing))

    @cached_property
    def extrema(self) -> Extrema:
        """The geodesic extrema (`E_I^20`, Baak 2013, 5.4.2)."""
        observer, points = self.observer, self.cloud.points
        graph = grid_graph(self.cloud, observer.landmarks, observer.workspace)
        source = source_node(graph, points, self.centre, observer.landmarks, self.scale)
        return extrema_of_graph(graph, points, observer.extrema, source, observer.workspace)

    @cached_property
    def cut(self) -> np.ndarray:
        """Bool (n,): extrema where the image's border or something nearer cuts the person off. They are no limbs.

        A narrow piece that leaves by another border than the lower one is a hand, of which little is missing.
        """
        cloud, extrema = self.cloud, self.extrema
        cut = np.zeros(len(extrema), dtype=np.bool_)
        for i, pixel in enumerate(cloud.pixels[extrema.nodes]):
            v, u = divmod(int(pixel), cloud.camera.width)
            cut[i] = _leaves_image(cloud, v, u)
            if self.unobserved is not None:
                rows = slice(max(v - CUT_PIXELS, 0), v + CUT_PIXELS + 1)
                around = self.unobserved[rows, max(u - CUT_PIXELS, 0) : u + CUT_PIXELS + 1]
                cut[i] |= np.count_nonzero(around) > CUT_SHARE * around.size
        return cut

    @cached_property
    def free_extrema(self) -> np.ndarray:
        """The extrema that may be limbs: float64 (n, 3), metres, level frame, in the order found."""
        return self.extrema.points[~self.cut].astype(np.float64)

    @cached_property
    def votes(self) -> JointEstimate | None:
        """The joints as the regressor sees them; None without a regressor."""
        observer = self.observer
        return (
            None
            if observer.forest is None
            else observer.forest.estimate(self.cloud, observer.vote_samples, unobserved=self.unobserved)
        )

    @cached_property
    def lifted(self) -> LiftedJoints | None:
        """The joints of the image in space: metres, level frame; None without."""
        if self.joints is None:
            return None
        lifted = lift(self.joints, self.cloud.depth, self.cloud.camera)
        return lifted._replace(points=linear.rotated(lifted.points, self.cloud.rotation.T))

    @cached_property
    def scene(self) -> Scene:
        """The frame as a fit needs it."""
        observer = self.observer
        return Scene(
            self.cloud,
            self.extrema.points.astype(np.float64),
            observer.samples,
            observer.search,
            observer.guide.evidence(self.timestamp, self.cloud.rotation),
            unobserved=self.unobserved,
            cut=self.cut,
        )


def _leaves_image(cloud: Cloud, v: int, u: int) -> bool:
    """Whether the person leaves the image near pixel (v, u), and not just with a hand."""
    depth, (height, width) = cloud.depth, cloud.camera.shape
    for distance, border, place, narrow in (
        (height - 1 - v, depth[-1], u, 0.0),
        (v, depth[0], u, HAND_WIDTH),
        (u, depth[:, 0], v, HAND_WIDTH),
        (width - 1 - u, depth[:, -1], v, HAND_WIDTH),
    ):
        if distance >= CUT_PIXELS:
            continue
        window = border[max(place - CUT_PIXELS, 0) : place + CUT_PIXELS + 1]
        if window.any() and _run(border, place) * float(window.max()) / cloud.camera.fx > narrow:
            return True
    return False


def _run(border: np.ndarray, place: int) -> int:
    """Pixels of the person on a border (N,) that hang together with those around `place`."""
    gaps = np.flatnonzero(border == 0)
    inside = np.flatnonzero(border[max(place - CUT_PIXELS, 0) : place + CUT_PIXELS + 1]) + max(place - CUT_PIXELS, 0)
    if len(inside) == 0:
        return 0
    start = int(inside[0])
    after = np.searchsorted(gaps, start)
    low = int(gaps[after - 1]) if after > 0 else -1
    high = int(gaps[after]) if after < len(gaps) else len(border)
    return high - low - 1
