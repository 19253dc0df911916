"""Fixtures that all tests share."""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import typer.main
from filelock import FileLock
from hypothesis import settings

from toolkit.datasets.folder import VARIABLE
from toolkit.datasets.folder import data_folder as datasets_folder
from toolkit.datasets.registry import data_set_of

QUICK = frozenset({
    "test_config", "test_database_canonical", "test_database_query", "test_files", "test_fitting_parts",
    "test_kernels_linear", "test_kernels_planes", "test_sensing_camera", "test_sensing_parts",
    "test_track", "test_tracking_follower", "test_tracking_lookup", "test_tracking_observation",
    "test_tracking_planning", "test_tracking_search", "test_tracking_smoothing",
})  # fmt: skip
"""Modules whose tests need under a second each; slow parts are replaced by fakes."""
LONGEST = (
    "test_stabilising", "test_same_tracks", "test_inertial_workflow", "test_demo", "test_tour",
    "test_tracking_passes", "test_pipeline_batch", "test_tracking_hybrid", "test_people", "test_bad_input",
    "test_tracking_particles", "test_database_builder", "test_damaged_files",
    "test_retrieval_search_files", "test_interrupted_writes", "test_real_workflow",
)  # fmt: skip
"""Modules with the longest tests, longest first. They start first so that no worker ends with one alone."""
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # threads of BLAS would compete with the other test worker
settings.register_profile("suite", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("suite")


@cache
def _absent(names: tuple[str, ...]) -> str | None:
    """Return the sentence that names the missing data sets and the command that fetches them; None if all are
    present.
    """
    folder = datasets_folder()
    missing = [name for name in names if not data_set_of(name).is_present(folder)]
    return f"needs data sets: depthmocap data fetch {' '.join(missing)}" if missing else None


def pytest_configure() -> None:
    """Reject a `DEPTHMOCAP_DATA` that is no folder; all tests with data would be skipped."""
    if (named := os.environ.get(VARIABLE)) and not Path(named).is_dir():
        raise pytest.UsageError(f"{VARIABLE} names {named}, which is no folder")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of `make quick`, and put the longest modules first."""
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path.stem, len(LONGEST)))
    for item in items:
        if (marker := item.get_closest_marker("data")) is not None and (absent := _absent(marker.args)):
            item.add_marker(pytest.mark.skip(reason=absent))
        if item.path.stem in QUICK and item.get_closest_marker("data") is None:
            item.add_marker(pytest.mark.quick)


@pytest.fixture(scope="session", autouse=True)
def done_once_or_not_at_all() -> Iterator[None]:
    """Skip `fsync`, and build the command line's parser once instead of in each call."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


@pytest.fixture(scope="session")
def bundled_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a database of 800 poses of the bundled motions; made once for all workers."""
    from database_builder.build import Sampling, build_database

    own = tmp_path_factory.getbasetemp()
    folder = own.parent if os.environ.get("PYTEST_XDIST_WORKER") else own
    path = folder / "bundled_poses.npz"
    with FileLock(folder / "bundled_poses.lock"):
        if not path.exists():
            build_database(None, path, Sampling(max_poses=800), workers=1)
    return path


@pytest.fixture(scope="session")
def cut_recordings(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of two recordings of UTD-MHAD with their skeletons, the first 24 frames of each."""
    from scipy.io import loadmat, savemat

    folder = tmp_path_factory.mktemp("utd_mhad")
    for name in ("a1_s1_t1", "a3_s3_t1"):
        for kind, key in (("depth", "d_depth"), ("skeleton", "d_skel")):
            file = f"{name}_{kind}.mat"
            savemat(folder / file, {key: loadmat(data_folder / "depth" / "utd_mhad" / file)[key][..., :24]})
    return folder


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Return the data folder; the marker `data` of a test names the data sets that it needs."""
    return datasets_folder()
