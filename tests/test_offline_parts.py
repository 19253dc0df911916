"""Parts that only whole commands exercised: seated motions, occluders, the ground, expected limbs, colours, reports."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.app.stabilise.demands import DISAGREEMENT
from toolkit.app.stabilise.retrack import GapGuide
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.evaluation.orientations import RunCheck
from toolkit.fitting.priors import LimbPrior
from toolkit.inertial.calibration import Calibration, Mounting
from toolkit.inertial.distance import Distances, WrongStretch
from toolkit.motion.contact import ground_of
from toolkit.retrieval.priors.bridge import Bridge
from toolkit.retrieval.priors.gap_trajectories import KEPT, PRIOR_SPREAD, GapWays
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limb_entries import ENTRIES
from toolkit.tracks import LOST, TRACKED

BODY = load_body("neutral")
STANDING_HIPS = -float(BODY.vertices[:, 1].min())

# Seated motions.


# What stands before people.


# The ground under people.


def somebody(height: float | None, *, feet: bool = True, there: bool = True, state: int = TRACKED) -> Any:
    poses = np.zeros((30, skeleton.POSE_SIZE))
    poses[:, 1] = 0.2
    track = SimpleNamespace(
        pose=poses,
        timestamps=np.arange(30) / 30,
        state=np.full(30, state),
        observed=np.full((30, len(skeleton.REPORTED)), feet),
    )
    return SimpleNamespace(camera_height=height, track=track, body=BODY, there=np.full(30, there))


def test_the_ground_is_where_the_camera_saw_it_else_where_feet_rest_else_guessed() -> None:
    below = 0.2 - STANDING_HIPS
    assert ground_of([somebody(None), somebody(1.3)]) == (-1.3, "seen by the camera")
    height, how = ground_of([somebody(None)])
    assert height == pytest.approx(below, abs=0.02) and how == "where the feet rest"
    for person in (somebody(None, feet=False), somebody(None, state=LOST)):
        height, how = ground_of([person])
        assert height == pytest.approx(below, abs=0.02) and how == "guessed"
    assert ground_of([somebody(None, feet=False, there=False)]) == (0.0, "guessed")


# What is expected of hidden limbs while a recording is tracked again.


def test_a_prior_holds_hidden_frames_only_and_gives_way_to_the_whole_pose_in_bad_ones() -> None:
    times = np.arange(10) / 30
    entries = ENTRIES["left_arm"]
    gap, hidden = Gap("left_arm", 2, 7), np.array([False, True, True, True, False])
    mean = np.arange(5.0)[:, None] + np.zeros(len(entries))
    way = GapWays(gap, hidden, Bridge(mean, np.full_like(mean, 0.04)), (KEPT,), np.zeros((1, *mean.shape)))
    whole: Any = {4: object()}
    marked = {5: [SimpleNamespace(violation=lambda pose: 0.2), SimpleNamespace(violation=lambda pose: 0.1)]}
    guide = GapGuide([way], whole, times, marked)  # type: ignore[arg-type]
    priors = [guide.priors(float(time)) for time in times]
    assert [len(terms) for terms in priors] == [0, 0, 0, 1, 1, 3, 0, 0, 0, 0]
    first = priors[3][0]
    assert isinstance(first, LimbPrior) and first.entries is entries
    assert first.mean.tolist() == mean[1].tolist()
    np.testing.assert_allclose(first.variance, 0.04 + PRIOR_SPREAD**2)
    assert priors[4][0] is whole[4]
    pose = np.zeros(skeleton.POSE_SIZE)
    assert guide.contradicts(float(times[5]), pose) == pytest.approx(0.3 * DISAGREEMENT)
    assert guide.contradicts(float(times[4]), pose) == 0.0


# Colours of simulated people.


# A check by inertial sensors as files.


@pytest.fixture
def check() -> RunCheck:
    times = np.arange(60) / 30
    full = np.where((times > 0.5) & (times < 1.0), 60.0, 5.0)
    full[0] = np.nan
    curves = (Distances("left_shin", times, full, full / 2), Distances("head", times, np.full(60, 4.0), np.zeros(60)))
    errors = (WrongStretch("left_shin", 0.5333, 0.9667, 60.0, 58.5, "orientation"),)
    sensors = {"left_shin": Mounting((1.0, 0.0, 0.0, 0.0), "weak", reason="<hardly moves>")}
    return RunCheck("a <run>", Calibration("robust", "shared", sensors, {}), curves, errors)


# What a track is compared with.


# A track of rows in memory.


# What a build keeps.
