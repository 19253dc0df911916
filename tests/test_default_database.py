"""Pose database of the package: sources and size."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.suite import MOCAP
from toolkit.database import DEFAULT_DATABASE
from toolkit.database.database import PoseDatabase
from toolkit.datasets.registry import digest_of
from toolkit.io.files import sha256_of
from toolkit.mocap.procedural import DATABASE_MOTIONS, SEATED_MOTIONS, SEATED_SUBJECT_MOTIONS, SUBJECT_MOTIONS

ASSETS = DEFAULT_DATABASE.parent


@pytest.fixture(scope="module")
def database() -> PoseDatabase:
    return PoseDatabase.load(DEFAULT_DATABASE)


def test_it_is_small_and_comes_with_its_notice() -> None:
    assert DEFAULT_DATABASE.stat().st_size <= 3e6
    notice = (ASSETS / "LICENSE.md").read_text()
    assert "mocap.cs.cmu.edu" in notice and "NSF EIA-0196217" in notice


def test_it_contains_seated_people_and_its_sources(database: PoseDatabase) -> None:
    assert database.prior is not None
    own = {name.rstrip("_0123456789") for name in database.sources if not name.endswith((".bvh", ".amc"))}
    assert {*DATABASE_MOTIONS, *SEATED_MOTIONS} == own
    assert not own & {*SUBJECT_MOTIONS, *SEATED_SUBJECT_MOTIONS}  # subjects of tests and demo
    assert all(len(digest) == 64 for digest in database.hashes) and len(set(database.hashes)) == len(database.hashes)
    assert len(database) > 5000 and database.body_name == "neutral" and not database.notes["skipped"]


@pytest.mark.data("cmu-mocap", "cmu-mocap-more")
def test_its_mocap_is_that_of_the_listed_cmu_folders_only(database: PoseDatabase) -> None:
    files = [p for folder in ("mocap/cmu", "mocap_more/cmu") for p in (MOCAP.parent / folder).rglob("*.*")]
    known = {path.name: {sha256_of(path), digest_of(path)} for path in files}  # git may convert line ends
    named = {Path(name).name: digest for name, digest in zip(database.sources, database.hashes, strict=True)}
    mocap = {name: digest for name, digest in named.items() if name.endswith((".bvh", ".amc"))}
    assert mocap.keys() == {name for name in known if name.endswith((".bvh", ".amc"))}
    assert all(digest in known[name] for name, digest in mocap.items() if name.endswith(".bvh"))
    counts = np.bincount(database.pose_source, minlength=len(database.sources))
    assert counts.sum() == len(database)
