"""Joint regressor: every pixel votes for every joint, so that joints are found where extrema merge with the body.

The next step that Baak 2013, 5.5.5 names. A regression forest sends a few hundred pixels of a cleaned depth image down
its trees (questions of Shotton 2011); the leaves hold mean offsets to the 20 reported joints and how sure they are
(Girshick 2011). Trained offline on depth drawn from the poses of a database (`database_builder.regressor`) and kept in
the database's file.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from toolkit import skeleton
from toolkit.archives import Column, check_columns, check_trees
from toolkit.errors import DatabaseError
from toolkit.kernels.learning import forest
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
CHILDREN_AHEAD = "children_ahead"
REBUILD = "build the database again"
_SHARES: np.ndarray = np.clip(np.arange(256) / 255.0, 1.0 - CERTAIN, CERTAIN)
_LOG_ODDS: np.ndarray = np.log(_SHARES / (1.0 - _SHARES))
_WEIGHTS: np.ndarray = (np.arange(forest.SURE) / (forest.SURE - 1)) ** 4


def sureness(variance: np.ndarray) -> np.ndarray:
    """How sure a leaf of these variances of joints (square metres) is, as `JointRegressor.leaf_sureness` has it."""
    return np.rint((forest.SURE - 1) * SURE_SPREAD / np.sqrt(np.maximum(variance, SURE_SPREAD**2))).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """Joints as the pixels vote for them.

    Attributes
    ----------
    points : float64 (20, 3), metres, level frame
    confidence : float64 (20,), 0 to 1: how sure the votes are and how much they agree, a weight
    in_view : float64 (20,), 0 to 1: probability that the joint is inside the image with nothing foreign before it
    reliability : float64 (20,), 0 to 1: probability that the joint is within 10 cm, calibrated on views that the forest
        was not trained on; the confidence itself for a forest without calibration
    person : mean probability that the points which voted are of a person, see `JointRegressor.person_probability`; 1
        for a forest that knows no rooms
    """

    points: np.ndarray
    confidence: np.ndarray
    in_view: np.ndarray = field(default_factory=lambda: np.ones(len(skeleton.REPORTED)))
    reliability: np.ndarray = field(default_factory=lambda: np.ones(len(skeleton.REPORTED)))
    person: float = 1.0


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
    leaf_in_view : uint8 (leaves, 20), share of the leaf's training pixels whose image shows the joint, in 255 steps;
        None = it was trained on people in full view only
    calibration : float32 (20, C), reliability at C evenly spaced confidences from 0 to 1, or None
    in_view_odds : float32 (20, 2), log odds that a joint is in view: the first number plus the second times the
        evidence of the pixels (`forest.vote`), or None
    leaf_person : uint8 (leaves,), share of the leaf's training pixels that are of a person, in 255 steps; None = it was
        trained on people alone and knows no rooms
    person_odds : float32 (2,), log odds that a pixel is of a person at even odds beforehand: the first number plus the
        second times the mean log odds of its leaves, or None

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
    leaf_in_view: np.ndarray | None = None
    calibration: np.ndarray | None = None
    in_view_odds: np.ndarray | None = None
    leaf_person: np.ndarray | None = None
    person_odds: np.ndarray | None = None

    def __post_init__(self) -> None:
        nodes, leaves = len(self.offsets), len(self.leaf_offsets)
        columns = {
            "offsets": Column("f", ("nodes", 4), -FARTHEST_PROBE, FARTHEST_PROBE),
            "thresholds": Column("f", ("nodes",), -2 * forest.REACH, 2 * forest.REACH),
            "children": Column("i", ("nodes", 2), -leaves, nodes - 1),
            "roots": Column("i", ("trees",), -leaves, nodes - 1),
            "leaf_offsets": Column("i", ("leaves", len(skeleton.REPORTED), 3)),
            "leaf_sureness": Column("u", ("leaves", len(skeleton.REPORTED)), 0, forest.SURE - 1),
        }
        if self.leaf_in_view is not None:
            columns["leaf_in_view"] = Column("u", ("leaves", len(skeleton.REPORTED)), 0, 255)
        if self.calibration is not None:
            columns["calibration"] = Column("f", (len(skeleton.REPORTED), "steps"), 0.0, 1.0)
        if self.in_view_odds is not None:
            columns["in_view_odds"] = Column("f", (len(skeleton.REPORTED), 2), -1e4, 1e4)
        if self.leaf_person is not None:
            columns["leaf_person"] = Column("u", ("leaves",), 0, 255)
        if self.person_odds is not None:
            columns["person_odds"] = Column("f", (2,), -1e4, 1e4)
        check_columns(self.arrays(), columns, DatabaseError, "the joint regressor", REBUILD)
        check_trees(self.children, self.roots, leaves, DatabaseError, "the joint regressor", REBUILD)

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays by name."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: array for name, array in arrays.items() if array is not None}

    def stored(self) -> dict[str, np.ndarray]:
        """The arrays as they stand in a database file: offsets in half precision, children by how far ahead they are.

        Offsets are multiples of 1 / 256 m (`forest_training.STEPS`), so that nothing is lost.
        """
        arrays = self.arrays()
        ahead = arrays.pop("children") - np.arange(len(self.children), dtype=np.int32)[:, None]
        return {**arrays, "offsets": self.offsets.astype(np.float16), CHILDREN_AHEAD: ahead}

    @staticmethod
    def of_stored(stored: dict[str, np.ndarray]) -> JointRegressor:
        """The forest of what `stored` returned, or of the arrays of files from before it.

        Raises
        ------
        DatabaseError
            An array is missing, unknown or none of a forest.
        """
        arrays = dict(stored)
        if (ahead := arrays.pop(CHILDREN_AHEAD, None)) is not None:
            columns = {
                CHILDREN_AHEAD: Column("i", ("nodes", 2), -(2**30), 2**30), "offsets": Column("f", ("nodes", 4)),
            }  # fmt: skip
            check_columns(stored, columns, DatabaseError, "the joint regressor", REBUILD)
            if "offsets" in arrays:
                arrays["offsets"] = arrays["offsets"].astype(np.float32)
            arrays["children"] = (ahead + np.arange(len(ahead))[:, None]).astype(np.int32)
        expected = {item.name for item in fields(JointRegressor)}
        missing = {item.name for item in fields(JointRegressor) if item.default is MISSING} - arrays.keys()
        if missing or not arrays.keys() <= expected:
            raise DatabaseError(f"the joint regressor holds {sorted(arrays)} and not {sorted(expected)}; {REBUILD}")
        return JointRegressor(**arrays)

    @cached_property
    def nodes(self) -> np.ndarray:
        """Question, threshold and children in a row, as the kernel walks them: float32 (nodes, 7), two int32."""
        nodes = np.empty((len(self.offsets), 7), dtype=np.float32)
        nodes[:, :4], nodes[:, 4] = self.offsets, self.thresholds
        nodes.view(np.int32)[:, 5:] = self.children
        return nodes

    @property
    def knows_rooms(self) -> bool:
        """Whether it was trained on rooms too and can tell people from furniture (`person_probability`)."""
        return self.leaf_person is not None

    def estimate(self, cloud: Cloud, samples: int, unobserved: np.ndarray | None = None) -> JointEstimate:
        """Joints of a cloud from about `samples` of its points, evenly spread in scan order.

        `unobserved` bool (H, W), where it is known, are the pixels of the cloud's image that say nothing about the
        person: something nearer hides what is there. The image's border needs no mention.
        """
        rows = cloud.spread_rows(samples)
        depth = cloud.depth if unobserved is None else marked(cloud.depth, unobserved, -1.0)
        leaves = self._leaves(depth, cloud.camera.intrinsics, cloud.rotation, cloud.pixels[rows])
        found = self.judged(*self._votes(cloud.points[rows], leaves))
        return replace(found, person=float(self._person(leaves).mean())) if self.knows_rooms and len(rows) else found

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
        return self._votes(points, self._leaves(depth, intrinsics, rotation, pixels))

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

        Raises
        ------
        DatabaseError
            The forest knows no rooms: it was trained before they were part of its views.
        """
        if not self.knows_rooms:
            raise DatabaseError(
                "the joint regressor of this database was not trained on rooms and cannot tell people from furniture; "
                "build the database again with `depthmocap database build`"
            )
        return self._person(self._leaves(depth, intrinsics, rotation, pixels))

    def _leaves(
        self, depth: np.ndarray, intrinsics: np.ndarray, rotation: np.ndarray, pixels: np.ndarray
    ) -> np.ndarray:
        """Leaf of every pixel in every tree, int64 (N, trees)."""
        leaves = np.empty((len(pixels), len(self.roots)), dtype=np.int64)
        blind = forest.REACH if self.leaf_in_view is None else -forest.REACH
        forest.find_leaves(forest.View(depth, intrinsics, rotation, blind), pixels, self.nodes, self.roots, leaves)
        return leaves

    def _votes(self, points: np.ndarray, leaves: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        joints = np.empty((len(skeleton.REPORTED), 3))
        confidence, evidence = np.empty((2, len(skeleton.REPORTED)))
        forest.vote(
            points, leaves, self.leaf_offsets, OFFSET_UNIT, self.leaf_sureness, self._shares_in_view, _WEIGHTS,
            _LOG_ODDS, VOTERS, BANDWIDTH, ROUNDS, joints, confidence, evidence,
        )  # fmt: skip
        return joints, confidence, evidence

    def _person(self, leaves: np.ndarray) -> np.ndarray:
        odds = self._person_log_odds[leaves].mean(axis=1)
        if self.person_odds is not None:
            odds = self.person_odds[0] + self.person_odds[1] * odds
        return np.asarray(1.0 / (1.0 + np.exp(-odds)))

    def judged(self, joints: np.ndarray, confidence: np.ndarray, evidence: np.ndarray) -> JointEstimate:
        """What `votes` returned, with the probabilities that it stands for."""
        odds = evidence
        if self.in_view_odds is not None:
            odds = self.in_view_odds[:, 0] + self.in_view_odds[:, 1] * evidence
        reliability = confidence.copy()
        if self.calibration is not None:
            knots = np.linspace(0.0, 1.0, self.calibration.shape[1])
            reliability = np.array(
                [np.interp(c, knots, row) for c, row in zip(confidence, self.calibration, strict=True)]
            )
        return JointEstimate(joints, confidence, 1.0 / (1.0 + np.exp(-odds)), reliability)

    @cached_property
    def _person_log_odds(self) -> np.ndarray:
        """float64 (leaves,): of a forest that knows rooms."""
        return np.asarray(_LOG_ODDS[self.leaf_person])

    @cached_property
    def _shares_in_view(self) -> np.ndarray:
        return np.full_like(self.leaf_sureness, 255) if self.leaf_in_view is None else self.leaf_in_view
