"""One command gives one track, to the last bit, wherever and on whatever it runs."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.database_helpers import small_database

DECIDING = (
    "kernels",
    "sensing",
    "people",
    "landmarks",
    "fitting",
    "tracking",
    "lopez2011",
    "qammaz",
    "hybrid",
    "database",
)
"""Rooms whose sums can turn a choice between hypotheses."""
BLAS = re.compile(r"np\.(dot|vdot|inner|matmul|tensordot|cov|linalg\.\w+)")
SCRIPTS = Path(__file__).parents[1] / "scripts"


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The scripts can be imported."""
    monkeypatch.setattr(sys, "path", [str(SCRIPTS), *sys.path])


@pytest.mark.shared_data
def test_a_recording_that_begins_badly_has_one_track_in_every_environment(
    shared_data: Path, tmp_path: Path, scripts: None
) -> None:
    from same_tracks import environments
    from track_digests import track

    with np.load(shared_data / "depth" / "repro" / "desk.npz") as desk:
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


def test_no_sum_of_blas_or_lapack_decides() -> None:
    """Their last bits depend on the processor; norms along an axis are sums of NumPy's own."""
    found = []
    toolkit = SCRIPTS.parent / "toolkit"
    for path in sorted(path for room in DECIDING for path in (toolkit / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            product = isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult)
            called = isinstance(node, ast.Call) and BLAS.fullmatch(ast.unparse(node.func))
            along_axis = isinstance(node, ast.Call) and any(keyword.arg == "axis" for keyword in node.keywords)
            if product or (called and not along_axis):
                found.append(f"{path.relative_to(toolkit)}:{node.lineno}: {ast.unparse(node)}")
    assert not found, "use toolkit.kernels.linear"


def test_digests_tell_tracks_apart_by_what_was_found_alone(tmp_path: Path, scripts: None) -> None:
    from track_digests import digests_of

    columns = {"pose": np.zeros((2, 3)), "state": np.zeros(2, dtype=np.uint8), "stage_ms": np.zeros((2, 1))}
    other_times = {**columns, "stage_ms": np.ones((2, 1))}
    other_pose = {**columns, "pose": np.nextafter(columns["pose"], 1.0)}
    found = []
    for number, arrays in enumerate((columns, other_times, other_pose)):
        run = tmp_path / str(number)
        run.mkdir()
        np.savez(run / "track.npz", **arrays)
        found.append(digests_of(run))
    assert found[0] == found[1]
    assert found[0]["state"] == found[2]["state"]
    assert found[0]["pose"] != found[2]["pose"]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_every_processor_is_tried_from_every_folder(count: int, scripts: None) -> None:
    from same_tracks import CORES, environments

    folders = [Path(str(number)) for number in range(count)]
    tried = [(environment["OPENBLAS_CORETYPE"], folder) for environment, folder in environments(3 * count, folders)]
    assert len(set(tried)) == len(CORES) * count
    assert len({folder for _, folder in tried[:3]}) == min(3, count)
