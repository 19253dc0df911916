"""Find motions: label a folder of mocap from a few example clips, and search for motions similar to a part of a clip.

    python examples/07_find_motions.py [EXAMPLES MOTIONS]

EXAMPLES is a folder of cut clips named by class, such as kick_01.bvh; MOTIONS a folder of motions to label. The
defaults are made from bundled motions. Writes output/motions.index, output/motions.npz and output/labels/.
"""

import sys
from pathlib import Path

import numpy as np

from toolkit.body.shape import load_body
from toolkit.mocap.procedural import procedural_clips
from toolkit.output.export.bvh import export_bvh
from toolkit.retrieval.search.example import search_example
from toolkit.retrieval.workflow.annotate import annotate_motions
from toolkit.retrieval.workflow.index import index_motions
from toolkit.retrieval.workflow.learn import learn_model
from toolkit.retrieval.workflow.motions import find_motions, tags_of
from toolkit.retrieval.workflow.search_files import cut_example

OUTPUT = Path("output")


def main() -> None:
    examples, motions = map(Path, sys.argv[1:3]) if len(sys.argv) > 2 else make_mocap()

    # Search by example: the most similar segments of all indexed motions.
    index = index_motions([motions], OUTPUT / "motions.index")
    clip = find_motions([examples])[0]
    for match in search_example(index, cut_example(clip, 0.0, 1.0), limit=5):
        print(f"like {clip.stem}: {match.document} {match.start:.1f} to {match.end:.1f} s, cost {match.cost:.3f}")

    # A model of all classes, then each motion segmented and labelled with a page.
    learned = learn_model(
        tags_of(find_motions([examples])), OUTPUT / "motions.npz", np.random.default_rng(0), check=False
    )
    print("classes:", ", ".join(learned.model.labels))
    for done in annotate_motions([motions], learned.model, OUTPUT / "labels"):
        found = ", ".join(f"{s.label} {s.start:.1f}-{s.end:.1f} s" for s in done.annotation.segments)
        print(f"{done.folder.name}: {found or 'nothing'}")


def make_mocap() -> tuple[Path, Path]:
    """Return three example clips, and other performances of these motions."""
    names, body = ("squat", "jumping_jack", "kick_front"), load_body("neutral")
    folders = OUTPUT / "clips", OUTPUT / "mocap"
    for seed, folder in enumerate(folders, start=1):
        for name, clip in zip(names, procedural_clips(names, variations=1, seed=seed), strict=True):
            export_bvh(folder / f"{name}_{seed}.bvh", body, clip.poses, clip.frame_rate)
    return folders


if __name__ == "__main__":
    main()
