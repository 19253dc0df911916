"""Learning of motion models, template classes and keyframe queries from clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.io.errors import RigError
from toolkit.io.files import check_output
from toolkit.io.progress import Progress, silent
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.classes import learn_classes, save_classes
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.annotation.training import CutClip, HeldOutScores, alike, leave_one_out, train
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.keyframes.query import save_queries
from toolkit.retrieval.learning.queries import LearnedQuery, LearningSettings, learn, training_clips
from toolkit.retrieval.workflow.motions import Tag, find_motions, load_motion, load_poses


def learn_queries(
    clips: Mapping[Path, str],
    output: str | Path,
    rng: np.random.Generator,
    *,
    labels: Sequence[str] | None,
    others: Sequence[str | Path],
    settings: LearningSettings,
    alternatives: int,
    tight: bool,
    workers: int,
    progress: Progress,
) -> dict[str, LearnedQuery]:
    """Learn keyframe queries for motion classes and write them as one file.

    Parameters
    ----------
    clips : cut clip -> its class
    output : the query file (JSON)
    rng : source of all randomness
    labels : classes to learn; None = all
    others : clips and folders of clips that belong to no class
    settings : settings of the learning
    alternatives : queries written per class, the best first
    tight : write those with tightened distances (`LearnedQuery.tight`)
    workers : number of processes, without effect on the result
    progress : callback for the number of genetic runs done
    """
    check_output(output, [*clips, *others])
    motions: dict[str, list[Motion]] = {label: [] for label in sorted(set(clips.values()))}
    for file, label in clips.items():
        motions[label].append(load_motion(file))
    classes, checks = training_clips(motions, settings)
    more = [relational_features(load_motion(file)) for file in find_motions(others)]
    learned = learn(
        classes, settings, rng, labels=labels, others=more, checks=checks, workers=workers, progress=progress
    )
    save_queries(output, [query for result in learned.values() for query in result.alternatives(alternatives, tight)])
    return learned


@dataclass(frozen=True, eq=False)
class LearnedModel:
    """Motion model with its expected scores.

    Attributes
    ----------
    model : written model
    left_out : scores of each person with a model of the others
    alike : pairs of similar classes (`training.alike`)
    clips : number of clips per class
    people : all performers; one name if none is named
    """

    model: MotionModel
    left_out: list[HeldOutScores]
    alike: list[tuple[str, str, float]]
    clips: dict[str, int]
    people: tuple[str, ...]


def learn_model(
    clips: Mapping[Path, Tag],
    output: str | Path | None,
    rng: np.random.Generator,
    *,
    others: Sequence[str | Path] = (),
    check: bool = True,
    progress: Progress = silent,
) -> LearnedModel:
    """Learn a motion model from cut clips, write it, and evaluate it on held-out people.

    Parameters
    ----------
    clips : cut clip -> its class and performer
    output : the model file (NPZ); None writes nothing
    rng : source of all randomness
    others : clips, folders of clips: motions of no class
    check : evaluate on each person in turn; without it `left_out` is empty
    progress : callback with the operation, the steps done, and their total
    """
    if output is not None:
        check_output(output, [*clips, *others])
    read = []
    for number, (file, tag) in enumerate(clips.items(), start=1):
        read.append(CutClip(load_motion(file), tag.label, tag.person))
        progress("reading clips", number, len(clips))
    more = [load_motion(file) for file in find_motions(others)]
    left_out = leave_one_out(read, more, rng, progress) if check else []
    model = train(read, more, rng, progress)
    if output is not None:
        model.save(output)
    counts = {label: sum(clip.label == label for clip in read) for label in model.labels}
    return LearnedModel(model, left_out, alike(read), counts, tuple(sorted({clip.person for clip in read})))


def learn_templates(
    clips: Mapping[Path, str], output: str | Path | None = None, progress: Progress = silent
) -> list[MotionClass]:
    """Learn template classes from cut clips, with their mean motion, and write them.

    Parameters
    ----------
    clips : cut clip -> its class
    output : the class file (NPZ); None writes nothing
    progress : callback for the number of clips done
    """
    if output is not None:
        check_output(output, list(clips))
    matrices: dict[str, list[FeatureMatrix]] = {}
    poses: dict[str, list[np.ndarray]] = {}
    unposed: set[str] = set()
    for number, (path, label) in enumerate(clips.items(), start=1):
        matrices.setdefault(label, []).append(relational_features(load_motion(path)))
        try:
            poses.setdefault(label, []).append(load_poses(path))
        except RigError:  # without a joint map a class has no mean motion
            unposed.add(label)
        progress("learning classes", number, len(clips))
    poses = {label: found for label, found in poses.items() if label not in unposed}
    classes = learn_classes(matrices, poses=poses)
    if output is not None:
        save_classes(output, classes)
    return classes
