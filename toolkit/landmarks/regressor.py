"""Joint regressor: every pixel votes for every joint, so that joints are found where extrema merge with the body.

The next step that Baak 2013, 5.5.5 names. A regression forest sends a few hundred pixels of a cleaned depth image down
its trees (questions of Shotton 2011); the leaves hold mean offsets to the 20 reported joints and how sure they are
(Girshick 2011). Trained offline on depth drawn from the poses of a database (`database_builder.regressor`) and kept in
the database's file.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from toolkit.body import skeleton
from toolkit.io.archives import Column, check_columns, check_trees
from toolkit.io.errors import DatabaseError
from toolkit.kernels.learning import forest
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud, marked

BANDWIDTH = 0.06
"""Metres: width of the mean-shift kernel at its end, about half the width of a limb plus the spread of one leaf."""
ROUNDS = 4
VOTERS = 40
"""Surest votes that count for a joint: about what the few pixels of a hand give."""

OFFSET_UNIT = 0.01
"""Metres."""
SURE_SPREAD = 0.03
"""Metres: standard deviation of the offsets in a leaf that is as sure as can be; half the width of a limb."""
FARTHEST_PROBE = 10.0
"""Metres at the pixel's depth: largest offset of a split."""
CERTAIN = 0.99
"""Share of a leaf's training views above which, and one minus it below which, it counts as no surer."""
SUREST = 0.999
"""Probability of a person beyond which a pixel is no surer."""
CHILDREN_AHEAD = "children_ahead"
REBUILD = "build the database again"
_SHARES: np.ndarray = np.clip(np.arange(256) / 255.0, 1.0 - CERTAIN, CERTAIN)
_LOG_ODDS: np.ndarray = np.log(_SHARES / (1.0 - _SHARES))
_WEIGHTS: np.ndarray = (np.arange(forest.SURE) / (forest.SURE - 1)) ** 4


def _unchanged(count: int) -> np.ndarray:
    """Lines that leave a number as it is, float32 (count, 2): what a forest that is not yet calibrated has."""
    return np.tile(np.array([0.0, 1.0], dtype=np.float32), (count, 1))


def sureness(variance: np.ndarray) -> np.ndarray:
    """How sure a leaf of these variances of joints (square metres) is, as `JointRegressor.leaf_sureness` has it."""
    return np.rint((forest.SURE - 1) * SURE_SPREAD / np.sqrt(np.maximum(variance, SURE_SPREAD**2))).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class JointRegressor:
    """A trained forest.

    Attributes
    ----------
    offsets : float32 (nodes, 4), probe offsets in metres at the pixel's depth
    thresholds : float32 (nodes,), metres
    children : int32 (nodes, 2), a negative child is leaf `-1 - child`
    roots : int32 (trees,), first node of each tree
    leaf_offsets : int8 (leaves, 20, 3), centimetres, level frame, from the pixel's point to the joints; what is farther
        than 1.27 m is never sure
    leaf_sureness : uint8 (leaves, 20), how sure these offsets are: 3 cm / standard deviation, at most 1, in 255 steps.
        A vote weighs as much as its fourth power
    leaf_in_view : uint8 (leaves, 20), share of the leaf's training pixels whose image shows the joint, in 255 steps
    calibration : float32 (20, C), reliability at C evenly spaced confidences from 0 to 1; at first the confidence
    in_view_odds : float32 (20, 2), log odds that a joint is in view: the first number plus the second times the
        evidence of the pixels (`forest.vote`)
    leaf_person : uint8 (leaves,), share of the leaf's training pixels that are of a person, in 255 steps
    person_odds : float32 (2,), log odds that a pixel is of a person at even odds beforehand: the first number plus the
        second times the mean log odds of its leaves

    Raises
    ------
    DatabaseError
        An array has another shape or type, or a child or a root is not there; each child that is a node comes after its
        parent, so that every walk ends.
    """

    offsets: np.ndarray
    thresholds: np.ndarray
    children: np.ndarray
    roots: np.ndarray
    leaf_offsets: np.ndarray
    leaf_sureness: np.ndarray
    leaf_in_view: np.ndarray
    calibration: np.ndarray = field(default_factory=lambda: _unchanged(len(skeleton.REPORTED)))
    in_view_odds: np.ndarray = field(default_factory=lambda: _unchanged(len(skeleton.REPORTED)))
    leaf_person: np.ndarray = field(kw_only=True)
    person_odds: np.ndarray = field(default_factory=lambda: _unchanged(1)[0])

    def __post_init__(self) -> None:
        nodes, leaves = len(self.offsets), len(self.leaf_offsets)
        columns = {
            "offsets": Column("f", ("nodes", 4), -FARTHEST_PROBE, FARTHEST_PROBE),
            "thresholds": Column("f", ("nodes",), -2 * forest.REACH, 2 * forest.REACH),
            "children": Column("i", ("nodes", 2), -leaves, nodes - 1),
            "roots": Column("i", ("trees",), -leaves, nodes - 1),
            "leaf_offsets": Column("i", ("leaves", len(skeleton.REPORTED), 3)),
            "leaf_sureness": Column("u", ("leaves", len(skeleton.REPORTED)), 0, forest.SURE - 1),
            "leaf_in_view": Column("u", ("leaves", len(skeleton.REPORTED)), 0, 255),
            "leaf_person": Column("u", ("leaves",), 0, 255),
            "calibration": Column("f", (len(skeleton.REPORTED), "steps"), 0.0, 1.0),
            "in_view_odds": Column("f", (len(skeleton.REPORTED), 2), -1e4, 1e4),
            "person_odds": Column("f", (2,), -1e4, 1e4),
        }
        check_columns(self.arrays(), columns, DatabaseError, "the joint regressor", REBUILD)
        check_trees(self.children, self.roots, leaves, DatabaseError, "the joint regressor", REBUILD)

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def stored(self) -> dict[str, np.ndarray]:
        """The arrays as they stand in a database file: offsets in half precision, children by how far ahead they are.

        Offsets are multiples of 1 / 256 m (`forest_training.STEPS`), so that nothing is lost.
        """
        arrays = self.arrays()
        ahead = arrays.pop("children") - np.arange(len(self.children), dtype=np.int32)[:, None]
        return {**arrays, "offsets": self.offsets.astype(np.float16), CHILDREN_AHEAD: ahead}

    @staticmethod
    def of_stored(stored: dict[str, np.ndarray]) -> JointRegressor:
        """The forest of what `stored` returned.

        Raises
        ------
        DatabaseError
            An array is missing, unknown or none of a forest.
        """
        wanted = {item.name for item in fields(JointRegressor)} - {"children"} | {CHILDREN_AHEAD}
        if stored.keys() != wanted:
            raise DatabaseError(f"the joint regressor holds {sorted(stored)} and not {sorted(wanted)}; {REBUILD}")
        columns = {
            CHILDREN_AHEAD: Column("i", ("nodes", 2), -(2**30), 2**30), "offsets": Column("f", ("nodes", 4)),
        }  # fmt: skip
        check_columns(stored, columns, DatabaseError, "the joint regressor", REBUILD)
        arrays = dict(stored)
        ahead = arrays.pop(CHILDREN_AHEAD)
        arrays["offsets"] = arrays["offsets"].astype(np.float32)
        return JointRegressor(**arrays, children=(ahead + np.arange(len(ahead))[:, None]).astype(np.int32))

    @cached_property
    def nodes(self) -> np.ndarray:
        """Question, threshold and children in a row, as the kernel walks them: float32 (nodes, 7), two int32."""
        nodes = np.empty((len(self.offsets), 7), dtype=np.float32)
        nodes[:, :4], nodes[:, 4] = self.offsets, self.thresholds
        nodes.view(np.int32)[:, 5:] = self.children
        return nodes

    def estimate(self, cloud: Cloud, samples: int, unobserved: np.ndarray | None = None) -> JointEstimate:
        """Joints of a cloud from about `samples` of its points, evenly spread in scan order.

        `unobserved` bool (H, W), where it is known, are the pixels of the cloud's image that say nothing about the
        person: something nearer hides what is there. The image's border needs no mention.
        """
        rows = cloud.spread_rows(samples)
        depth = cloud.depth if unobserved is None else marked(cloud.depth, unobserved, -1.0)
        intrinsics = cloud.camera.intrinsics
        return self.judged(*self.votes(depth, intrinsics, cloud.rotation, cloud.pixels[rows], cloud.points[rows]))

    def votes(
        self, depth: np.ndarray, intrinsics: np.ndarray, rotation: np.ndarray, pixels: np.ndarray, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What some pixels of a depth image vote for, before any calibration.

        Parameters
        ----------
        depth : float32 (H, W), metres, 0 = nothing, negative = unobserved
        intrinsics : fx, fy, cx, cy, pixels
        rotation : (3, 3), `R_level_camera`
        pixels, points : (N,) flat indices and (N, 3) their points, metres, level frame

        Returns
        -------
        float64 (20, 3) joints, metres, level frame; (20,) confidence; (20,) evidence that a joint is in view
        """
        leaves = self._leaves(depth, intrinsics, rotation, pixels)
        joints = np.empty((len(skeleton.REPORTED), 3))
        confidence, evidence = np.empty((2, len(skeleton.REPORTED)))
        forest.vote(
            points, leaves, self.leaf_offsets, OFFSET_UNIT, self.leaf_sureness, self.leaf_in_view, _WEIGHTS,
            _LOG_ODDS, VOTERS, BANDWIDTH, ROUNDS, joints, confidence, evidence,
        )  # fmt: skip
        return joints, confidence, evidence

    def person_probability(
        self, depth: np.ndarray, intrinsics: np.ndarray, rotation: np.ndarray, pixels: np.ndarray
    ) -> np.ndarray:
        """Probability that each of some pixels of a depth image is of a person and not of a room and its furniture.

        The image is best whole, as it was measured; what was cut out of one is understood too, furniture that touches a
        person or was mistaken for one. Walls, chairs and people are held to be equally likely beforehand ("even odds"):
        where a share p of the pixels is of people, add log(p / (1 - p)) to the log odds. Pixels of one surface ask much
        the same questions, so that evidence for a set of them is their mean, not their sum.

        Parameters
        ----------
        depth : float32 (H, W), metres, 0 = not measured, or nothing, negative = unobserved
        intrinsics : fx, fy, cx, cy, pixels
        rotation : (3, 3), `R_level_camera`
        pixels : (N,) flat indices of pixels that were measured; a tenth of a microsecond each for each level of a tree

        Returns
        -------
        float64 (N,), calibrated on rooms that the forest was not trained on
        """
        odds = self._person_log_odds[self._leaves(depth, intrinsics, rotation, pixels)].mean(axis=1)
        odds = self.person_odds[0] + self.person_odds[1] * odds
        return np.asarray(1.0 / (1.0 + np.exp(-odds)))

    def log_odds(self, depth: np.ndarray, camera: Camera, rotation: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """See `toolkit.people.hypothesis.PersonJudge.log_odds`."""
        chances = self.person_probability(depth, camera.intrinsics, rotation, pixels)
        chances = np.clip(chances, 1.0 - SUREST, SUREST)
        return np.asarray(np.log(chances / (1.0 - chances)))

    def _leaves(
        self, depth: np.ndarray, intrinsics: np.ndarray, rotation: np.ndarray, pixels: np.ndarray
    ) -> np.ndarray:
        """Leaf of every pixel in every tree, int64 (N, trees)."""
        leaves = np.empty((len(pixels), len(self.roots)), dtype=np.int64)
        forest.find_leaves(forest.View(depth, intrinsics, rotation), pixels, self.nodes, self.roots, leaves)
        return leaves

    def judged(self, joints: np.ndarray, confidence: np.ndarray, evidence: np.ndarray) -> JointEstimate:
        """What `votes` returned, with the probabilities that it stands for."""
        odds = self.in_view_odds[:, 0] + self.in_view_odds[:, 1] * evidence
        knots = np.linspace(0.0, 1.0, self.calibration.shape[1])
        reliability = np.array([np.interp(c, knots, row) for c, row in zip(confidence, self.calibration, strict=True)])
        return JointEstimate(joints, confidence, 1.0 / (1.0 + np.exp(-odds)), reliability)

    @cached_property
    def _person_log_odds(self) -> np.ndarray:
        """float64 (leaves,)."""
        return np.asarray(_LOG_ODDS[self.leaf_person])
