"""Export as GLB (binary glTF 2.0): a skinned, animated mesh per person, for Blender, Unity and browsers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.skeleton import REPORTED
from toolkit.io.files import atomic_path
from toolkit.output.export.tree import OWN, JointTree, tree_of
from toolkit.tracks.runs import Person

COMPONENTS = {"<f4": 5126, "<u2": 5123, "<u4": 5125, "|u1": 5121}
SHAPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (16,): "MAT4"}


def export_glb(
    path: str | Path,
    people: Sequence[Person],
    *,
    rig: str = OWN,
    colors: Sequence[np.ndarray] | None = None,
    notes: dict[str, Any] | None = None,
) -> None:
    """Write tracks as one binary glTF 2.0 scene: y up, metres (the people's frame), one animation for each person.

    Each person is a mesh of their own shape, skinned to joints named by `rig`, with one key per frame at the frame's
    time. glTF's linear blend skinning is that of the body, so vertices agree with `Body.vertex_positions` within single
    precision. The person's node holds the confidence as custom properties (`extras`). In frames without the person the
    scale is 0 and the nearest pose is held.

    Parameters
    ----------
    path : the file, written whole or not at all
    people : at least one
    rig : joint names, see `tree.tree_of`
    colors : for each person RGB of each vertex, (V, 3) in [0, 255]; None for one skin colour
    notes : stored in the `extras` of the file's `asset`, see `run.notes_of`

    Raises
    ------
    RigError
        The rig is unknown.
    OutputError
        The file cannot be written.
    """
    skin = (0.80, 0.66, 0.56, 1.0)  # default base colour, linear RGBA
    scene = GlbDocument(skin if colors is None else (1.0, 1.0, 1.0, 1.0))
    scene.document["animations"] = []
    start = min(float(person.track.timestamps[0]) for person in people)
    for k, person in enumerate(people):
        tree = tree_of(person.body, rig)
        top = _add_joints(scene, tree, person)
        _add_mesh(scene, person, tree, top, None if colors is None else colors[k])
        _add_motion(scene, person, tree, top, start)
    if notes is not None:
        scene.document["asset"]["extras"] = notes
    scene.save(path)


class GlbDocument:
    """A glTF document and its buffer under construction."""

    def __init__(self, color: Sequence[float]) -> None:
        roughness = 0.8
        surface = {"baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": roughness}
        self._blocks: list[bytes] = []
        self._length = 0
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "depthmocap"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "skins": [],
            "materials": [{"name": "skin", "pbrMetallicRoughness": surface}],
            "accessors": [],
            "bufferViews": [],
        }

    def accessor(self, values: np.ndarray, dtype: str, *, target: int | None = None, bounds: bool = False) -> int:
        """Append an array to the buffer and return its accessor index."""
        array = np.ascontiguousarray(values, dtype=dtype)
        data = array.tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        accessor: dict[str, Any] = {
            "bufferView": self.add("bufferViews", view),
            "componentType": COMPONENTS[dtype],
            "count": len(array),
            "type": SHAPES[array.shape[1:]],
        }
        if bounds:
            low, high = array.min(axis=0), array.max(axis=0)
            accessor |= {"min": np.atleast_1d(low).tolist(), "max": np.atleast_1d(high).tolist()}
        padding = -len(data) % 4
        self._blocks.append(data + bytes(padding))
        self._length += len(data) + padding
        return self.add("accessors", accessor)

    def add(self, kind: str, value: dict[str, Any]) -> int:
        """Append to a list of the document and return the index."""
        self.document[kind].append(value)
        return len(self.document[kind]) - 1

    def save(self, path: str | Path) -> None:
        """Write header, JSON chunk and binary chunk."""
        self.document["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self.document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._length
        numbers = np.array([0x46546C67, 2, total, len(text), 0x4E4F534A], dtype="<u4")
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            stream.write(numbers.tobytes() + text)
            stream.write(np.array([self._length, 0x004E4942], dtype="<u4").tobytes() + b"".join(self._blocks))


def _add_joints(scene: GlbDocument, tree: JointTree, person: Person) -> int:
    """Add the node of a person, with the confidence, and those of the joints after it; return the first one's index."""
    top = len(scene.document["nodes"])
    scene.add("nodes", {"name": person.name, "children": [top + 1], "extras": _confidence(person)})
    scene.document["scenes"][0]["nodes"].append(top)
    for i, joint in enumerate(tree.names):
        children = [top + 1 + int(child) for child in np.flatnonzero(tree.parents == i)]
        node: dict[str, Any] = {"name": joint, "translation": tree.offsets[i].tolist()}
        scene.add("nodes", node | ({"children": children} if children else {}))
    return top


def _confidence(person: Person) -> dict[str, Any]:
    """Return custom properties of a person: mean confidence of each frame and of each joint, 0 to 1."""
    confidence = np.asarray(person.track.confidence, dtype=np.float64)
    there = confidence[person.there] if person.there.any() else np.zeros((1, confidence.shape[1]))
    joints = {
        f"confidence_{name}": round(float(value), 3) for name, value in zip(REPORTED, there.mean(axis=0), strict=True)
    }
    return {"confidence": np.round(confidence.mean(axis=1), 3).tolist(), **joints}


def _add_mesh(scene: GlbDocument, person: Person, tree: JointTree, top: int, colors: np.ndarray | None) -> None:
    body = person.body
    joints, weights = skinning(body, tree)
    inverse = np.tile(np.eye(4), (len(tree.names), 1, 1))
    inverse[:, 3, :3] = -tree.rest  # matrices are stored in column-major order
    vertex_data, index_data = 34962, 34963  # targets of buffer views: ARRAY_BUFFER and ELEMENT_ARRAY_BUFFER
    attributes = {
        "POSITION": scene.accessor(body.vertices, "<f4", target=vertex_data, bounds=True),
        "NORMAL": scene.accessor(body.normals, "<f4", target=vertex_data),
        "JOINTS_0": scene.accessor(joints, "|u1", target=vertex_data),
        "WEIGHTS_0": scene.accessor(weights, "<f4", target=vertex_data),
    }
    if colors is not None:
        linear = (np.asarray(colors, dtype=np.float64) / 255.0) ** 2.2
        attributes["COLOR_0"] = scene.accessor(linear, "<f4", target=vertex_data)
    wide = "<u4" if len(body.vertices) > 65534 else "<u2"
    indices = scene.accessor(body.faces.ravel(), wide, target=index_data)
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    mesh = scene.add("meshes", {"name": person.name, "primitives": [primitive]})
    matrices = scene.accessor(inverse.reshape(-1, 16), "<f4")
    joint_nodes = list(range(top + 1, top + 1 + len(tree.names)))
    skin = {"inverseBindMatrices": matrices, "skeleton": top + 1, "joints": joint_nodes}
    number = scene.add("nodes", {"name": f"{person.name}_body", "mesh": mesh, "skin": scene.add("skins", skin)})
    scene.document["scenes"][0]["nodes"].append(number)


def skinning(body: Body, tree: JointTree) -> tuple[np.ndarray, np.ndarray]:
    """Return joint indices within the tree and weights, (V, 4): the largest weights, each joint once per vertex."""
    place = np.zeros(len(skeleton.JOINTS), dtype=np.int64)
    place[tree.turns[tree.turns >= 0]] = np.flatnonzero(tree.turns >= 0)
    dense = np.zeros((len(body.vertices), len(tree.names)))
    rows = np.arange(len(dense))
    for slot in range(body.skin_joints.shape[1]):
        dense[rows, place[body.skin_joints[:, slot]]] += body.skin_weights[:, slot]
    influences = 4  # number of joints per vertex that each reader of the format supports
    joints = np.argsort(-dense, axis=1, kind="stable")[:, :influences]
    weights = np.take_along_axis(dense, joints, axis=1).astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.where(weights > 0, joints, 0), weights


def _add_motion(scene: GlbDocument, person: Person, tree: JointTree, top: int, start: float) -> None:
    animation: dict[str, Any] = {"name": person.name, "samplers": [], "channels": []}
    scene.add("animations", animation)
    times = (person.track.timestamps - start).astype(np.float32)
    keys = np.flatnonzero(np.diff(times, prepend=np.float32(-1.0)) > 0)  # the format requires increasing times
    clock = scene.accessor(times[keys], "<f4", bounds=True)
    poses = skeleton.check_pose(person.held_poses)[keys]

    def channel(node: int, path: str, values: np.ndarray, interpolation: str = "LINEAR") -> None:
        sampler = {"input": clock, "output": scene.accessor(values, "<f4"), "interpolation": interpolation}
        animation["samplers"].append(sampler)
        target = {"node": node, "path": path}
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})

    channel(top + 1, "translation", poses[:, skeleton.ROOT_POSITION] + tree.offsets[0])
    turning = np.flatnonzero(tree.turns >= 0)
    turned = quaternions(tree.vectors(poses)[:, turning])
    for k, i in enumerate(turning):
        channel(top + 1 + int(i), "rotation", turned[:, k])
    there = person.there[keys]
    if not there.all():
        channel(top, "scale", np.repeat(there[:, None], 3, axis=1), "STEP")


def quaternions(vectors: np.ndarray) -> np.ndarray:
    """Return unit quaternions (T, N, 4), x y z w, of rotation vectors (T, N, 3), without sign flips over time."""
    from scipy.spatial.transform import Rotation

    out = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat().reshape(*vectors.shape[:2], 4)
    flips = (out[1:] * out[:-1]).sum(axis=2) < 0
    out[1:][np.cumsum(flips, axis=0) % 2 == 1] *= -1.0
    return np.asarray(out)
