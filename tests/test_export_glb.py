"""A GLB file moves exactly as the toolkit's body, by a second reader; the Khronos validator finds no error."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.run_helpers import write_people, write_run
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.mocap.procedural import perform
from toolkit.output.export.glb import export_glb
from toolkit.output.export.run import export_run
from toolkit.tracks.runs import load_persons

NODE = Path(__file__).parents[1] / "scripts" / "node"
DTYPES = {5126: "<f4", 5123: "<u2", 5125: "<u4", 5121: "|u1"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """Reader of GLB: node matrices by the specification, joint matrices, weighted sums."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, total, length, kind = np.frombuffer(data, "<u4", 5)
        assert (magic, version, total, kind) == (0x46546C67, 2, len(data), 0x4E4F534A)
        self.document = json.loads(data[20 : 20 + length])
        self._binary = data[28 + length :]
        self.channels = {}
        for animation in self.document["animations"]:
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                key = (channel["target"]["node"], channel["target"]["path"])
                self.channels[key] = (self.array(sampler["input"]), self.array(sampler["output"]))

    def array(self, accessor: int) -> np.ndarray:
        row = self.document["accessors"][accessor]
        view, width = self.document["bufferViews"][row["bufferView"]], WIDTHS[row["type"]]
        values = np.frombuffer(self._binary, DTYPES[row["componentType"]], row["count"] * width, view["byteOffset"])
        return values.astype(float).reshape(row["count"], width)

    def matrices(self, frame: int) -> np.ndarray:
        """Return the world matrices (N, 4, 4) of all nodes at a key of the animation."""
        nodes = self.document["nodes"]
        local = np.tile(np.eye(4), (len(nodes), 1, 1))
        for i, node in enumerate(nodes):
            local[i, :3, 3] = node.get("translation", (0, 0, 0))
            for path in ("translation", "rotation", "scale"):
                if (i, path) not in self.channels:
                    continue
                value = self.channels[i, path][1][frame]
                if path == "translation":
                    local[i, :3, 3] = value
                elif path == "rotation":
                    local[i, :3, :3] = Rotation.from_quat(value).as_matrix()
                else:
                    local[i, :3, :3] = local[i, :3, :3] @ np.diag(value)
        world = local.copy()
        parents = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
        for i in range(len(nodes)):
            above = parents.get(i)
            while above is not None:
                world[i] = local[above] @ world[i]
                above = parents.get(above)
        return world

    def vertices(self, mesh: int, frame: int) -> np.ndarray:
        """Return skinned vertices (V, 3) of a mesh."""
        node = next(node for node in self.document["nodes"] if node.get("mesh") == mesh)
        skin = self.document["skins"][node["skin"]]
        inverse = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        joints = self.matrices(frame)[skin["joints"]] @ inverse
        attributes = self.document["meshes"][mesh]["primitives"][0]["attributes"]
        points = np.column_stack([self.array(attributes["POSITION"]), np.ones(self._count(attributes))])
        numbers, weights = self.array(attributes["JOINTS_0"]).astype(int), self.array(attributes["WEIGHTS_0"])
        return np.einsum("vs,vsij,vj->vi", weights, joints[numbers], points)[:, :3]

    def _count(self, attributes: dict[str, int]) -> int:
        return self.document["accessors"][attributes["POSITION"]]["count"]


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    return perform("boxing", load_body()).poses[:8]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, poses: np.ndarray) -> Path:
    return write_people(tmp_path_factory.mktemp("run") / "run", poses)


@pytest.mark.parametrize("rig", [None, "mixamo", "cmu"])
def test_the_mesh_moves_as_the_toolkits_own_skinning_within_a_hundredth_of_a_millimetre(
    run: Path, tmp_path: Path, rig: str | None
) -> None:
    export_run(run, tmp_path / "motion.glb", rig=rig, origin="camera")
    glb = Glb(tmp_path / "motion.glb")
    for k, person in enumerate(load_persons(run)):
        for frame in (1, 4, 7):
            expected = person.body.vertex_positions(person.track.pose[frame])
            np.testing.assert_allclose(glb.vertices(k, frame), expected, atol=1e-5)


def test_every_pose_of_the_joint_limits_is_kept(tmp_path: Path) -> None:
    low, high = np.clip(skeleton.POSE_LIMITS, -3.1, 3.1).T
    poses = np.random.default_rng(2).uniform(low, high, (20, skeleton.POSE_SIZE))
    export_run(write_run(tmp_path / "run", poses), tmp_path / "motion.glb", origin="camera")
    glb, (person,) = Glb(tmp_path / "motion.glb"), load_persons(tmp_path / "run")
    for frame, pose in enumerate(poses):
        np.testing.assert_allclose(glb.vertices(0, frame), person.body.vertex_positions(pose), atol=1e-5)


def test_keys_stand_at_the_frames_own_times_and_neighbours_turn_the_short_way(run: Path, tmp_path: Path) -> None:
    export_run(run, tmp_path / "motion.glb", origin="camera")
    for (_, path), (times, values) in Glb(tmp_path / "motion.glb").channels.items():
        np.testing.assert_allclose(times[:, 0], np.arange(8) / 25.0, atol=1e-6)
        if path == "rotation":
            assert (np.sum(values[1:] * values[:-1], axis=1) > 0).all()


def test_who_is_not_there_has_no_size(run: Path, tmp_path: Path) -> None:
    export_run(run, tmp_path / "motion.glb", origin="camera")
    glb = Glb(tmp_path / "motion.glb")
    assert np.ptp(glb.vertices(1, 0), axis=0).max() == 0
    assert np.ptp(glb.vertices(1, 1)[:, 1]) > 1.0
    assert np.ptp(glb.vertices(0, 0)[:, 1]) > 1.0


def test_frames_of_the_same_time_become_one_key(tmp_path: Path, poses: np.ndarray) -> None:
    export_run(write_run(tmp_path / "run", poses, rate=np.inf), tmp_path / "motion.glb", origin="camera")
    assert {len(times) for times, _ in Glb(tmp_path / "motion.glb").channels.values()} == {1}


def test_joints_of_a_rig_have_its_names_and_hierarchy(run: Path, tmp_path: Path) -> None:
    export_run(run / "person_01", tmp_path / "motion.glb", rig="mixamo", origin="camera")
    nodes = Glb(tmp_path / "motion.glb").document["nodes"]
    spine = next(node for node in nodes if node["name"] == "mixamorig:Spine2")
    children = {nodes[i]["name"] for i in spine["children"]}
    assert children == {"mixamorig:Neck", "mixamorig:LeftShoulder", "mixamorig:RightShoulder"}


def test_the_khronos_validator_finds_nothing(run: Path, tmp_path: Path) -> None:
    if not (shutil.which("node") and (NODE / "node_modules" / "gltf-validator").is_dir()):
        pytest.skip("node or its package gltf-validator is absent; scripts/install_node_packages.sh installs it")
    files = [tmp_path / name for name in ("one.glb", "several.glb", "rig.glb", "colours.glb")]
    export_run(run / "person_01", files[0], origin="camera")
    export_run(run, files[1], origin="camera")
    export_run(run, files[2], rig="mixamo", origin="camera")
    people = load_persons(run)
    export_glb(files[3], people, colors=[np.full(person.body.vertices.shape, 200.0) for person in people])
    answer = subprocess.run(
        ["node", str(NODE / "validate_glb.mjs"), *map(str, files)], capture_output=True, text=True, check=False
    )
    reports = [json.loads(line) for line in answer.stdout.splitlines()]
    assert len(reports) == len(files), answer.stderr
    for report in reports:
        assert [report[key] for key in ("numErrors", "numWarnings", "numInfos", "numHints")] == [0, 0, 0, 0], report
