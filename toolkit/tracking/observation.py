"""Observation of a frame by a tracker: the cloud of one sighting and its landmarks (Baak 2013, 5.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from toolkit.body import skeleton
from toolkit.database.origin import ADULT_HEIGHT
from toolkit.fitting.guide import Guide
from toolkit.fitting.joint_confidence import network_features
from toolkit.fitting.joint_evidence import EstimatedJoints, SightedJoints, links_out_of_view
from toolkit.fitting.orientation import FrameEvidence
from toolkit.fitting.scene import Scene
from toolkit.kernels import linear
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.cuts import on_cuts
from toolkit.landmarks.extrema import Extrema, extrema_of_graph, source_node
from toolkit.landmarks.facing import estimate_facing, smoothed_facing
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.landmarks.joint_network import JointEstimate, JointNetwork
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.people.joint_masks import on_cut_out
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.joints2d import Joints2D, LiftedJoints, lift
from toolkit.tracking.state import PersonState

LEG_LINKS: np.ndarray = np.isin(skeleton.JOINT_NAMES, skeleton.LEGS)
"""Bool (18,): joints of the legs."""
VIEW_TIME = 0.3
"""Time constant of the joints in view, seconds: a person who crouches for a moment is not a head behind a desk."""


class Observation:
    """One frame of one person; each part is computed at its first use.

    Attributes
    ----------
    cloud : the person's points, level frame
    timestamp : seconds
    unobserved : bool (H, W), pixels without information about the person, or None
    joints : the person's joints in the image, in pixels of the cloud's camera, or None
    observer : settings and tools
    follows : True if the previous frame has a pose; False in a first frame, after a loss and after a short absence,
        when the last pose is one hypothesis of several
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
        self.observer, self._state = observer, state
        self.follows = state.previous is not None
        self.scale = state.body.height / ADULT_HEIGHT

    @property
    def elapsed(self) -> float:
        """Seconds since the frame before."""
        return self._state.elapsed(self.timestamp)

    @cached_property
    def centre(self) -> np.ndarray:
        """Float64 (3,), metres, level frame (Baak 2013, 5.3.4)."""
        return cloud_centre(self.cloud.points, self._state.centre, self.scale)

    @cached_property
    def facing(self) -> np.ndarray:
        """Smoothed facing direction in the ground plane, float64 (2,)."""
        estimate = estimate_facing(self.cloud.points, self.centre, self.observer.landmarks, self.scale)
        return smoothed_facing(self._state.facing, estimate, self.elapsed, self.centre)

    @property
    def yaw(self) -> float:
        """Facing of the person, radians."""
        return float(np.arctan2(*self.facing))

    @cached_property
    def extrema(self) -> Extrema:
        """Geodesic extrema (`E_I^20`, Baak 2013, 5.4.2)."""
        observer, points = self.observer, self.cloud.points
        graph = grid_graph(self.cloud, observer.landmarks, observer.workspace)
        source = source_node(graph, points, self.centre, observer.landmarks, self.scale)
        return extrema_of_graph(graph, points, observer.extrema, source, observer.workspace)

    @cached_property
    def cut(self) -> np.ndarray:
        """Extrema at which the image border or a nearer surface truncates the person, bool (n,). They are no limbs.

        A narrow piece that leaves by another border than the lower one is a hand, of which little is missing.
        """
        return on_cuts(self.cloud, self.extrema.nodes, self.unobserved)

    @cached_property
    def free_extrema(self) -> np.ndarray:
        """Extrema that may be limbs: float64 (n, 3), metres, level frame, in the order found."""
        return self.extrema.points[~self.cut].astype(np.float64)

    @cached_property
    def estimate(self) -> JointEstimate | None:
        """Joints estimated by the network; None without a network."""
        network = self.observer.network
        return None if network is None else network.estimate(self.cloud, self.unobserved)

    def network_evidence(self, joints: np.ndarray, before: np.ndarray | None) -> np.ndarray | None:
        """Return the confidence's inputs from the network for joints (20, 3), see `network_features`; None without one.

        In many frames no search evaluates the network; those `before`, of an earlier frame, are then kept, because one
        evaluation costs as much as half of the other steps together.
        """
        if before is not None and "estimate" not in self.__dict__:
            return before
        return None if self.estimate is None else network_features(joints, self.estimate)

    @cached_property
    def in_view(self) -> np.ndarray | None:
        """Smoothed probability that each joint is in view, float64 (20,); None for a person who was never truncated.

        The network estimates it for truncated people, in one of `Observer.period` frames if these are close in time;
        otherwise all joints are in view.
        """
        before, is_cut = self._state.in_view, bool(self.cut.any())
        if before is None and not is_cut:
            return None
        period = self.observer.period
        frames = period if period * self.elapsed < VIEW_TIME and not self._state.lost else 1
        if before is not None and frames > 1 and not self._state.is_due(period):
            return before
        now = np.ones(len(skeleton.REPORTED))
        if is_cut:
            if self.estimate is None:
                return before
            now = self.estimate.in_view
        share = 1.0 - math.exp(-frames * self.elapsed / VIEW_TIME)
        return now if before is None else before + share * (now - before)

    def prepare(self) -> None:
        """Compute the parts that each frame needs; the others are computed on demand."""
        for part in ("scene", "facing", "in_view"):
            getattr(self, part)

    @cached_property
    def withheld(self) -> np.ndarray | None:
        """Joints whose links are out of view, bool (18,); None if there are none, or if the person is redetected.

        Without it, a leg below a desk would be attracted to unexplained measurements, such as those of a raised arm.
        While the body is learnt, certain estimates hold the legs instead. With a given `body` setting they are not
        used.
        """
        if self.observer.body != "auto":
            return LEG_LINKS if self.observer.body == "upper" else None
        if not self.follows or self._state.in_view is None or self.observer.learning:
            return None
        hidden = links_out_of_view(self._state.in_view)
        return hidden if hidden.any() else None

    @cached_property
    def lifted(self) -> LiftedJoints | None:
        """Image joints in space: metres, level frame; None without."""
        if self.joints is None:
            return None
        lifted = lift(self.joints, self.cloud.depth, self.cloud.camera)
        return lifted._replace(points=linear.rotated(lifted.points, self.cloud.rotation.T))

    @cached_property
    def evidence(self) -> list[FrameEvidence]:
        """Evidence besides the depth, and the joints of which the network is certain."""
        observer = self.observer
        evidence = list(observer.guide.evidence(self.timestamp, self.cloud.rotation))
        unsure = not self.follows or observer.learning
        if observer.estimate_pull > 0.0 and unsure and self.estimate is not None:
            evidence.append(EstimatedJoints(self.estimate, self.cloud.rotation, observer.estimate_pull))
        # Minimum fraction of the image joints on the person's pixels; with fewer the joints are another person's.
        own_share = 0.5
        if observer.told_joints and self.joints is not None:
            own = on_cut_out(self.joints, self.cloud.depth)
            if own.sum() >= own_share * self.joints.sure.sum():
                joints = self.joints._replace(confidence=np.where(own, self.joints.confidence, 0.0))
                evidence.append(SightedJoints(joints, self.cloud.camera))
        return evidence

    @cached_property
    def scene(self) -> Scene:
        """Frame as input of a fit."""
        observer = self.observer
        return observer.scene(
            self.cloud,
            self.extrema.points.astype(np.float64),
            observer.samples,
            self.evidence,
            priors=observer.guide.priors(self.timestamp),
            unobserved=self.unobserved,
            cut=self.cut,
            withheld=self.withheld,
        )


@dataclass(frozen=True, eq=False)
class Observer:
    """Settings and tools that all observations of a person share.

    Attributes
    ----------
    landmarks : settings of the graph and of the facing
    extrema : number of geodesic extrema
    samples : measured points of the scene, see `Scene`
    network : estimates the joints of a person from one frame; None for no estimate
    guide : evidence besides the depth
    estimate_pull : weight of a certain estimate relative to one correspondence while size or place of the person is
        unknown; 0 = none
    learning : True while the body is learnt; estimates then have this weight in all frames, because clothes hide
        the size
    body : visible part of a person: "auto", "whole" or "upper", see `HybridSettings`
    scene : finds correspondences, see `open3d_scene.SCENES`
    told_joints : True if image joints on the person's pixels are evidence in every frame
    kind : class of the observations
    period : interval in frames at which the network estimates the joints in view, if it is below `VIEW_TIME`
    """

    landmarks: LandmarkSettings
    extrema: int
    samples: int
    network: JointNetwork | None
    guide: Guide = field(default_factory=Guide)
    estimate_pull: float = 0.0
    learning: bool = False
    body: str = "auto"
    told_joints: bool = False
    period: int = 1
    scene: type[Scene] = Scene
    kind: type[Observation] = Observation

    @cached_property
    def workspace(self) -> Workspace:
        """Buffers of the graph, reused from frame to frame."""
        return Workspace()

    def observe(
        self,
        cloud: Cloud,
        timestamp: float,
        state: PersonState,
        unobserved: np.ndarray | None = None,
        joints: Joints2D | None = None,
    ) -> Observation:
        """Return the observation of a frame at `timestamp` seconds; `unobserved` and `joints` as in `Sighting`."""
        return self.kind(self, cloud, timestamp, state, unobserved, joints)
