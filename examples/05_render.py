"""Draw a track: a film, a contact sheet and one picture.

    python examples/05_render.py [RUN]

Needs output/run of example 03. Writes output/film.webm, output/contact_sheet.png and output/fitted_depth.png.
"""

import sys
from pathlib import Path

import numpy as np

from toolkit.output.rendering.film import render_run, save_png
from toolkit.simulation.raycast import render_depth
from toolkit.tracks import RunInfo, Track

OUTPUT = Path("output")


def main() -> None:
    run = Path(sys.argv[1]) if len(sys.argv) > 1 else OUTPUT / "run"

    # The suffix selects the kind of output. The recording and the body are found through the run folder.
    print(render_run(run, OUTPUT / "film.webm"))
    print(render_run(run, OUTPUT / "contact_sheet.png"))

    # The body can also be drawn directly: here the depth of the fitted body in the last frame.
    info, track = RunInfo.load(run), Track.load(run)
    camera = info.open_recording().camera.undistorted()
    depth = render_depth(info.body(), track.pose[-1], camera, info.R_level_camera)
    near, far = depth[depth > 0].min(), depth.max()
    grey = np.where(depth > 0, 255 - 200 * (depth - near) / (far - near), 0).astype(np.uint8)
    save_png(OUTPUT / "fitted_depth.png", np.repeat(grey[..., None], 3, axis=2))
    print(OUTPUT / "fitted_depth.png")


if __name__ == "__main__":
    main()
