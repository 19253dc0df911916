"""Image sizes of depth cameras and their usual intrinsics."""

from __future__ import annotations

USUAL_LENSES: dict[tuple[int, int], tuple[tuple[str, tuple[float, float, float, float]], ...]] = {
    (512, 424): (("Kinect v2", (365.5, 365.5, 255.5, 211.5)),),
    (640, 576): (("Azure Kinect, narrow", (504.0, 504.0, 319.5, 287.5)),),
    (320, 288): (("Azure Kinect, narrow, binned", (252.0, 252.0, 159.5, 143.5)),),
    (1024, 1024): (("Azure Kinect, wide", (504.0, 504.0, 511.5, 511.5)),),
    (512, 512): (("Azure Kinect, wide, binned", (252.0, 252.0, 255.5, 255.5)),),
    (640, 480): (
        ("Kinect v1", (575.8, 575.8, 319.5, 239.5)),
        ("RealSense D435", (385.0, 385.0, 319.5, 239.5)),
    ),
    (320, 240): (("Kinect v1", (287.9, 287.9, 159.5, 119.5)),),
    (848, 480): (("RealSense D435", (424.0, 424.0, 423.5, 239.5)),),
    (1280, 720): (("RealSense D435", (640.0, 640.0, 639.5, 359.5)),),
    (256, 192): (("iPhone or iPad", (212.0, 212.0, 127.5, 95.5)),),
    (176, 144): (("SwissRanger", (220.0, 220.0, 87.5, 71.5)),),
}
"""Width and height -> camera and fx, fy, cx, cy in pixels, by the makers' fields of view; good to a few percent."""


def size_of_centre(cx: float, cy: float) -> tuple[int, int] | None:
    """Return the image size (width, height) whose centre is at a principal point, in pixels; None if there is none."""

    def distance(size: tuple[int, int]) -> float:
        return max(abs(cx - (size[0] - 1) / 2) / size[0], abs(cy - (size[1] - 1) / 2) / size[1])

    # Sizes of colour images, whose intrinsics are taken for those of the depth by mistake.
    other_sizes = ((424, 240), (640, 360), (960, 540), (1280, 960), (1280, 1024), (1920, 1080), (1920, 1440))
    nearest = min([*USUAL_LENSES, *other_sizes], key=distance)
    centre_tolerance = 0.04  # share of width and height by which the principal points of cameras of one size differ
    return nearest if distance(nearest) <= centre_tolerance else None
