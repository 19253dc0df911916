"""A command gives the same track to the bit on each processor, in each folder and environment."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.database_helpers import small_database
from toolkit.io.files import sha256_of

DECIDING = ("kernels", "sensing", "people", "landmarks", "fitting", "tracking", "trackers", "database")
"""Packages whose sums can change a choice between hypotheses."""
BLAS = re.compile(r"np\.(dot|vdot|inner|matmul|tensordot|cov|linalg\.\w+)")
SCRIPTS = Path(__file__).parents[1] / "scripts"


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the scripts importable and leave the number of linear algebra threads unset."""
    monkeypatch.setattr(sys, "path", [str(SCRIPTS), *sys.path])
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")


@pytest.mark.data("desk")
def test_a_recording_that_begins_badly_has_one_track_in_every_environment(
    data_folder: Path, tmp_path: Path, scripts: None
) -> None:
    from same_tracks import environments
    from track_digests import track

    with np.load(data_folder / "depth" / "repro" / "desk.npz") as desk:
        few = {name: desk[name][:3] if name in ("depth", "timestamps") else desk[name] for name in desk.files}
    np.savez(tmp_path / "desk.npz", **few)
    small_database().save(tmp_path / "poses.npz")
    (tmp_path / "elsewhere").mkdir()
    options = ("--set", "shape.seconds=0.02", "--set", "restarts=1")
    found = [
        track(
            tmp_path / "desk.npz", options, tmp_path / "poses.npz", tmp_path / f"run_{number}",
            environment=environment, folder=folder,
        )
        for number, (environment, folder) in enumerate(environments(3, [tmp_path, tmp_path / "elsewhere"]))
    ]  # fmt: skip
    assert "pose" in found[0]
    assert all(digests == found[0] for digests in found)


BUILD = """
import sys
from database_builder.build import Sampling, build_database
from toolkit.body.shape import load_body
from toolkit.mocap.procedural import procedural_clips
clips = procedural_clips(("walk", "seated_chair"), 3.0, body=load_body("neutral"))
build_database(clips, sys.argv[1], Sampling(seated=False), workers=1)
"""
"""Build of a small database with all parts."""


def test_a_database_has_the_same_bytes_by_the_linear_algebra_of_every_processor(tmp_path: Path, scripts: None) -> None:
    from same_tracks import environments

    digests = set()
    for number, (environment, _) in enumerate(environments(2, [tmp_path])):
        target = tmp_path / f"{number}.npz"
        subprocess.run([sys.executable, "-c", BUILD, target], env={**os.environ, **environment}, check=True)
        digests.add(sha256_of(target))
    assert len(digests) == 1


def test_no_sum_of_blas_or_lapack_decides() -> None:
    """Their last bits depend on the processor; NumPy's norms along an axis do not use BLAS."""
    found = []
    root = SCRIPTS.parent
    folders = [root / "database_builder", *(root / "toolkit" / package for package in DECIDING)]
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            product = isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult)
            called = isinstance(node, ast.Call) and BLAS.fullmatch(ast.unparse(node.func))
            along_axis = isinstance(node, ast.Call) and any(keyword.arg == "axis" for keyword in node.keywords)
            if product or (called and not along_axis):
                found.append(f"{path.relative_to(root)}:{node.lineno}: {ast.unparse(node)}")
    assert not found, "use toolkit.kernels.linear"
