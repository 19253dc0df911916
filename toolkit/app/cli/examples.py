"""Example command lines for the end of each help screen, by verb."""

from __future__ import annotations

import typer

EXAMPLES: dict[str, tuple[str, ...]] = {
    "demo": ("depthmocap demo --output demo", "depthmocap demo --real --output demo"),
    "data list": ("depthmocap data list", "depthmocap data list hdm05"),
    "data fetch": ("depthmocap data fetch two-people", "depthmocap data fetch cmu-mocap hdm05 --data recordings"),
    "data where": ("depthmocap data where hdm05",),
    "database build": (
        "depthmocap database build --output poses.npz",
        "depthmocap database build mocap/cmu mocap/hdm05 --output poses.npz --max-poses 25000",
    ),
    "database info": ("depthmocap database info poses.npz",),
    "body scan": ("depthmocap body scan front.npz left.npz back.npz right.npz --output me.npz",),
    "info": ("depthmocap info take.npz",),
    "simulate": (
        "depthmocap simulate walk.bvh --output take.npz",
        "depthmocap simulate kick.bvh --body heavy_female --sensor kinect --distance 3 --yaw 45 --output take.npz",
    ),
    "joints": (
        "depthmocap joints --fetch",
        "depthmocap joints take.npz --joints colour --output take_joints.npz",
    ),
    "track": (
        "depthmocap track take.npz --output run",
        "depthmocap track recordings/a.mat recordings/b.mat --database poses.npz --output runs",
        "depthmocap track frames/ --segment person --subject nearest --output run",
        "depthmocap track raw/ --intrinsics 575,575,320,240 --size 640,480 --output run",
    ),
    "live": (
        "depthmocap live realsense --record take.npz --stream udp://127.0.0.1:9000",
        "depthmocap live file:take.npz --people all",
    ),
    "evaluate": (
        "depthmocap evaluate run",
        "depthmocap evaluate runs --reference truth/ --output scores",
    ),
    "render": (
        "depthmocap render run --output run/film.webm",
        "depthmocap render run --output sheet.png --from 100 --to 200",
        "depthmocap render run --output plan.webm --panels depth,plan",
    ),
    "report": (
        "depthmocap report run --output report.html",
        "depthmocap report runs --output report.html --reference truth/",
    ),
    "export": (
        "depthmocap export run --output motion.glb",
        "depthmocap export run --output motion.bvh --rig mixamo",
    ),
    "index": ("depthmocap index mocap/hdm05 --output mocap.index",),
    "search": (
        "depthmocap search mocap.index --queries queries.json --label kick",
        "depthmocap search mocap.index --by-example kick.bvh",
    ),
    "learn": (
        "depthmocap learn clips/ --others mocap/cmu --output motions.npz",
        "depthmocap learn clips/ --templates --output classes.npz",
        "depthmocap learn clips/ --output queries.json",
    ),
    "annotate": ("depthmocap annotate long.amc --classes motions.npz --output annotated",),
    "stabilise": ("depthmocap stabilise run --classes classes.npz --output stable",),
    "inertial read": ("depthmocap inertial read sensors.csv --output sensors.npz",),
    "inertial calibrate": ("depthmocap inertial calibrate run --sensors sensors.npz --output calibration.json",),
    "inertial check": ("depthmocap inertial check run --sensors sensors.npz --output check",),
    "bench": ("depthmocap bench", "depthmocap bench accuracy --split report"),
    "reproduce": ("depthmocap reproduce baak2013 --list", "depthmocap reproduce thesis"),
}
"""Verb -> command lines that run without changes if their files exist."""


def add_examples(app: typer.Typer, prefix: str = "") -> None:
    """Add the examples to the help of each command of `app` and of its groups."""
    for command in app.registered_commands:
        name = command.name or str(getattr(command.callback, "__name__", ""))
        if lines := EXAMPLES.get(prefix + name):
            command.epilog = "\n\n".join((f"Example{'s' if len(lines) > 1 else ''}:", *lines))
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_examples(group.typer_instance, f"{prefix}{group.name} ")
