"""A musculoskeletal model of OpenSim: scaled to the person, with virtual markers, solved by inverse kinematics.

The virtual markers lie on the fitted body: on each segment one at its proximal joint and two on its axes, as the
segments of the model have them in its neutral pose. Ground is X forwards of a person who faces the camera, Y up, Z to
their right.
"""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body.body import Body
from toolkit.body.skeleton import POSE_SIZE, REPORTED
from toolkit.io.errors import OutputError, UsageError, optional_package
from toolkit.io.files import save_json
from toolkit.motion.angles import ISB_AXES, segment_rotations
from toolkit.output.export.tables import export_mot, export_trc, write_trc
from toolkit.tracks.runs import Person

logger = logging.getLogger(__name__)

WEIGHTS = {"pelvis": 10.0, "torso": 0.1, "humerus": 0.1, "ulna": 0.1, "hand": 0.1}
"""Weights of markers by body, 1 for legs: the models' trunk has one joint, ours three, and pulls at the pelvis."""


@dataclass(frozen=True)
class ScaledSegment:
    """A body of the model and the segment of ours that it follows.

    Attributes
    ----------
    body : body of the model, without its side
    turns : joint of the skeleton that turns the segment
    start : reported joint at its proximal end
    length : two reported joints, and two bodies of the model at whose origins they lie, which give the scale; none for
        the scale of the stature
    """

    body: str
    turns: str
    start: str
    length: tuple[str, str, str, str] | None = None


SEGMENTS = (
    ScaledSegment("femur", "hip", "hip", ("hip", "knee", "femur", "tibia")),
    ScaledSegment("tibia", "knee", "knee", ("knee", "ankle", "tibia", "talus")),
    ScaledSegment("calcn", "ankle", "ankle"),
    ScaledSegment("humerus", "shoulder", "shoulder", ("shoulder", "elbow", "humerus", "ulna")),
    ScaledSegment("ulna", "elbow", "elbow", ("elbow", "wrist", "ulna", "hand")),
)
"""Segments of each side; a model without arms has no humerus and ulna."""
FOLLOWS = {"talus": "calcn", "toes": "calcn", "patella": "tibia", "radius": "ulna", "hand": "ulna"}
"""Bodies that are scaled as another one."""


def export_opensim(folder: str | Path, person: Person, model: str | Path | None) -> None:
    """Write a person for OpenSim into a folder.

    With a model and the package `opensim`: `markers.trc`, `scaled.osim`, `motion.mot` and `solved.json` with the
    residual (`solve`). Without: `markers.trc` of the joints, `motion.mot` of the generic model and `markers.xml`, and a
    message with the commands that are missing.

    Raises
    ------
    UsageError
        The model cannot be loaded or has no body that is needed.
    OutputError
        A file cannot be written.
    """
    target = Path(folder)
    if model is not None and importlib.util.find_spec("opensim") is not None:
        save_json(target / "solved.json", {"rms_m": solve(person, Path(model), target), "model": Path(model).name})
        return
    export_trc(target / "markers.trc", person)
    export_mot(target / "motion.mot", person)
    logger.warning(
        "no model was scaled: type `pip install 'depthmocap[opensim]'`, then `depthmocap export RUN --format opensim "
        "--model FILE.osim --output FOLDER`; or add motion_markers.xml to your model in OpenSim and scale it by "
        "markers.trc"
    )


def solve(person: Person, model: Path, folder: Path) -> float:
    """Scale a model to a person, place virtual markers on both and solve inverse kinematics.

    Lengths and mass come from the fitted body. `markers.trc`, `scaled.osim` and `motion.mot` are written into `folder`.

    Parameters
    ----------
    model : `.osim` file of the family of Gait 2392 or Rajagopal 2016

    Returns
    -------
    Root mean square distance of the markers after inverse kinematics, metres.

    Raises
    ------
    UsageError
        The package is not installed, or the model cannot be loaded or has no body that is needed.
    OutputError
        A file cannot be written, or inverse kinematics fails.
    """
    opensim = optional_package("opensim", "opensim", "a scaled model")
    opensim.Logger.setLevelString("off")
    opensim.Logger.removeFileSink()  # else it writes opensim.log into the working folder
    try:
        osim = opensim.Model(str(model))
        osim.initSystem()
    except RuntimeError as error:
        raise UsageError(f"{model} cannot be loaded as a model of OpenSim ({error}); give a .osim file") from error
    _neutral(osim)
    origins = _origins(osim)
    if missing := {"pelvis", "torso", "femur_r", "tibia_r", "talus_r", "calcn_r"} - origins.keys():
        raise UsageError(f"{model} has no body {sorted(missing)[0]!r}; give a model like Gait 2392 or Rajagopal 2016")
    _scale(opensim, osim, scale_factors(person, origins), body_mass(person))
    _neutral(osim)
    targets = virtual_markers(person, origins.keys())
    _add_markers(opensim, osim, _origins(osim), neutral_markers(person.body, origins.keys()))
    folder.mkdir(parents=True, exist_ok=True)
    markers, scaled, motion = folder / "markers.trc", folder / "scaled.osim", folder / "motion.mot"
    rows = np.flatnonzero(person.there)
    points = np.stack([own[rows] for own in targets.values()], axis=1)
    write_trc(markers, list(targets), points, person.times[rows], person.frame_rate())
    osim.setName(f"{osim.getName()}_scaled")
    osim.finalizeConnections()
    if not osim.printToXML(str(scaled)):
        raise OutputError(f"cannot write {scaled}; check the folder")
    return _inverse_kinematics(opensim, osim, markers, motion, list(targets), person.times[rows])


def body_mass(person: Person) -> float:
    """Estimate the mass of a person in kilograms: volume of the fitted body times its density."""
    vertices, faces = person.body.vertices, person.body.faces
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    density = 985.0  # kilograms per cubic metre of a human body (Krzywicki and Chinn 1967)
    return float(abs((a * np.cross(b, c)).sum()) / 6.0 * density)


def scale_factors(person: Person, origins: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the factors (3,), X Y Z, of each body of a model, from the origins of its bodies in the neutral pose."""
    joints = person.body.joint_positions(np.zeros(POSE_SIZE))
    at = {name: joints[i] for i, name in enumerate(REPORTED)}

    def ratio(a: str, b: str, first: str, last: str) -> float:
        return float(np.linalg.norm(at[a] - at[b]) / np.linalg.norm(origins[first] - origins[last]))

    factors: dict[str, np.ndarray] = {}
    legs = []
    for side in ("right", "left"):
        for segment in SEGMENTS:
            if segment.length is not None and f"{segment.length[3]}_{side[0]}" in origins:
                start, end, first, last = segment.length
                own = ratio(f"{side}_{start}", f"{side}_{end}", f"{first}_{side[0]}", f"{last}_{side[0]}")
                factors[f"{segment.body}_{side[0]}"] = np.full(3, own)
                legs += [own] if segment.body in ("femur", "tibia") else []
    general = float(np.mean(legs))
    wide = ratio("left_hip", "right_hip", "femur_l", "femur_r")
    factors["pelvis"] = np.array([general, general, wide])
    factors["torso"] = np.full(3, general)
    if "humerus_r" in origins:
        shoulders = ratio("left_shoulder", "right_shoulder", "humerus_l", "humerus_r")
        middle = (origins["humerus_l"] + origins["humerus_r"]) / 2 - (origins["femur_l"] + origins["femur_r"]) / 2
        own = (at["left_shoulder"] + at["right_shoulder"] - at["left_hip"] - at["right_hip"]) / 2
        factors["torso"] = np.array([general, float(np.linalg.norm(own) / np.linalg.norm(middle)), shoulders])
    for name in origins:
        stem, _, side = name.rpartition("_")
        if name not in factors:
            factors[name] = factors.get(f"{FOLLOWS.get(stem, '')}_{side}", np.full(3, general))
    return factors


def virtual_markers(person: Person, bodies: Container[str]) -> dict[str, np.ndarray]:
    """Return virtual markers of the fitted body: `<body>__<o, x or z>` -> float64 (T, 3), metres, ground frame."""
    joints = person.joints_level @ ISB_AXES
    turned = segment_rotations(person.body, person.track.pose)
    return _markers({name: joints[:, i] for i, name in enumerate(REPORTED)}, turned, bodies)


def neutral_markers(body: Body, bodies: Container[str]) -> dict[str, np.ndarray]:
    """Return the same markers, (3,) each, of the body's neutral pose: standing, arms hanging, hips at the origin."""
    pose = np.zeros((1, POSE_SIZE))
    joints = body.joint_positions(pose[0]) @ ISB_AXES
    at = {name: joints[i] for i, name in enumerate(REPORTED)}
    turned = segment_rotations(body, pose)
    middle = (at["left_hip"] + at["right_hip"]) / 2
    neutral = {name: (place - middle)[None] for name, place in at.items()}
    for side in ("right", "left"):
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist")):
            bone = at[f"{side}_{end}"] - at[f"{side}_{start}"]
            neutral[f"{side}_{end}"] = neutral[f"{side}_{start}"] + turned[f"{side}_{start}"][0].T @ bone
    upright = {name: np.eye(3)[None] for name in turned}
    return {name: points[0] for name, points in _markers(neutral, upright, bodies).items()}


def _markers(at: dict[str, np.ndarray], turned: dict[str, np.ndarray], bodies: Container[str]) -> dict[str, np.ndarray]:
    """Place the markers at joints (T, 3) on segments with axes (T, 3, 3)."""
    found: dict[str, np.ndarray] = {}

    # Metres from a joint to the markers on its segment's axes: the size of a rigid marker cluster in gait
    # laboratories.
    arm = 0.10

    def cluster(body: str, origin: np.ndarray, rotation: np.ndarray) -> None:
        found[f"{body}__o"] = origin
        found[f"{body}__x"] = origin + arm * rotation[:, :, 0]
        found[f"{body}__z"] = origin + arm * rotation[:, :, 2]

    cluster("pelvis", (at["left_hip"] + at["right_hip"]) / 2, turned["root"])
    cluster("torso", (at["left_shoulder"] + at["right_shoulder"]) / 2, turned["thorax"])
    for side in ("right", "left"):
        for segment in SEGMENTS:
            body = f"{segment.body}_{side[0]}"
            if body in bodies:
                cluster(body, at[f"{side}_{segment.start}"], turned[f"{side}_{segment.turns}"])
        if f"hand_{side[0]}" in bodies:
            found[f"hand_{side[0]}__o"] = at[f"{side}_wrist"]
    return found


def _neutral(osim: Any) -> None:
    """Set every rotation to zero, in which the axes of all bodies are those of the ground."""
    coordinates = osim.getCoordinateSet()
    for i in range(coordinates.getSize()):
        own = coordinates.get(i)
        if own.getMotionType() == 1:  # a rotation
            own.setDefaultValue(0.0)


def _origins(osim: Any) -> dict[str, np.ndarray]:
    state = osim.initSystem()
    bodies = osim.getBodySet()
    found = {}
    for i in range(bodies.getSize()):
        place = bodies.get(i).getPositionInGround(state)
        found[bodies.get(i).getName()] = np.array([place.get(k) for k in range(3)])
    return found


def _scale(opensim: Any, osim: Any, factors: dict[str, np.ndarray], mass: float) -> None:
    scales = opensim.ScaleSet()
    for name, own in factors.items():
        scale = opensim.Scale()
        scale.setSegmentName(name)
        scale.setScaleFactors(opensim.Vec3(*map(float, own)))
        scale.setApply(True)
        scales.cloneAndAppend(scale)
    osim.scale(osim.initSystem(), scales, True, mass)


def _add_markers(opensim: Any, osim: Any, origins: dict[str, np.ndarray], neutral: dict[str, np.ndarray]) -> None:
    """Place markers on the model as they are on the fitted body, both in the neutral pose with the hips together.

    Angles are then those of the fitted body's segments, although joint centres differ.
    """
    hips = (origins["femur_r"] + origins["femur_l"]) / 2
    osim.updMarkerSet().clearAndDestroy()
    for name, place in neutral.items():
        body = name.partition("__")[0]
        location = opensim.Vec3(*map(float, hips + place - origins[body]))
        osim.addMarker(opensim.Marker(name, osim.getBodySet().get(body), location))
    osim.finalizeConnections()


def _inverse_kinematics(
    opensim: Any, osim: Any, markers: Path, motion: Path, names: list[str], times: np.ndarray
) -> float:
    """Solve and write the motion; return the RMS distance of the markers, metres."""
    tool = opensim.InverseKinematicsTool()
    tool.setModel(osim)
    tool.setMarkerDataFileName(str(markers))
    tool.setStartTime(float(times[0]))
    tool.setEndTime(float(times[-1]))
    tool.setOutputMotionFileName(str(motion))
    tool.setResultsDir(str(motion.parent))
    tasks = tool.getIKTaskSet()
    for name in names:
        task = opensim.IKMarkerTask()
        task.setName(name)
        task.setApply(True)
        task.setWeight(WEIGHTS.get(name.partition("_")[0], 1.0))
        tasks.cloneAndAppend(task)
    tool.set_report_errors(True)
    try:
        solved = tool.run()
    except RuntimeError as error:
        raise OutputError(f"inverse kinematics of OpenSim failed for {markers} ({error}); check the model") from error
    if not solved or not motion.exists():
        raise OutputError(f"inverse kinematics of OpenSim wrote no {motion}; check the model")
    table = opensim.TimeSeriesTable(str(next(motion.parent.glob("*ik_marker_errors.sto"))))
    return float(np.sqrt(np.mean(np.square(table.getDependentColumn("marker_error_RMS").to_numpy()))))
