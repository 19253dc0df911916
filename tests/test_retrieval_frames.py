"""Features of single frames and alignments of all templates at once: compiled against plain references."""

from __future__ import annotations

import numpy as np
import pytest

from tests.plain_relations import plain_quantities
from tests.test_retrieval_online import body, classes, document
from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.online import CausalAlignments
from toolkit.retrieval.features.frames import FrameFeatures
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion, from_poses
from toolkit.retrieval.features.relational import FEATURES, native_features, quantities_of, relational_features


@pytest.mark.parametrize("rate", (30.0, 55.0, 8.0))
@pytest.mark.parametrize("frames", (1, 2, 12))
def test_every_quantity_of_a_frame_is_that_of_the_whole_motion(rate, frames):
    rng = np.random.default_rng(frames)
    motion = Motion("any", rng.normal(size=(frames, len(NAMED_JOINTS), 3)), rate, rng.normal(size=(frames, 3)))
    whole, single = plain_quantities(motion), FrameFeatures(body(), rate)
    np.testing.assert_allclose(quantities_of(motion), whole, rtol=1e-9, atol=1e-6)
    for frame in range(frames):
        found = single.quantities(motion.joints, motion.root_axis, frame)
        np.testing.assert_allclose(found, whole[:, frame], rtol=1e-9, atol=1e-6)


def test_features_pushed_frame_by_frame_have_the_hysteresis_of_the_whole():
    motion = from_poses(document(), body(), 30.0, "whole")
    single, on = FrameFeatures(body(), 30.0), np.zeros(len(FEATURES), dtype=bool)
    single.measure(motion.joints[0])
    whole = native_features(motion)[0]
    for frame in range(len(motion)):
        single.push(motion.joints, motion.root_axis, frame, on)
        np.testing.assert_array_equal(on, whole[:, frame])


def test_alignments_of_all_templates_are_those_of_each():
    words = relational_features(from_poses(document(), body(), 30.0, "whole")).words
    together = CausalAlignments(classes())
    each = [c.template for c in classes()]
    state = [(np.full((3, len(t)), np.inf), np.full((3, len(t)), -1)) for t in each]
    for column, word in enumerate(words):
        together.push(word)
        for template, (costs, starts) in zip(each, state, strict=True):
            dtw.push_column(*template.packed, word, column, costs, starts)
        np.testing.assert_array_equal(together.costs, np.concatenate([c[column % 3] for c, _ in state]))
        np.testing.assert_array_equal(together.starts, np.concatenate([s[column % 3] for _, s in state]))
        costs, starts = together.whole()
        assert costs.tolist() == [c[column % 3, -1] for c, _ in state]
        assert starts.tolist() == [s[column % 3, -1] for _, s in state]
