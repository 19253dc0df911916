"""Classes that propose hidden limbs while scenes are tracked: `depthmocap bench class_priors [--split report]`.

The scenes of one person (`toolkit/testing/scenes.py`: from the waist up, seated, behind furniture), tracked as they are
and as `depthmocap track --classes FILE --priors` does, with classes of the actors who are not in the split: mean error
of the joints that are seen, and of those that are not, and which share of the latter lies within 100 mm.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._options import add_database_options, poses_of
from benchmarks._record import save_figures
from toolkit.errors import DepthMocapError
from toolkit.evaluation.joints import NEAR
from toolkit.evaluation.scenes import score_scene
from toolkit.pipeline import load_tracker, track_recording
from toolkit.pipeline.class_guide import ClassGuide
from toolkit.recordings.opening import open_recording
from toolkit.retrieval.workflow.annotate import classes_from_clips
from toolkit.testing.casting import LONGEST
from toolkit.testing.labelled import class_clips
from toolkit.testing.scenes import chosen_scenes, record_scene
from toolkit.track import Track

SCENES = ("waist", "seated", "behind")


def tracked(path: Path, database: Path, guide: ClassGuide | None, run: Path, segment: str) -> list[float] | None:
    """Millimetres of seen and of hidden joints, and the share of the hidden ones within 100 mm; None if nobody was
    found."""
    shutil.rmtree(run, ignore_errors=True)
    recording = open_recording(path)
    tracker = load_tracker(
        overrides={"sensing.segment": segment, "sensing.subject": "nearest"}, database=database, guide=guide
    )
    try:
        track_recording(recording, tracker, run, warm_up=False, watcher=guide)
    except DepthMocapError as error:
        print(f"{path.stem}: {error}")
        return None
    score = score_scene(recording, [Track.load(run)])
    seen, hidden = score.errors[score.seen], score.errors[~score.seen & np.isfinite(score.errors)]
    return [1000 * float(seen.mean()), 1000 * float(hidden.mean()), float((hidden < NEAR).mean())]


def main() -> None:
    """Track twice, compare, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--groups", default=",".join(SCENES), help="comma-separated, out of: " + ", ".join(SCENES))
    parser.add_argument("--frames", type=int, default=LONGEST, help="at most so many frames of each scene")
    add_database_options(parser)
    options = parser.parse_args()
    database, classes = poses_of(options), classes_from_clips(class_clips(options.split))
    rows: dict[str, Any] = {}
    for scene in chosen_scenes(options.split, tuple(options.groups.split(","))):
        path = record_scene(scene, options.work, options.frames)
        run = options.work / "class_priors" / path.stem
        segment = "person" if scene.view == "room" else "auto"
        plain = tracked(path, database, None, run, segment)
        told = tracked(path, database, ClassGuide(classes), run, segment)
        if plain is None or told is None:
            continue
        rows[path.stem] = {"motion": scene.actors[0].motion, "group": scene.group, "alone": plain, "classes": told}
        print(
            path.stem, scene.actors[0].motion, *(f"{v:.1f}" if v > 1 else f"{v:.2f}" for v in plain + told), flush=True
        )
    figures: dict[str, Any] = {"scenes": rows}
    for group in (*options.groups.split(","), "all"):
        own = [row for row in rows.values() if group in ("all", row["group"])]
        for kind in ("alone", "classes"):
            figures[f"{group}, {kind}"] = np.mean([row[kind] for row in own], axis=0).tolist() if own else []
            print(f"{group}, {kind}: seen mm, hidden mm, within 100 mm:", figures[f"{group}, {kind}"])
    name = f"class_priors_{options.split}"
    print("written:", save_figures(name, figures, {"groups": options.groups, "frames": options.frames}))


if __name__ == "__main__":
    main()
