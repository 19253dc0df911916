"""Write the tables of README and docs that come from `benchmarks/results/`: `python scripts/write_tables.py [--check]`.

A table lies between `<!-- table: NAME -->` and `<!-- end -->`; its rows are made here, from the figures of one or two
benchmarks. `--check` writes nothing and fails where a page says something else. A result is evidence only if its commit
lies in the history of what is checked out: others are named, and are to be measured again or dropped.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.testing.bootstrap import paired_bootstrap

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
GROUPS = ("basic", "fast", "turn", "side", "low")
SUBJECTS = ("MS_1", "MS_2", "FS_1", "FS_2")
Rows = Sequence[Sequence[str]]


def figures(name: str) -> Any:
    """What a benchmark measured last."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))["figures"]


def percent(share: float, digits: int = 1) -> str:
    """A share without its sign; all of it without a point."""
    return "100" if share == 1 else f"{100 * share:.{digits}f}"


def series(values: Sequence[float], form: str = ".1f") -> str:
    """Numbers with commas between them."""
    return ", ".join(format(value, form) for value in values)


def first_screen() -> Rows:
    """What the tracker does, of the README."""
    real, suite = figures("real")["hybrid"]["mean"], figures("accuracy_report")["rows"]["hybrid"]["means"]["overall"]
    scenes, rooms = figures("scenes_report")["lines"], figures("rooms")["all"]["counts"]
    seated = [scenes["waist up and seated"], scenes["behind furniture"]]
    errors, near = sorted(row["error_mm"] for row in seated), sorted(row["a100"] for row in seated)
    several, clothes = scenes["several people"], scenes["clothes"]
    frame = next(row for row in figures("speed")["times"] if 5e3 < row["pixels"] < 7e3 and not row["half_resolution"])
    found = {kind: f"{percent(rooms[kind][0] / rooms[kind][1], 0)} %" for kind in ("clear", "occluded")}
    small, total = rooms["small"]
    within = rooms["stature"][0] / rooms["stature"][1]
    false = rooms["false"]["furniture"] + rooms["false"]["elsewhere"]
    switched = "nobody is taken for somebody else" if several["switches"] == 0 else f"{several['switches']} switches"
    return [
        ("on", "it does"),
        (
            "real recordings: 108 of UTD-MHAD, a Kinect, four people whom it never saw",
            f"{percent(real['agreement_offsets'])} % of joints agree with the Kinect SDK's within 100 mm; fitted body"
            f" and depth overlap by {percent(real['overlap'])} %",
        ),
        (
            "simulated recordings with exact truth, people and actions that it never saw",
            f"{suite['error_mm']:.1f} mm mean error of the joints, {percent(suite['a100'])} % within 100 mm",
        ),
        (
            "people from the waist up, seated, behind furniture",
            f"{errors[0]:.1f} to {errors[1]:.1f} mm, {percent(near[0])} to {percent(near[1])} %",
        ),
        (
            "real rooms of others, six sequences annotated by hand",
            f"{found['clear']} of heads in clear view found, {found['occluded']} of half hidden ones,"
            f" {small or 'none'} of {total} small ones behind far desks; {false}"
            f" false people in {rooms['frames']} frames; {percent(within, 0)} % of statures between 1.5 and 2.0 m",
        ),
        (
            "two and three people who cross and touch",
            f"{several['error_mm']:.1f} mm, {percent(several['a100'])} %; {switched}",
        ),
        ("skirts, dresses, coats", f"{clothes['error_mm']:.1f} mm, {percent(clothes['a100'])} %"),
        (
            "time per frame of 6,000 pixels, one core, one pass (a recording takes two)",
            f"{frame['frame']['median_ms']:.1f} ms; 99 % of frames within {frame['frame']['p99_ms']:.1f} ms",
        ),
    ]


def accuracy() -> Rows:
    """The hybrid tracker beside what it is without its parts, group by group, by a paired bootstrap over recordings."""
    found = figures("accuracy_report")["rows"]
    errors = {row: {name: own["error_mm"] for name, own in found[row]["recordings"].items()} for row in found}
    head = ["recordings", "hybrid mm"]
    for said in ("database off after the first frame (local only)", "all of it off (`--config baak2013`)"):
        head += [f"{said} mm", "hybrid is better by, 95 %; on"]
    rows = [head]
    for group in (*GROUPS, ""):
        names = [name for name in errors["hybrid"] if name.startswith(group)]
        own = np.array([errors["hybrid"][name] for name in names])
        cells = [f"{group or 'all'}, {len(names)}", f"{own.mean():.1f}"]
        for other in ("local", "baak2013"):
            theirs = np.array([errors[other][name] for name in names])
            gain = paired_bootstrap(theirs, own, np.random.default_rng(0))
            better = f"{int((own < theirs).sum())} of {len(names)}"
            cells += [f"{theirs.mean():.1f}", f"{gain.mean:.1f} [{gain.low:.1f}, {gain.high:.1f}]; {better}"]
        rows.append(cells)
    return rows


def published() -> Rows:
    """The paper's own tracker and its halves (Baak 2013, Fig. 5.12), and its first five extrema (5.5.1), by group."""
    found = figures("accuracy_report")["rows"]
    rows = [
        (
            "recordings", "local only mm", "lookup only mm", "both mm",
            "first five extrema are the five end effectors, of frames that show all five; that have all five free",
        )
    ]  # fmt: skip
    for group in (*GROUPS, "overall"):
        errors = (found[row]["means"][group]["error_mm"] for row in ("baak2013 local", "baak2013 lookup", "baak2013"))
        own = found["hybrid"]["means"][group]
        shares = f"{percent(own['extrema'])}; {percent(own['extrema_free'])} %"
        rows.append((group, *(f"{error:.1f}" for error in errors), shares))
    return rows


def times() -> Rows:
    """Time per frame by pixels and resolution, beside the error and the plain pipeline."""
    rows = [("pixels", "median, 99 %, 99.9 % ms", "error mm", "half resolution: ms", "error mm", "faster than plain")]
    found = figures("speed")
    for full, half, plain in zip(found["times"][::2], found["times"][1::2], found["plain"], strict=True):
        cells = [f"{full['pixels']:.0f}"]
        for row in (full, half):
            cells += [series(list(row["frame"].values())), f"{row['error_mm']:.1f}"]
        rows.append((*cells, f"{plain['faster']:.1f} times; joints apart by {plain['apart_mm']['max']:.3f} mm"))
    return rows


def swarm() -> Rows:
    """The swarm tracker on the suite."""
    groups = figures("swarm_report_colour")["colour, swarm"]["groups"]
    every = groups["overall"]
    shares = (f"{percent(every[name])}" for name in ("a50", "a80", "a100"))
    each = series([groups[name]["delta_mm"] for name in GROUPS])
    head = ("joints from", "Delta mm", "A(50)", "A(80)", "A(100) %", f"{', '.join(GROUPS)} mm")
    return [
        head,
        ("colour", f"{every['delta_mm']:.1f}", *shares, each),
        ("target", "42", "", "", "94", "32, 36, 45, 55, 45"),
    ]


def sequences() -> Rows:
    """Both configurations of the swarm on the four sequences."""
    found = figures("qammaz_sequences")
    rows = [("", f"Delta mm: {', '.join(SUBJECTS)}", "A(50)", "A(80)", "A(100) %")]
    for row, said in (
        ("swarm", "`swarm.yaml` (target 45 each; 80, 90, 94 %)"),
        ("qammaz", "`qammaz.yaml`, the body as balls in 30x40 pixels, a seventh of the mesh's cost (target: mean 85)"),
    ):
        own = [found["ours"][f"{row}, {name}"] for name in SUBJECTS]
        shares = (", ".join(percent(each[a]) for each in own) for a in ("a50", "a80", "a100"))
        rows.append((said, series([each["delta_mm"] for each in own]), *shares))
    return [*rows, ("the paper's, of its own sequences", series([found["paper_mm"][n] for n in SUBJECTS]), "", "", "")]


def models() -> Rows:
    """Table 4 of Qammaz: whose body is taken for the person's."""
    found = figures("qammaz_models")
    kinds = (*SUBJECTS, "neutral", "balls")
    rows = [("Table 4, Delta mm, middle of three seeds, ours (the paper's): body of", *kinds)]
    for name in SUBJECTS:
        cells = []
        for kind in kinds:
            label = f"{name} with {kind}"
            paper = f" ({found['paper_mm'][label]})" if label in found["paper_mm"] else ""
            own = found["ours"][label]  # of three seeds the mean, the lowest and the highest
            ours = f"{3 * own['delta_mm'] - own['seed_low_mm'] - own['seed_high_mm']:.1f}"
            cells.append(f"**{ours}**{paper}" if kind == name else f"{ours}{paper}")
        rows.append((name, *cells))
    return rows


def upper() -> Rows:
    """People seen from the waist up."""
    real, takes = figures("upper_real"), figures("upper_report_hybrid")
    rows = [
        (
            "tracker, told nothing",
            "stills: px, hands px, hands within 100 px",
            "seated man px",
            "takes: px, hands px, mm, first frame px",
        ),
        ("targets of the hybrid tracker", "20, , 100 %", "15", "10, 15, 30; 20"),
    ]
    for row, said in (
        ("hybrid", "hybrid"),
        ("lopez2011", "`lopez2011`"),
        ("particles", "`particles`: with local optimisation"),
    ):
        still, own = real[f"{row} stills"], takes.get(row)
        of_takes = (
            own and f"{series([own[name] for name in ('upper_px', 'hands_px', 'upper_mm')])}; {own['first_px']:.1f}"
        )
        stills = f"{still['upper_px']:.1f}, {still['hands_px']:.1f}, {percent(still['hands_near'], 0)} %"
        rows.append((said, stills, f"{real[f'{row} seated']['upper_px']:.1f}", of_takes or ""))
    return rows


def stabilised() -> Rows:
    """Hidden limbs before and after stabilising."""
    found = figures("stabilise_report")
    kinds = ("before", "after one round", "at the end")
    rows = [("figure", "target", *kinds)]
    for name, said, target in (
        ("mean mm", "mean error, mm", "27"),
        ("seen mm", "of joints that the camera sees", "24"),
        ("hidden mm", "of hidden joints", "50"),
    ):
        rows.append((said, target, *(f"{found[kind][name]:.1f}" for kind in kinds)))

    def spread(own: dict[str, float]) -> str:
        """As in Table 6.1."""
        return f"{own['deviation mm']:.1f}; {own['largest mm']:.0f}"

    near = (f"{percent(found[kind]['hidden within 100 mm'], 0)} %" for kind in kinds)
    labels = f"{found['F segments']:.2f}, {found['F frames']:.2f}"
    return [
        *rows, ("hidden joints within 100 mm", "90 %", *near),
        ("error of a frame: deviation; largest, mm", "", *(spread(found[kind]) for kind in kinds)),
        ("worst change of a sequence", "+1", "", "", f"{found['most harm mm']:.1f}"),
        ("labels of the tracks, F over segments, over frames", "0.95, 0.90", "", "", labels),
    ]  # fmt: skip


def events() -> Rows:
    """Motions told while they go on."""
    rows = [
        (
            "classes told by",
            "F over segments, live; of the whole",
            "delay s: median, 90 %",
            "ms of a processor per frame",
        )
    ]
    rows.append(("targets", "within 0.02", "0.15, 0.35", "0.3"))
    for name, said in (("events", "templates"), ("events_keyframes", "and keyframes of two actors (`--queries`)")):
        own = figures(name)
        live = f"{own['F segments, live']:.3f}; {own['F segments, whole']:.3f}"
        late = series([own["delay s, median"], own["delay s, 90 %"]], ".2f")
        rows.append((said, live, late, f"{own['ms of processor per frame']:.2f}"))
    return rows


LIMBS = ("shins", "forearms", "hands")


def inertial() -> Rows:
    """Simulated sensors: calibration, clock, errors that are found, and what tells them (thesis 7.6, 7.7)."""
    found, rows = figures("inertial"), [("figure", "target", "measured")]
    own, park = found["errors, robust"], found["errors, thesis"]
    for said, target, key in (
        ("calibration, spread of 15 degrees on: error of psi / q_L, degrees, median (90 %)", "0.5 (1.5) / 1.0 (2.5)",
         "robust, all right"),
        ("with 30 % wrong frames", "as above", "robust, 30 % wrong"),
        ("the same, Park and Martin's closed form", "", "thesis, 30 % wrong"),
    ):  # fmt: skip
        errors = (found["calibration"][f"{key}, spread 15 and more"][name] for name in ("psi", "q_L"))
        rows.append((said, target, " / ".join(f"{middle:.1f} ({most:.1f})" for middle, most in errors)))
    for said, target in (("true poses", "3"), ("own tracks", "10, 30")):
        clock = found[f"clock against {said}"]
        best = series(clock["all five, refined: median, worst ms"], ".1f")
        measured = f"{best}; {clock['refused']} of {clock['takes']} refused as periodic"
        rows.append((f"clock against {said}, five sensors: median, worst ms", target, measured))
    off, stretches = "off by 45 degrees, P, R", "injected frames, tau 30, P, R"
    for said, target, values in (
        ("off by over 45 degrees, P, R: shins; forearms; hands", "0.97, 0.97; 0.97, 0.95; 0.95, 0.95", own[off]),
        ("the same by Park and Martin", "", park[off]),
        ("frames of the injected stretches, tau 30, P, R", "0.95, 0.80; 0.85, 0.90; 0.85, 0.90", own[stretches]),
    ):  # fmt: skip
        rows.append((said, target, "; ".join(series(values[limb], ".2f") for limb in LIMBS)))
    mean, deviation = own["torso, mean and deviation"]
    rows.append(("noise floor of the torso, degrees", "5 +- 3", f"{mean:.1f} +- {deviation:.1f}"))
    told = [own["wrong frames told apart"].values(), (row["told apart"] for row in found["wrong offsets"].values())]
    for said, shares in zip(
        (
            "a wrong frame has the larger value, of pairs with a right one: orientation; rate of turn; acceleration",
            "the same of the thesis's made example: both offsets right; one wrong; both wrong",
        ),
        told,
        strict=True,
    ):
        rows.append((said, "", "; ".join(f"{percent(share, 0)} %" for share in shares)))
    return rows


def ranking() -> Rows:
    """Hits of keyframes ranked by motion templates, by stiffness."""
    rows = [("stiffness of all gaps", "motions found %", "left to rank %", "mean precision over recall %", "ms")]
    for kind, means in figures("keyframe_ranking")["means"].items():
        cells = (percent(means[key]) for key in ("recall", "left", "average precision"))
        rows.append((kind, *cells, f"{means['milliseconds']:.1f}"))
    return rows


def hidden_limbs() -> Rows:
    """How well a hidden limb is told."""
    found = figures("hidden_limbs")
    rows = [("hidden for", "told by", "target: arm, leg", "arm mm", "leg mm")]
    for spans, ways in (
        (
            ("0.5 s", "1 s", "2 s"),
            (
                ("held", "last pose held", ""),
                ("straight", "straight from end to end", ""),
                ("class and ends", "class, seen limbs and both ends", "50, 70, 100; 65, 95, 125"),
            ),
        ),
        (
            ("whole motion",),
            (
                ("held", "first pose held", ""),
                ("class and first frame", "class and first frame", "115, 125"),
                ("repetitions", "the person's repetitions", "85, 95"),
            ),
        ),
    ):
        for way, said, target in ways:
            limbs = ([found[f"{limb} hidden for {span}, {way}"]["mm"] for span in spans] for limb in ("arm", "leg"))
            rows.append((", ".join(spans), said, target, *(series(own, ".0f") for own in limbs)))
    return rows


def scenes() -> Rows:
    """People as they are recorded."""
    lines = figures("scenes_report")["lines"]
    rows = [
        (
            "scenes",
            "recordings",
            "error mm",
            "A(100) %",
            "switches, misses, false",
            "found within 0.5 s %",
            "right number %",
        )
    ]
    for name, said in (
        ("waist up and seated", "waist up and seated"),
        ("behind furniture", "behind furniture"),
        ("clothes", "clothes"),
        ("children, tilted", "children, tilted cameras"),
        ("several people", "two and three people"),
        ("all people", "all"),
    ):
        own = lines[name]
        counts = ", ".join(str(own[kind]) for kind in ("switches", "misses", "false"))
        shares = (percent(own[kind]) for kind in ("found_soon", "numbers_right"))
        rows.append((said, str(own["recordings"]), f"{own['error_mm']:.1f}", percent(own["a100"]), counts, *shares))
    return rows


def crowd() -> Rows:
    """Time by the number of people."""
    rows = [("people", "ms", "over N times one (target: at most + 1)")]
    for count, own in figures("speed_crowd")["crowd"]["people"].items():
        rows.append((count, f"{own['median_ms']:.1f}", f"{own['excess_ms']:+.1f}"))
    return rows


def rooms() -> Rows:
    """Real rooms of others, beside what was aimed at."""
    counts = figures("rooms")["all"]["counts"]
    false, joints, statures = counts["false"], counts["joints"], counts["stature"]

    def shares(column: int) -> str:
        return (
            " / ".join(percent(joints[kind][column] / joints[kind][4], 0) for kind in ("trunk", "arms", "legs")) + " %"
        )

    heads = " / ".join(percent(counts[kind][0] / counts[kind][1], 0) for kind in ("clear", "occluded", "small")) + " %"
    wrong = 100 * (false["furniture"] + false["elsewhere"]) / counts["frames"]
    return [
        ("figure", "measured", "aimed at"),
        ("heads found: in clear view / half hidden / small behind far desks", heads, "99 / 85 / 40 %"),
        ("false people in 100 frames", f"{wrong:.1f} ({false['furniture']} of {counts['frames']} on furniture)", "2"),
        ("identity switches; tracks handed on", f"{counts['switches']}; {counts['handed']}", "0; 0"),
        ("trunk / arms / legs within 150 mm", shares(1), "95 / 85 / 85 %"),
        ("the same, left and right exchanged where that is nearer", shares(3), ""),
        ("statures between 1.5 and 2.0 m", f"{percent(statures[0] / statures[1], 0)} %", "99 %"),
    ]


def kinect_offsets() -> Rows:
    """Our joints beside those of a Kinect's SDK, one by one."""
    found = figures("kinect_offsets")
    rows = [
        ("joint", "UTD-MHAD: offset left, up, forwards; distance; without the offset, mm", "MSR Action3D: the same")
    ]
    for joint in found["utd_mhad"]["joints"]:
        cells = []
        for name in ("utd_mhad", "msr_action3d"):
            own = found[name]["joints"][joint]
            distances = (f"{own[kind]:.0f}" for kind in ("distance_mm", "without_offset_mm"))
            cells.append("; ".join((series(own["left_up_forwards_mm"], ".0f"), *distances)))
        rows.append((joint.replace("_", " "), *cells))
    return rows


def gait() -> Rows:
    """Figures of gait and rises, tracked and of the true poses, beside what is known without the project's code."""
    found, rows = figures("gait"), [("figure", "mean absolute error, tracked", "true poses")]
    ways = ("tracked", "true poses")
    errors = [found["mean_absolute_errors"][way] for way in ways]

    def row(said: str, *shown: tuple[str, float, str]) -> tuple[str, ...]:
        return said, *("; ".join(f"{own[key] * scale:{form}}" for key, scale, form in shown) for own in errors)

    rows += [
        row("stride length; step width, mm", ("stride_length_m", 1e3, ".1f"), ("step_width_m", 1e3, ".1f")),
        row("cadence, steps/min; speed, m/s", ("cadence_steps_per_min", 1, ".2f"), ("speed_m_per_s", 1, ".3f")),
        row("stance, share of the stride; stride time, ms", ("stance_share", 1, ".3f"), ("stride_time_s", 1e3, ".0f")),
        row("rises: start; duration, ms", ("rise_start_s", 1e3, ".0f"), ("rise_duration_s", 1e3, ".0f")),
    ]
    takes = list(found["takes"].values())
    true = [sum(take["strides"][1] for take in takes), sum(len(take["known_rises"]) for take in takes)]
    counts = []
    for way in range(len(ways)):
        strides, rises = (sum(take["strides"][way] for take in takes), sum(len(take["rises"][way]) for take in takes))
        counts.append(f"{strides} of {true[0]}; {rises} of {true[1]}")
    return [*rows, ("strides, of those in the true poses; rises found", *counts)]


ANGLES = (
    ("knee flexion", "knee_flexion"), ("hip flexion", "hip_flexion"), ("hip adduction", "hip_adduction"),
    ("hip rotation", "hip_internal_rotation"), ("ankle dorsiflexion", "ankle_dorsiflexion"),
    ("ankle inversion", "ankle_inversion"), ("shoulder elevation", "shoulder_elevation"),
    ("shoulder plane of elevation", "shoulder_plane_of_elevation"),
    ("shoulder rotation", "shoulder_internal_rotation"), ("elbow flexion", "elbow_flexion"),
    ("thorax flexion", "thorax_flexion"), ("trunk flexion", "trunk_flexion"), ("pelvis tilt", "pelvis_backward_tilt"),
)  # fmt: skip
"""What is said of an angle, and what the names of its columns hold."""


def angles() -> Rows:
    """Root mean square errors of joint angles, and of ranges of motion where both sides have one."""
    found, rows = figures("gait"), [("angle", "frame by frame, RMS degrees", "range of motion, mean absolute degrees")]
    for said, name in ANGLES:
        own = [rms for column, rms in found["angles_rms_deg"].items() if column[: -len("_ZXY_deg")].endswith(name)]
        width = found["ranges"].get(f"{name}_deg")
        rows.append((said, f"{sum(own) / len(own):.1f}", "" if width is None else f"{width:.1f}"))
    return rows


def feet() -> Rows:
    """Sliding and jitter of feet that carry, as tracked and held, plain and beside the true ones."""
    found = figures("feet")
    rows = [
        (
            "feet, means of the takes, mm",
            "target",
            "true poses",
            "as tracked; minus the true place",
            "what rests held; minus the true place",
        )
    ]
    kinds = (("made", "made motions"), ("suite", "suite"), ("utd_mhad", "UTD-MHAD"))
    for figure, said, target in (
        ("sliding", "sliding of a carrying foot, RMS of a step", 10.0),
        ("jitter", "jitter of the ankles of who stands still, RMS", 3.0),
    ):
        for kind, name in kinds:
            own = found[kind]["means"]
            cells = []
            for way in ("tracked", "resting"):
                both = [own[way].get(f"{figure}_mm"), own[way].get(f"{figure}_beside_truth_mm")]
                cells.append("; ".join(f"{value:.1f}" for value in both if value is not None))
            last = own["resting"].get(f"{figure}_beside_truth_mm", own["resting"][f"{figure}_mm"])
            cells[1] += " (miss)" if last > target else ""
            true = f"{own['true'][f'{figure}_mm']:.1f}" if "true" in own else ""
            rows.append((f"{said}: {name}", f"{target:.0f}", true, *cells))
    for key, said, form, scale in (
        ("error_mm", "mean error of all joints", ".1f", 1.0),
        ("contacts_right", "contacts right, % of the frames", ".0f", 100.0),
    ):
        for kind, name in kinds[:2]:
            own = found[kind]["means"]
            rows.append(
                (f"{said}: {name}", "", "", *(f"{scale * own[way][key]:{form}}" for way in ("tracked", "resting")))
            )
    return rows


FINDING = "FINDING"
"""How outcomes begin that must not be."""
CHANGED = {
    ", revalued": "values of JSON and YAML",
    ", resealed": "arrays and headers under a right checksum",
    " folder, ": "a run that is shown or gone on with",
    ", tracked": "recording, database and body of a run",
    "": "bytes",
}
"""What a name of the benchmark holds, the first that fits -> what is changed of such files."""


def damaged() -> Rows:
    """What became of damaged files, by what was changed."""
    counts: dict[str, Counter[str]] = {said: Counter() for said in CHANGED.values()}
    for name, outcomes in figures("fuzz").items():
        own = counts[next(said for part, said in CHANGED.items() if part in name)]
        own["kinds"] += 1
        own.update({outcome.split(":")[0]: count for outcome, count in outcomes.items()})
    counts["all"] = sum(counts.values(), Counter())
    seen = ("refused", "same", "other", FINDING)
    rows = [("what is changed", "kinds of files", "changes", "refused", "as it was", "another meaning", "findings")]
    for said, own in counts.items():
        changes = sum(own[outcome] for outcome in seen)
        rows.append((said, *(f"{number:,}" for number in (own["kinds"], changes, *(own[o] for o in seen)))))
    return rows


def failing() -> Rows:
    """What became of commands one of whose calls of the file system failed."""
    rows = [("command", "failure", "points", "one sentence", "done all the same", "killed", "findings")]
    for command, hows in figures("failures").items():
        for how, outcomes in hows.items():
            bad = sum(count for outcome, count in outcomes.items() if outcome.startswith(FINDING))
            seen = (outcomes.get(outcome, 0) for outcome in ("one sentence", "done", "killed"))
            rows.append((command, how, *(f"{number:,}" for number in (sum(outcomes.values()), *seen, bad))))
    return rows


TABLES: dict[str, Callable[[], Rows]] = {
    table.__name__: table
    for table in (
        first_screen, accuracy, published, times, swarm, sequences, models, upper, stabilised, events, hidden_limbs,
        inertial, ranking, scenes, crowd, rooms, kinect_offsets, gait, angles, feet, damaged, failing,
    )
}  # fmt: skip


def written(page: str) -> str:
    """A page's text with its tables as the results are."""

    def table(found: re.Match[str]) -> str:
        head, *rows = TABLES[found[2]]()
        lines = [head, ["---"] * len(head), *rows]
        text = "".join(
            ("|" + "|".join(row) + "|" if row[0] == "---" else "| " + " | ".join(row) + " |") + "\n" for row in lines
        )
        return found[1] + text.replace("|  |", "| |").replace("|  |", "| |") + found[3]

    return MARKED.sub(table, page)


def pages() -> list[Path]:
    """Those that may hold tables."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def strangers() -> list[str]:
    """Results whose commit is none of the history's, or that name none."""
    found = []
    for path in sorted(RESULTS.glob("*.json")):
        commit = json.loads(path.read_text(encoding="utf-8")).get("commit", "").rstrip("+") or "none"
        command = ["git", "-C", str(ROOT), "merge-base", "--is-ancestor", commit, "HEAD"]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            found.append(f"{path.name} (commit {commit})")
    return found


def main() -> None:
    """Write, or check."""
    stale = [path for path in pages() if written(text := path.read_text(encoding="utf-8")) != text]
    if "--check" in sys.argv:
        lost = strangers()
        for path in stale:
            print(f"{path.relative_to(ROOT)} says something else than benchmarks/results; run scripts/write_tables.py")
        for name in lost:
            print(f"{name} is no commit of this history; measure again or drop it")
        sys.exit(1 if stale or lost else 0)
    for path in stale:
        path.write_text(written(path.read_text(encoding="utf-8")), encoding="utf-8")
        print("written:", path.relative_to(ROOT))


if __name__ == "__main__":
    main()
