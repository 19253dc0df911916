"""Data sets that each benchmark reads."""

from collections.abc import Sequence

from toolkit.datasets.folder import data_folder
from toolkit.datasets.registry import data_set_of
from toolkit.io.errors import DataError

MOCAP = ("cmu-mocap", "hdm05")
NEEDS: dict[str, tuple[str, ...]] = {
    "ablation": (*MOCAP, "rooms"),
    "accuracy": MOCAP,
    "annotation": MOCAP,
    "by_example": (*MOCAP, "utd-mhad"),
    "classifier": MOCAP,
    "feet": MOCAP,
    "confidence": (*MOCAP, "utd-mhad", "msr-action3d"),
    "feet --real": (*MOCAP, "utd-mhad"),
    "gait_opensim": ("opensim",),
    "inertial simulated": MOCAP,
    "joints followed": ("realsense",),
    "keyframes": MOCAP,
    "motion_model": MOCAP,
    "real": ("utd-mhad",),
    "real offsets": ("utd-mhad", "msr-action3d"),
    "real lag": ("utd-mhad", "msr-action3d"),
    "recovery": MOCAP,
    "rooms": ("rooms",),
    "scenes": MOCAP,
    "stabilise": MOCAP,
    "swarm suite": MOCAP,
    "upper track": MOCAP,
    "upper track --real": ("skeltrack", "realsense"),
    "upper speed": ("skeltrack", "realsense"),
}
"""Script, script and part, or these and `--real` -> data sets; benchmarks that are not listed read bundled motions."""


def needed(words: Sequence[str]) -> tuple[str, ...]:
    """Return the data sets of a benchmark as it is typed behind `depthmocap bench`; the longest key decides."""
    part = " ".join(words[:2])
    real = " --real" if "--real" in words else ""
    keys = (part + real, words[0] + real, part, words[0])
    return next((NEEDS[key] for key in keys if key in NEEDS), ())


def check_data(words: Sequence[str]) -> None:
    """Raise DataError with the command that fetches the data sets of a benchmark, if any are missing."""
    folder = data_folder()
    missing = [name for name in needed(words) if not data_set_of(name).is_present(folder)]
    if missing and not {"-h", "--help"} & set(words):
        raise DataError(
            f"the benchmark {words[0]} needs data sets that are not in {folder}; "
            f"type: depthmocap data fetch {' '.join(missing)}"
        )
