"""Make `toolkit/database/assets/default.npz`, the default pose database.

    python scripts/make_default_database.py CMU_FOLDER... [--output FILE] [--workers N]

Made of motions of the CMU Graphics Lab (folders `mocap/cmu` and `mocap_more/cmu` of the shared data) and of the bundled
standing, floor and seated ones. Nothing else may go in: the poses travel with the package. The same folders give the
same file to the bit, with the same versions of NumPy, SciPy and scikit-learn, on whichever processors and however many.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from database_builder.build import build_database  # noqa: E402
from toolkit.app.cli.terminal import progress_bars  # noqa: E402
from toolkit.body.shape import load_body  # noqa: E402
from toolkit.database import DEFAULT_DATABASE  # noqa: E402
from toolkit.io.files import sha256_of  # noqa: E402
from toolkit.mocap.procedural import procedural_clips  # noqa: E402

LARGEST = 3e6
"""Maximum size in bytes within the package."""


def main() -> None:
    """Build the database and print its size and SHA-256."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cmu", type=Path, nargs="+", help="folders of CMU motions, BVH and ASF/AMC")
    parser.add_argument("--output", type=Path, default=DEFAULT_DATABASE)
    parser.add_argument("--workers", type=int)
    options = parser.parse_args()
    sources = [*options.cmu, *procedural_clips(body=load_body("neutral"))]
    with progress_bars() as bars:
        report = build_database(sources, options.output, workers=options.workers, progress=bars)
    print(report.text())
    size = options.output.stat().st_size
    print(f"{size / 1e6:.1f} MB, SHA-256 {sha256_of(options.output)}")
    if size > LARGEST:
        sys.exit(f"{options.output} is larger than {LARGEST / 1e6:.0f} MB; raise the threshold")


if __name__ == "__main__":
    main()
