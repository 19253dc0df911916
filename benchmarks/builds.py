"""Does every build come to its end? `depthmocap bench builds [--collections 40]`.

Small collections of motion files are drawn by seed from all mocap at hand, as somebody's own would be: one to five
files, mirrored or not, with the bundled seated motions or without, sampled finely or coarsely, on adults or children.
Each is built to its end with a small joint regressor, is read back, and its regressor is asked. A failure is a row with
its reason, and the exit code 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from database_builder.build import build_database
from database_builder.regressor import RegressorSettings
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.mocap.read import find_clips
from toolkit.testing.suite import MOCAP

FOLDERS = (MOCAP, MOCAP.with_name("mocap_more"))
MOST_FILES = 5
BODIES = ("neutral", "slim_male", "heavy_female", "child")
SMALL = RegressorSettings(images=150, pixels=60, trees=2, depth=10, questions=40, calibration=150)


def main() -> None:
    """Draw and build all collections, print a line for each and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mocap", type=Path, nargs="*", default=FOLDERS, help="folders of motion files")
    parser.add_argument("--collections", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    files = [path for folder in options.mocap for path in find_clips(folder)]
    rows = []
    for number in range(options.collections):
        rows.append(built(files, np.random.default_rng([options.seed, number])))
        print(f"{number:3d} " + " ".join(f"{name}={value}" for name, value in rows[-1].items()), flush=True)
    failed = [row for row in rows if row["failure"]]
    figures = {"collections": len(rows), "failed": len(failed), "builds": rows}
    print(save_figures("builds", figures, {**vars(options), "mocap": [path.name for path in options.mocap]}))
    print(f"{len(failed)} of {len(rows)} builds failed")
    sys.exit(1 if failed else 0)


def built(files: list[Path], rng: np.random.Generator) -> dict[str, Any]:
    """Facts about the build of one collection of `files`; its reason in `failure` where it did not come to its end."""
    chosen = [files[k] for k in np.sort(rng.choice(len(files), rng.integers(1, MOST_FILES + 1), replace=False))]
    body, threshold = str(rng.choice(BODIES)), float(rng.uniform(0.009, 0.03))
    mirror, seated = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    row = {"files": [path.name for path in chosen], "body": body, "mirror": mirror, "seated": seated}
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "poses.npz"
        try:
            build_database(
                chosen, output, threshold=threshold, body=load_body(body), mirror=mirror, seated=seated, parts=SMALL,
                workers=1,
            )  # fmt: skip
            database = PoseDatabase.load(output)
            whole = database.regressor is not None and database.regressor.calibration is not None
            failure = "" if whole else "the joint regressor is not there or not calibrated"
            row |= {"poses": len(database), "megabytes": round(output.stat().st_size / 1e6, 2)}
        except Exception as error:  # whatever ends a build is what is looked for
            failure = f"{type(error).__name__}: {error}"
    return {**row, "seconds": round(time.perf_counter() - start, 1), "failure": failure}


if __name__ == "__main__":
    main()
