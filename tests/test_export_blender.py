"""GLB and BVH files as Blender imports them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.run_helpers import write_run
from tests.support.walking import Walk, walking
from toolkit.body.shape import load_body
from toolkit.io.errors import UsageError
from toolkit.output.export.run import export_run

IMPORT = """
import json, sys
import bpy
glb, bvh = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=glb)
mesh = max((o for o in bpy.data.objects if o.type == "MESH"), key=lambda o: len(o.data.vertices))
bpy.context.scene.frame_set(1)
posed = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
rises = [(posed.matrix_world @ v.co).z for v in posed.data.vertices]
height = max(rises) - min(rises)
found = {"actions": sorted(a.name for a in bpy.data.actions), "height": height,
         "bones": sum(len(a.bones) for a in bpy.data.armatures),
         "confidence": [len(o["confidence"]) for o in bpy.data.objects if "confidence" in o]}
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=bvh)
armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
found["bvh_bones"] = len(armature.data.bones)
bones = armature.data.bones
found["bvh_height"] = max(b.tail_local.z for b in bones) - min(b.head_local.z for b in bones)
print("FOUND" + json.dumps(found))
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    poses, _ = walking(load_body("neutral"), Walk(), 0.5, 30.0)
    return write_run(tmp_path_factory.mktemp("blender") / "run", poses, shape=0.0, rate=30.0)


def test_a_bvh_in_metres_is_a_hundredth_of_one_in_centimetres(run: Path, tmp_path: Path) -> None:
    for unit in ("cm", "m"):
        export_run(run, tmp_path / f"{unit}.bvh", unit=unit)
    offsets = [
        [float(line.split()[2]) for line in (tmp_path / f"{unit}.bvh").read_text().splitlines() if "OFFSET" in line]
        for unit in ("cm", "m")
    ]
    assert offsets[0] == pytest.approx([100 * value for value in offsets[1]], abs=1e-3)
    with pytest.raises(UsageError, match="choose one of cm, m"):
        export_run(run, tmp_path / "in.bvh", unit="inch")
    with pytest.raises(UsageError, match=r"--unit m is for \.bvh"):
        export_run(run, tmp_path / "motion.glb", unit="m")


def test_blender_imports_both(run: Path, tmp_path: Path) -> None:
    pytest.importorskip("bpy", reason="needs Blender's Python module: pip install bpy")
    export_run(run, tmp_path / "motion.glb")
    export_run(run, tmp_path / "motion.bvh", unit="m")
    command = [sys.executable, "-c", IMPORT, str(tmp_path / "motion.glb"), str(tmp_path / "motion.bvh")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(next(line[5:] for line in done.stdout.splitlines() if line.startswith("FOUND")))
    assert any("run" in name for name in found["actions"]) and found["confidence"] == [15]
    assert 1.4 < found["height"] < 2.1 and found["bones"] >= 18
    assert 1.2 < found["bvh_height"] < 2.1 and found["bvh_bones"] >= 18
