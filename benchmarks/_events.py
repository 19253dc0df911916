"""Live motion events: a part of `depthmocap bench annotation`."""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures, show
from tests.support.labelled import SEQUENCES, class_clips, perform
from toolkit.retrieval.annotation.annotator import Annotator
from toolkit.retrieval.annotation.measures import Scores, Segment, segment_scores
from toolkit.retrieval.annotation.online import HOLD, Event, OnlineAnnotator
from toolkit.retrieval.annotation.preselection import preselect_in
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import relational_features
from toolkit.retrieval.keyframes.query_file import load_queries
from toolkit.retrieval.workflow.learn import learn_templates


def told_events(parser: argparse.ArgumentParser) -> None:
    """Learn, annotate online, compare, print, write JSON."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--threshold", type=float, default=0.06)
    parser.add_argument("--queries", type=Path, help="keyframes of `depthmocap learn`, for both")
    options = parser.parse_args()
    queries = load_queries(options.queries) if options.queries else ()
    learned = learn_templates(class_clips(options.split))
    classes = [replace(c, threshold=options.threshold) for c in learned]
    whole = live = Scores(0, 0, 0, 0)
    delays: list[float] = []
    spent, frames = 0.0, 0
    for sequence in SEQUENCES:
        done = perform(sequence, options.split, filler=True)
        clip = done.clip
        features = relational_features(from_poses(clip.poses, done.body, clip.frame_rate, clip.name))
        intervals = preselect_in([features], queries, tuple(c.label for c in classes))[0] if queries else None
        whole += segment_scores(done.segments, Annotator(classes).annotate(features, intervals).segments)
        annotator = OnlineAnnotator(classes, done.body, clip.frame_rate, queries)
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
        "precision and recall, live": [live.precision, live.recall],
        "delay s, median": float(np.median(known)) if len(known) else None,
        "delay s, 90 %": float(np.quantile(known, 0.9)) if len(known) else None,
        "ms of processor per frame": 1000 * spent / frames,
        "frames": frames,
    }
    show(figures)
    name = "_".join(["events", *["tune"] * (options.split == "tune"), *["keyframes"] * bool(queries)])
    print("written:", save_figures(name, figures, {"threshold": options.threshold, "hold": HOLD}))


def _delay(event: Event, truth: tuple[Segment, ...]) -> float:
    """Return the delay from the end of the matching true motion to the event, seconds; NaN without one."""
    own = [s for s in truth if s.label == event.label and s.start < event.end and event.start < s.end]
    return event.time - own[-1].end if own else float("nan")
