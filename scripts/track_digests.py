"""Print digests of tracks, which are equal before and after a change without effect.

    python scripts/track_digests.py --database poses.npz [--work FOLDER]

Three recordings are tracked by the command: a simulated one of a bundled motion, a Kinect recording of UTD-MHAD and
frames of a cluttered room with two people. The output is the SHA-256 digest of each column of each `track.npz` but the
times. The simulated recording is made once and kept in the work folder, so that changes of the simulation have no
effect. Tracks of real recordings also depend on the database, whose digest is printed first.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from toolkit.datasets.folder import data_folder

ROOT = Path(__file__).resolve().parents[1]
DEPTH = data_folder() / "depth"
TIMES = ("stage_ms", "stage_names", "checksum")
"""Columns of a track with times instead of results."""

RECORDINGS: dict[str, tuple[Path, tuple[str, ...]]] = {
    "utd_mhad": (DEPTH / "utd_mhad" / "a10_s1_t1_depth.mat", ()),
    "realsense": (DEPTH / "realsense" / "images_n40", ("--segment", "person", "--subject", "nearest")),
}
"""Real recordings by name, with their options."""


def digests_of(run: Path) -> dict[str, str]:
    """Return the SHA-256 digest of each column of a run folder's `track.npz` except `TIMES`."""
    with np.load(run / "track.npz", allow_pickle=False) as track:
        return {name: _digest(track[name]) for name in sorted(track.files) if name not in TIMES}


def track(
    recording: Path,
    options: Sequence[str],
    database: Path,
    run: Path,
    *,
    environment: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> dict[str, str]:
    """Return the digests of the track of `depthmocap track`, run from `folder` with these additional environment
    variables.

    Raises
    ------
    subprocess.CalledProcessError
        The command failed.
    """
    arguments = [recording.resolve(), *options, "--database", database.resolve(), "--output", run.resolve()]
    depthmocap("track", *arguments, environment=environment, folder=folder)
    return digests_of(run)


def depthmocap(*arguments: object, environment: Mapping[str, str] | None = None, folder: Path | None = None) -> None:
    """Run the command of this checkout.

    Raises
    ------
    subprocess.CalledProcessError
        The command failed; its messages are on the standard error.
    """
    subprocess.run(
        [sys.executable, "-m", "toolkit.app.cli.main", *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(ROOT), **(environment or {})},
        cwd=folder,
        stdout=subprocess.DEVNULL,
        check=True,
    )


def simulated(path: Path) -> Path:
    """Return the simulated recording, made if absent: bundled kicks by a person unlike the tracker's body."""
    if not path.exists():
        from toolkit.body.shape import load_body, subject_body
        from toolkit.mocap.procedural import SUBJECT_MOTIONS, procedural_clips
        from toolkit.output.export.bvh import export_bvh
        from toolkit.simulation.simulate import simulate_recording

        clip = procedural_clips(SUBJECT_MOTIONS[:1], variations=1, seed=0)[0]
        export_bvh(path.with_suffix(".bvh"), load_body(), clip.poses, clip.frame_rate)
        simulate_recording(path.with_suffix(".bvh"), path, body=subject_body("slim_male", seed=7), yaw=10.0)
    return path


def _digest(array: np.ndarray) -> str:
    return hashlib.sha256(f"{array.dtype}{array.shape}".encode() + np.ascontiguousarray(array).tobytes()).hexdigest()


def main() -> None:
    """Print the digests."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--database", type=Path, required=True, help="pose database")
    parser.add_argument("--work", type=Path, help="folder of the simulated recording and the run folders")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = options.work or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        recordings = {"simulated": (simulated(work / "simulated.npz"), ()), **RECORDINGS}
        print(f"database {hashlib.sha256(options.database.read_bytes()).hexdigest()}")
        for name, (recording, arguments) in recordings.items():
            with tempfile.TemporaryDirectory(dir=work) as run:
                for column, digest in track(recording, arguments, options.database, Path(run) / "run").items():
                    print(f"{name} {column} {digest}", flush=True)


if __name__ == "__main__":
    main()
