"""Tracks against real wearable sensors: `depthmocap bench inertial real [--runs FOLDER] [--people 1,5]`.

The 108 recordings of UTD-MHAD carry one sensor each, on the right wrist or the right thigh, without times, north
or a common clock. Per clip: the clock with its ratio by angular speed and acceleration; the correlation of the angular
speeds there, and whether the left limb would fit as well; the full and the axis distance, with the mounting from the
person's other clips, clock and heading from the clip. `--runs` holds the run folders of `depthmocap bench real`;
without it the recordings are tracked first. Needs the data sets `utd_mhad` and `utd_mhad_inertial`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks._rows import add_database_options, make_tracker, poses_of
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import track_recording
from toolkit.database.database import PoseDatabase
from toolkit.datasets.folder import data_folder
from toolkit.inertial.calibrate import CalibrationSequence, CalibrationSettings, calibrate, refined_clock
from toolkit.inertial.distance import distances, worlds_of
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.stream import SensorStream
from toolkit.inertial.synchronise import (
    Clock,
    SignalSettings,
    SyncSettings,
    sensor_signals,
    smoothing_for,
    synchronise,
    track_signals,
)
from toolkit.inertial.workflow import read_sensors
from toolkit.io.errors import InertialError
from toolkit.kernels.motion.inertial import correlation_over_lags
from toolkit.recordings.opening import open_upright

RECORDINGS, SENSORS = data_folder() / "depth" / "utd_mhad", data_folder() / "inertial" / "utd_mhad"
SYNC = SyncSettings(max_offset=0.7, rates=(0.85, 1.35))
"""The recordings lie 49 to 68 ms apart by their own lengths, and the reader says 53."""
SURE = 0.75
"""Correlation of angular speeds from which a clip counts as explained."""
CALIBRATION = CalibrationSettings(heading="own", refuse=False)
"""Whatever the motion determines: single clips are short, the person's clips together are not."""


@dataclass(frozen=True)
class ClipFigures:
    """Figures of one clip: correlations, milliseconds between depth frames by the clock, medians in degrees."""

    clip: str
    limb: str
    correlation: float
    other_side: float
    frame_ms: float
    samples_ms: float
    full: float
    axis: float


def takes_of(runs: Path, sensors: Path, people: Sequence[str]) -> list[CalibrationSequence]:
    """Every clip with its sensor and clock, by name."""
    takes = []
    for run in sorted(runs.iterdir()):
        clip = run.name.removesuffix("_depth")
        if clip.split("_")[1].removeprefix("s") not in people or not (run / "track.npz").exists():
            continue
        measured = read_sensors([sensors / f"{clip}_inertial.mat"])
        motion = TrackedMotion.load(run)
        takes.append(CalibrationSequence(motion, measured, synchronise(motion, measured, SYNC, check=False)))
    return takes


def figures_of_clip(take: CalibrationSequence, others: Sequence[CalibrationSequence]) -> ClipFigures:
    """Figures of a clip with the mounting of the person's other clips."""
    (stream,) = take.sensors
    limb, across = stream.name, stream.name.replace("right_", "left_")
    exchanged = replace(take.sensors, streams=(replace(stream, name=across),))
    wrong = synchronise(take.motion, exchanged, SYNC, check=False)
    full = axis = float("nan")
    try:
        calibration = calibrate(others, CALIBRATION)
        worlds = worlds_of(calibration, take)
        better = refined_clock(take, worlds, {limb: calibration.mounting(limb)})
        (found,) = distances(calibration, better)
        full, axis = float(np.nanmedian(found.full)), float(np.nanmedian(found.axis))
    except InertialError as error:
        print(f"{take.motion.name}: {error}")
    frame = float(np.median(np.diff(take.motion.times)))
    return ClipFigures(
        take.motion.name.removesuffix("_depth"),
        limb,
        speed_correlation(take.motion, stream, take.clock),
        speed_correlation(take.motion, exchanged.streams[0], wrong),
        1000.0 * frame * take.clock.rate,
        1000.0 * float(stream.times[-1]) / (len(take.motion.times) - 1),
        full,
        axis,
    )


def speed_correlation(motion: TrackedMotion, stream: SensorStream, clock: Clock) -> float:
    """Correlation, -1 to 1, of the angular speeds of a sensor and its part of the body at a clock; NaN if unknown."""
    smoothing = smoothing_for(motion, clock.rate)
    tracked = track_signals(motion, stream.name, clock.rate, smoothing)[0]
    measured = sensor_signals(stream, smoothing)[0]
    out = np.empty(1)
    lag = np.array([round((tracked.start + clock.offset - measured.start) / SignalSettings.step)])
    correlation_over_lags(tracked.values, tracked.known, measured.values, measured.known, lag, 10, out)
    return float(out[0])


def summary(clips: Sequence[ClipFigures]) -> dict[str, Any]:
    """The table of the README."""
    wrist = [c for c in clips if c.limb == "right_forearm"]
    thigh = [c for c in clips if c.limb == "right_thigh"]
    sure = [c for c in clips if c.correlation > SURE]
    found: dict[str, Any] = {
        "clips": len(clips),
        "correlation above 0.75": len(sure) / len(clips),
        "right arm beats left": float(np.mean([c.correlation > c.other_side for c in wrist])),
        "right leg beats left": float(np.mean([c.correlation > c.other_side for c in thigh])),
        "frame ms": np.percentile([c.frame_ms for c in sure], [5, 50, 95]).tolist(),
        "frame ms by samples": np.percentile([c.samples_ms for c in clips], [5, 50, 95]).tolist(),
    }
    for name, own in (("wrist", wrist), ("thigh", thigh)):
        found[name] = {key: float(np.nanmedian([getattr(c, key) for c in own])) for key in ("full", "axis")}
    return found


def real(parser: argparse.ArgumentParser) -> None:
    """Track, synchronise, calibrate, compare, print, write JSON."""
    parser.add_argument("data", nargs="?", type=Path, default=SENSORS, help="folder of *_inertial.mat")
    parser.add_argument("--recordings", type=Path, default=RECORDINGS, help="folder of *_depth.mat")
    parser.add_argument("--runs", type=Path, help="run folders of these recordings")
    parser.add_argument("--people", default="1,3,5,7", help="numbers of the people, with commas")
    add_database_options(parser)
    options = parser.parse_args()
    files = sorted(options.data.glob("*_inertial.mat")) if options.data.is_dir() else []
    if not files:
        print(f"skipped: {options.data} holds no *_inertial.mat")
        return
    runs = options.runs or options.work / "runs" / "inertial_real"
    if options.runs is None:
        poses = poses_of(options)
        tracker = make_tracker("hybrid", PoseDatabase.load(poses), parse_overrides(options.set), str(poses))
        names = [file.name.replace("_inertial", "_depth") for file in files]
        for path in (options.recordings / name for name in names):
            if not (runs / path.stem / "track.npz").exists():
                track_recording(open_upright(path), tracker, runs / path.stem)
    takes = takes_of(runs, options.data, options.people.split(","))
    clips = []
    for take in takes:
        person = take.motion.name.split("_")[1]
        others = [
            t for t in takes
            if t is not take and t.motion.name.split("_")[1] == person and t.sensors.names == take.sensors.names
        ]  # fmt: skip
        clips.append(figures_of_clip(take, others))
        print(" ".join(f"{value:.2f}" if isinstance(value, float) else value for value in asdict(clips[-1]).values()))
    table = summary(clips)
    for name, value in table.items():
        print(f"{name}: {value}")
    figures = {"summary": table, "clips": [asdict(clip) for clip in clips]}
    whole = options.people == "1,3,5,7" and len(takes) == len(files)
    print("written:", save_figures("inertial_real" if whole else "inertial_real_part", figures, asdict(SYNC)))
