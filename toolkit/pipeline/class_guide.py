"""Class priors while a recording is tracked: live labels say what a hidden limb probably does (thesis 6, 9; causal)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from toolkit.body.body import Body
from toolkit.errors import RetrievalError, SettingsError
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.online import FeatureStream
from toolkit.retrieval.features.relational import FEATURE_RATE, pack
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.expectation import ExpectationSettings, Told, fill
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limbs import ENTRIES, LIMBS, OUTER
from toolkit.retrieval.priors.live import Going, LiveAlignment
from toolkit.track import TRACKED, FrameResult
from toolkit.tracking.guide import NoGuide


@dataclass(frozen=True)
class ClassGuideSettings:
    """How classes guide a tracker.

    Attributes
    ----------
    threshold : largest cost of the beginning of a template
    hidden : mean confidence of a limb's outer joints below which it is hidden
    remembered : frames before the present one that are looked at
    """

    threshold: float = 0.1
    hidden: float = 0.78
    remembered: int = 60
    expectation: ExpectationSettings = field(default_factory=ExpectationSettings)

    def __post_init__(self) -> None:
        if not 0.0 < self.threshold <= 1.0 or self.remembered < 2:
            raise SettingsError(
                f"a guide needs a threshold in (0, 1] and at least 2 frames, not {self.threshold} and {self.remembered}"
            )


class ClassGuide(NoGuide):
    """Proposes limbs that were hidden in the frame before, while the motion bears a label; see `Guide`, `RowWatcher`.

    It proposes and does not pull: nothing but the frame tells a right label from a wrong one before the limb is seen
    again, and a prior that pulled led hidden limbs away, from 78 to 106 mm on four sequences of the tuning split.

    Parameters
    ----------
    classes : with motions
    settings : see `ClassGuideSettings`

    Raises
    ------
    RetrievalError
        No class has a motion.
    """

    proposes = True

    def __init__(self, classes: Sequence[MotionClass], settings: ClassGuideSettings | None = None) -> None:
        if not any(c.motions for c in classes):
            raise RetrievalError(
                "the class file holds no class motions; learn the classes again with `depthmocap annotate --templates`"
            )
        self._classes, self._settings = tuple(classes), settings or ClassGuideSettings()
        self.begin(30.0, None, np.empty(0))

    def begin(self, frame_rate: float, body: Body | None, past: np.ndarray) -> None:
        """See `RowWatcher.begin`."""
        self._rate = frame_rate
        self._alignment = LiveAlignment(self._classes, self._settings.threshold)
        self._features: FeatureStream | None = None
        self._rows: list[tuple[np.ndarray, np.ndarray, float, Going | None]] = []
        for row in past if body is not None else ():
            self._push(row["pose"], row["confidence"], int(row["state"]), float(row["timestamps"]), body)

    def row(self, result: FrameResult, timestamp: float, body: Body) -> None:
        """See `RowWatcher.row`."""
        self._push(result.pose, result.confidence, result.state, timestamp, body)

    def end(self) -> None:
        """See `RowWatcher.end`."""

    def poses(self, timestamp: float, pose: np.ndarray) -> Sequence[np.ndarray]:
        """See `Guide.poses`: each hidden limb as it is expected."""
        found = []
        for limb, angles in self.expected(timestamp).items():
            moved = pose.copy()
            moved[ENTRIES[limb]] = angles
            found.append(moved)
        return found

    def _push(self, pose: np.ndarray, confidence: np.ndarray, state: int, time: float, body: Body | None) -> None:
        if state != TRACKED or body is None:
            self._rows = []
            return
        if self._features is None:
            self._features = FeatureStream(body, self._rate)
        going = None
        for values, column_time in self._features.push(pose, time):
            going = self._alignment.push(pack(values[:, None])[0])
            if going is not None:
                # Features look ahead, so that columns come late: the motion has gone on since.
                going = self._ahead(going, time - column_time)
        self._rows = [*self._rows[1 - self._settings.remembered :], (pose, confidence, time, going)]

    def _ahead(self, going: Going, seconds: float) -> Going | None:
        """The same `seconds` later; None where the template is over by then."""
        column = going.column + round(seconds * FEATURE_RATE)
        motions = self._classes[going.label].motions
        return going._replace(column=column) if motions and column < len(motions[going.template]) else None

    def expected(self, timestamp: float) -> dict[str, np.ndarray]:
        """Limb -> its angles (A,), radians, as expected in the next frame; limbs that were hidden in the last one."""
        if not self._rows or self._rows[-1][3] is None:
            return {}
        settings = self._settings
        confidence = np.array([row[1] for row in self._rows])
        hidden = {limb: confidence[:, OUTER[limb]].mean(axis=1) < settings.hidden for limb in LIMBS}
        gone = [limb for limb in LIMBS if hidden[limb][-1]]
        if not gone:
            return {}
        told = self._told(timestamp, hidden)
        found = {}
        for limb in gone:
            if told.allocation.label[-1] < 0:
                continue
            seen = np.flatnonzero(~told.hidden[limb])
            start = int(seen[-1]) + 1 if len(seen) else 0
            way, _ = fill(told, Gap(limb, start, len(told.times)), settings.expectation)
            found[limb] = way.mean[-1]
        return found

    def _told(self, timestamp: float, hidden: dict[str, np.ndarray]) -> Told:
        """The last frames and the next one, in which all but the time goes on."""
        last = self._rows[-1][3]
        assert last is not None  # asked before
        goings = [row[3] for row in self._rows]
        coming = self._ahead(last, timestamp - self._rows[-1][2])
        allocation = Allocation.nothing(len(goings) + 1)
        for place, going in enumerate([*goings, coming]):
            if going is not None and (going.label, going.template) == (last.label, last.template):
                allocation.label[place], allocation.template[place] = going.label, going.template
                allocation.column[place], allocation.cost[place] = going.column, going.cost
                allocation.stretch[place] = 0
        return Told(
            np.array([*(row[0] for row in self._rows), self._rows[-1][0]]),
            np.array([*(row[2] for row in self._rows), timestamp]),
            {limb: np.append(flags, flags[-1]) for limb, flags in hidden.items()},
            allocation, self._classes,
        )  # fmt: skip
