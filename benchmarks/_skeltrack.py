"""Skeltrack over frames, as a program of its own: `python3 _skeltrack.py FRAMES.npz JOINTS.json`.

Skeltrack (LGPL-3) is neither linked nor shipped: this asks the GObject bindings of the Python that runs it, with NumPy
beside them. Exit code 3 and one sentence where they are not installed. See `benchmarks/upper_peer.py` for both files.
"""

import json
import sys

import numpy as np

REDUCTION = 16
"""Pixels of 640x480 that Skeltrack expects to become one."""
NAMES = {
    "head": "HEAD", "left_shoulder": "LEFT_SHOULDER", "right_shoulder": "RIGHT_SHOULDER", "left_elbow": "LEFT_ELBOW",
    "right_elbow": "RIGHT_ELBOW", "left_hand": "LEFT_HAND", "right_hand": "RIGHT_HAND",
}  # fmt: skip


def main() -> None:
    """Read frames, track, write joints in pixels of the frames."""
    try:
        import gi

        gi.require_version("Skeltrack", "0.1")
        from gi.repository import Skeltrack
    except (ImportError, ValueError):
        print("Skeltrack's GObject bindings (gir1.2-skeltrack-0.1) are not installed for this Python", file=sys.stderr)
        sys.exit(3)
    frames = np.load(sys.argv[1], allow_pickle=False)["depth"]
    step = max(1, REDUCTION * frames.shape[2] // 640)
    skeleton = Skeltrack.Skeleton()
    skeleton.set_property("enable-smoothing", False)
    skeleton.set_property("dimension-reduction", step)
    found = []
    for frame in frames:
        small = np.ascontiguousarray(frame[::step, ::step])
        joints = skeleton.track_joints_sync(small.reshape(-1).tolist(), small.shape[1], small.shape[0], None)
        places = {name: joints and joints.get_joint(getattr(Skeltrack.JointId, key)) for name, key in NAMES.items()}
        found.append({name: [place.screen_x, place.screen_y] if place else None for name, place in places.items()})
    with open(sys.argv[2], "w", encoding="utf-8") as out:
        json.dump(found, out)


if __name__ == "__main__":
    main()
