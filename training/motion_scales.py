"""Print the constants of graded motion features: the tables of `toolkit/retrieval/features/grades.py` and `places.py`.

    python -m training.motion_scales DATA

DATA is the data folder (`depthmocap data where`). The motions are those of HDM05 actors bd and bk, and of CMU subjects
up to 8.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks._keyframe_corpus import halves, load_examples, load_filler
from toolkit.retrieval.features.grades import SCALES, grade
from toolkit.retrieval.features.motion import SIDES
from toolkit.retrieval.features.places import places_of, spread
from toolkit.retrieval.features.relational import FEATURES, native_features

LEFT_OUT = "dg"
"""Actor of the reported examples."""
MEANINGS = [feature.meaning.split() for feature in FEATURES]
PARTNER = {"left": "right", "right": "left"}
MIRROR = [MEANINGS.index([PARTNER.get(word, word) for word in meaning]) for meaning in MEANINGS]
"""Row of each feature's mirror image."""


def main() -> None:
    """Print scales, spreads, and spreads of the limbs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    data = parser.parse_args().data
    chosen = [e.motion for e in load_examples(data) if e.person != LEFT_OUT] + halves(load_filler(data))[0]
    margins = np.concatenate([native_features(motion)[1] for motion in chosen], axis=1)
    low, high = np.percentile(margins, [16, 84], axis=1)
    scales = 0.25 * (high - low + (high - low)[MIRROR])
    spreads = grade(margins * (SCALES / scales)[:, None]).std(axis=1)
    print("scales", *(f"{value:.2g}" for value in scales))
    print("spreads", *(f"{value:.0f}" for value in 0.5 * (spreads + spreads[MIRROR])))
    placed = np.concatenate([places_of(motion, np.arange(len(motion))) for motion in chosen], axis=1)
    print("spreads of limbs", *(f"{value:.0f}" for value in spread(placed).reshape(len(SIDES), -1).mean(axis=0)))


if __name__ == "__main__":
    main()
