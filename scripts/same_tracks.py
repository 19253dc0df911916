"""Check that tracks are equal to the bit in many environments.

    python scripts/same_tracks.py --database poses.npz [--runs 20] [--set NAME=VALUE] [RECORDING...]

Each recording is tracked by the command with environments of different lengths (which move the stack and all memory),
from different working directories and with the linear algebra of different processors (`OPENBLAS_CORETYPE`). The table
shows the number of different tracks; the exit code is 1 if a recording has more than one. The default recordings have
ambiguous first frames, where the last bit can decide.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from track_digests import DEPTH, track

RECORDINGS: dict[Path, tuple[str, ...]] = {
    DEPTH / "repro" / "desk.npz": (),
    DEPTH / "utd_mhad" / "a10_s1_t1_depth.mat": (),
    DEPTH / "utd_mhad" / "a27_s3_t1_depth.mat": (),
    DEPTH / "realsense" / "images_n40": ("--segment", "person", "--subject", "nearest"),
    DEPTH / "skeltrack": ("--intrinsics", "575,575,320,240", "--subject", "nearest"),
}
CORES = ("Haswell", "Prescott", "SkylakeX")
STEP = 32
"""Growth of the environment from run to run, bytes."""


def environments(runs: int, folders: list[Path]) -> Iterator[tuple[dict[str, str], Path]]:
    """Yield `runs` environments of different lengths, with each processor and folder in turn."""
    for run in range(runs):
        pad = "x" * (STEP * run)
        yield (
            {"PAD": pad, "OPENBLAS_CORETYPE": CORES[run % len(CORES)]},
            folders[(run % len(CORES) + run // len(CORES)) % len(folders)],
        )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "recordings",
        nargs="*",
        type=Path,
        metavar="RECORDING",
        help="default: the data sets repro, utd_mhad, realsense and skeltrack",
    )
    parser.add_argument("--database", type=Path, required=True, help="pose database")
    parser.add_argument("--runs", type=int, default=20, help="environments per recording")
    parser.add_argument("--set", action="append", default=[], help="a setting, as for `depthmocap track`")
    options = parser.parse_args()
    recordings: dict[Path, tuple[str, ...]] = {path: () for path in options.recordings} or RECORDINGS
    settings = [argument for setting in options.set for argument in ("--set", setting)]
    same = True
    print(f"| recording | runs | different tracks |\n|---|{'---:|' * 2}")
    with tempfile.TemporaryDirectory() as temporary:
        folders = [Path(temporary), Path(temporary) / "a", Path(temporary) / ("b" * 100)]
        for folder in folders[1:]:
            folder.mkdir()
        for recording, arguments in recordings.items():
            found: Counter[str] = Counter()
            for number, (environment, folder) in enumerate(environments(options.runs, folders)):
                run = Path(temporary) / "runs" / f"{recording.stem}_{number}"
                digests = track(
                    recording,
                    [*arguments, *settings],
                    options.database,
                    run,
                    environment=environment,
                    folder=folder,
                )
                found[str(digests)] += 1
            same &= len(found) == 1
            print(f"| {recording.name} | {options.runs} | {len(found)} |", flush=True)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
