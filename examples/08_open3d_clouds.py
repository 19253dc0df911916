"""From a list of Open3D point clouds to a film of the tracked body.

    python examples/08_open3d_clouds.py

Needs output/poses.npz of example 01 and output/take.npz of example 02, whose frames are made into clouds. Writes
output/clouds.webm.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d

import depthmocap
from toolkit.output.rendering.film import render_people
from toolkit.output.rendering.open3d_geometry import cloud_geometry

OUTPUT = Path("output")
FRAMES = 12
NEAR_ROOM = 0.08  # metres within which a point belongs to the empty room


def main() -> None:
    take = depthmocap.open_recording(OUTPUT / "take.npz")
    camera = o3d.camera.PinholeCameraIntrinsic(take.camera.width, take.camera.height, *take.camera.intrinsics)

    # The clouds: points in the frame of the camera, metres, in any order. Open3D's kd-tree removes the empty room.
    assert take.background is not None
    room = cloud_geometry(take.background, take.camera)
    clouds: list[o3d.geometry.PointCloud] = []
    for i in range(FRAMES):
        measured = cloud_geometry(take.depth(i), take.camera)
        away = np.asarray(measured.compute_point_cloud_distance(room)) > NEAR_ROOM
        clouds.append(measured.select_by_index(np.flatnonzero(away)))
    print(f"{FRAMES} clouds, {len(clouds[0].points)} points in the first one")

    # The list is tracked like a recording. Without intrinsics the points are projected into a virtual camera.
    track = depthmocap.track(
        clouds,
        intrinsics=camera,
        timestamps=take.timestamps[:FRAMES],
        up_camera=take.up_camera,
        database=OUTPUT / "poses.npz",
        settings={"passes": 1, "shape.seconds": 0.0, "sensing.segment": "segmented"},
    )
    print(track)

    # A frame as geometry of Open3D: open3d.visualization.draw([cloud, mesh, skeleton]) shows it in a window.
    cloud, mesh, skeleton = track.to_open3d(FRAMES - 1)
    print(f"frame {FRAMES - 1}: {cloud}, {mesh}, {skeleton}")
    print(render_people([track.person], track.recording, OUTPUT / "clouds.webm"))


if __name__ == "__main__":
    main()
