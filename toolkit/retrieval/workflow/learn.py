"""From clips to learned queries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from toolkit.files import check_output
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import relational_features
from toolkit.retrieval.keyframes.query_file import save_queries
from toolkit.retrieval.learning.queries import LearnedQuery, LearningSettings, Progress, learn, training_clips
from toolkit.retrieval.workflow.motions import find_motions, load_motion


def learn_queries(
    clips: Mapping[Path, str],
    output: str | Path,
    rng: np.random.Generator,
    *,
    labels: Sequence[str] | None = None,
    others: Sequence[str | Path] = (),
    settings: LearningSettings | None = None,
    alternatives: int = 1,
    tight: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> dict[str, LearnedQuery]:
    """Learn keyframe queries for motion classes and write them as one file.

    Parameters
    ----------
    clips : cut clip -> its class
    output : the query file (JSON)
    rng : source of all randomness
    labels : classes to learn; all by default
    others : clips and folders of clips that belong to no class
    settings : how
    alternatives : queries written per class, the best first
    tight : write those with tightened distances (`LearnedQuery.tight`)
    workers : processes; they do not change the result
    progress : told after each genetic run
    """
    check_output(output, [*clips, *others])
    motions: dict[str, list[Motion]] = {label: [] for label in sorted(set(clips.values()))}
    settings = settings or LearningSettings()
    for file, label in clips.items():
        motions[label].append(load_motion(file))
    classes, checks = training_clips(motions, settings)
    more = [relational_features(load_motion(file)) for file in find_motions(others)]
    learned = learn(
        classes, settings, rng, labels=labels, others=more, checks=checks, workers=workers, progress=progress
    )
    save_queries(output, [query for result in learned.values() for query in result.alternatives(alternatives, tight)])
    return learned
