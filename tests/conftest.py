"""Fixtures that every room's tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

QUICK = frozenset({
    "test_config", "test_configs", "test_database_canonical", "test_database_query", "test_files", "test_fitting_parts",
    "test_kernels_linear", "test_kernels_planes", "test_mutants", "test_sensing_camera", "test_track",
    "test_tracking_follower", "test_tracking_lookup", "test_tracking_observation", "test_tracking_search",
    "test_tracking_smoothing",
})  # fmt: skip
"""Modules whose tests answer at once: the heart, with parts made up where they would be slow."""
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what `make quick` runs."""
    for item in items:
        if item.path.stem in QUICK and item.get_closest_marker("shared_data") is None:
            item.add_marker(pytest.mark.quick)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings and mocap beside the project; tests that ask for it are skipped where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the shared data folder ../shared/data is absent")
    return SHARED_DATA
