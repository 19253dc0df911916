"""Build a pose database from motion capture, or from the bundled motions.

    python examples/01_build_database.py [MOCAP...]

MOCAP are BVH or AMC files or folders of them. Writes output/poses.npz.
"""

import sys
from pathlib import Path

from database_builder.build import Sampling, build_database
from database_builder.build_report import database_text

OUTPUT = Path("output")


def main() -> None:
    # 1. Each pose is brought into the canonical frame: root at the origin, facing +z. 2. Farthest-first sampling keeps
    # a pose only if no kept pose is nearer than the threshold (Baak 2013, Eq. 5.1). 3. Each kept pose is rendered once,
    # so that its features are relative to the centre that a camera would see.
    report = build_database(
        sys.argv[1:] or None,
        OUTPUT / "poses.npz",
        Sampling(threshold=0.018, max_poses=2000),
        progress=lambda stage, done, total: print(f"\r{stage} {done}/{total}", end="", file=sys.stderr),
    )
    print(file=sys.stderr)
    print(report.text())
    print(database_text(report.database))

    # A lookup: the poses whose five end effectors lie as those of pose 0.
    distances, indices = report.database.query(report.database.features[:1], k=3)
    for distance, index in zip(distances[0], indices[0], strict=True):
        print(f"pose {index} at {1000 * distance:.0f} mm")


if __name__ == "__main__":
    main()
