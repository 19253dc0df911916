"""Live motion events: a part of `depthmocap bench annotation`."""

import argparse
import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks._record import benchmark
from benchmarks._rows import SPLIT
from tests.support.labelled import SEQUENCES, class_clips, perform
from toolkit.retrieval.annotation.annotator import Annotator
from toolkit.retrieval.annotation.measures import Scores, Segment, segment_scores
from toolkit.retrieval.annotation.online import Event, OnlineAnnotator
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import relational_features
from toolkit.retrieval.workflow.learn import learn_templates


@benchmark(SPLIT, threshold=0.06)
def live_events(options: argparse.Namespace) -> tuple[str, Any]:
    """Annotate the sequences during tracking and as a whole, and compare."""
    learned = learn_templates(class_clips(options.split))
    classes = [replace(c, threshold=options.threshold) for c in learned]
    whole = live = Scores(0, 0, 0, 0)
    delays: list[float] = []
    spent, frames = 0.0, 0
    for sequence in SEQUENCES:
        done = perform(sequence, options.split, filler=True)
        clip = done.clip
        features = relational_features(from_poses(clip.poses, done.body, clip.frame_rate, clip.name))
        whole += segment_scores(done.segments, Annotator(classes).annotate(features).segments)
        annotator = OnlineAnnotator(classes, done.body, clip.frame_rate)
        start, events = time.process_time(), list[Event]()
        for pose, moment in zip(clip.poses, clip.timestamps, strict=True):
            events += annotator.push(pose, float(moment))
        spent, frames = spent + time.process_time() - start, frames + len(clip)
        events += annotator.finish()
        found = [Segment(e.start, e.end, e.label) for e in events]
        live += segment_scores(done.segments, found)
        delays += [_delay(event, done.segments) for event in events]
    known = np.array([delay for delay in delays if np.isfinite(delay)])
    figures: dict[str, Any] = {
        "F segments, whole": whole.f,
        "F segments, live": live.f,
        "delay s, median": float(np.median(known)) if len(known) else None,
        "delay s, 90 %": float(np.quantile(known, 0.9)) if len(known) else None,
        "ms of processor per frame": 1000 * spent / frames,
    }
    return "events" + "_tune" * (options.split == "tune"), figures


def _delay(event: Event, truth: tuple[Segment, ...]) -> float:
    """Return the delay from the end of the matching true motion to the event, seconds; NaN without one."""
    own = [s for s in truth if s.label == event.label and s.start < event.end and event.start < s.end]
    return event.time - own[-1].end if own else float("nan")
