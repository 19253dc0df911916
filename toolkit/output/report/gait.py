"""Gait, sit-to-stand and range-of-motion section of a report: tables and curves, left against right."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np

from toolkit.io.spans import spans
from toolkit.motion.motion_summary import Summary, summary_of
from toolkit.motion.resting import at_rest
from toolkit.tracks.runs import Person

EXPECTED: dict[str, float] = {
    "stride_length_m": 0.00442,
    "cadence_steps_per_min": 0.407,
    "speed_m_per_s": 0.00688,
    "step_width_m": 0.00466,
    "stance_share": 0.038,
    "stride_time_s": 0.00419,
    "hip_flexion_deg": 7.02,
    "hip_adduction_deg": 4.79,
    "hip_internal_rotation_deg": 7.71,
    "knee_flexion_deg": 3.28,
    "ankle_dorsiflexion_deg": 3.89,
    "ankle_inversion_deg": 6.63,
    "ankle_internal_rotation_deg": 1.86,
    "shoulder_plane_of_elevation_deg": 32.3,
    "shoulder_elevation_deg": 3.47,
    "shoulder_internal_rotation_deg": 36.0,
    "elbow_flexion_deg": 5.9,
    "rise_duration_s": 0.0422,
}
"""Mean absolute errors by parameter, in its unit; of ranges of motion by joint and motion, degrees."""


LEFT, RIGHT = "#5b8ff9", "#f6903d"
CURVES = (("knee", "flexion"), ("hip", "flexion"), ("ankle", "dorsiflexion"))
SHOWN = (
    ("stride_length_m", "stride length", "m", 2),
    ("cadence_steps_per_min", "cadence", "steps/min", 0),
    ("speed_m_per_s", "speed", "m/s", 2),
    ("step_width_m", "step width", "m", 3),
    ("stance_share", "stance, share of the stride", "", 2),
    ("stride_time_s", "stride time", "s", 2),
)
SIDED = (("step_length", "step length", "m", 2), ("stance_share", "stance, share of the stride", "", 2))
MOTIONS = {"internal_rotation": "internal rotation", "plane_of_elevation": "plane of elevation"}


def gait_section(name: str, people: Sequence[Person]) -> str:
    """Return the HTML of all people of a run; `name` is the run's."""
    parts = [f"<h2>Movement: {html.escape(name)}</h2>"]
    for person in people:
        if len(people) > 1:
            parts.append(f"<h3>{html.escape(person.name)}</h3>")
        parts.append(_person(person, summary_of(at_rest(person))))
    return "\n".join(parts)


def _person(person: Person, found: Summary) -> str:
    tables = [_gait_table(found), _rise_table(found), _range_table(found)]
    return (
        '<div class="movement"><div>' + "\n".join(tables) + "</div><div>" + _curves(person, found) + "</div></div>"
        '<p class="faint">Typical errors are means over simulated recordings with exact truth (docs/gait.md). '
        "Angles follow the ISB (Wu 2002, 2005).</p>"
    )


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    lines = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><caption>{html.escape(title)}</caption><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def _number(value: float, decimals: int, unit: str = "") -> str:
    return f"{value:.{decimals}f} {unit}".strip() if np.isfinite(value) else "-"


def _error(name: str, unit: str) -> str:
    """Return a typical error with two digits, or "" if none was measured."""
    return f"± {float(f'{EXPECTED[name]:.2g}'):g} {unit}".strip() if name in EXPECTED else ""


def _gait_table(found: Summary) -> str:
    if not found.gait.strides:
        return f'<p class="faint">Gait: {html.escape(found.gait.note)}.</p>'
    figures = found.gait.figures()
    rows = [[title, _number(figures[key], decimals, unit), _error(key, unit)] for key, title, unit, decimals in SHOWN]
    for key, title, unit, decimals in SIDED:
        suffix = "_m" if unit == "m" else ""
        both = [_number(figures[f"{key}_{side}{suffix}"], decimals, unit) for side in ("left", "right")]
        rows.append([f"{title}, left / right", " / ".join(both), ""])
    title = f"Gait: {len(found.gait.strides)} strides, {found.gait.walking:.1f} s of walking"
    return _table(title, ["", "measured", "typical error"], rows)


def _rise_table(found: Summary) -> str:
    if not found.rises:
        return '<p class="faint">The person never rises from a seat or a squat.</p>'
    rows = [
        ["sit-to-stand" if rise.seated else "squat", f"{rise.start:.2f} s", f"{rise.duration:.2f} s"]
        for rise in found.rises
    ]
    seated = sum(rise.seated for rise in found.rises)
    title = f"Rising: {seated} sit-to-stand, {len(found.rises) - seated} squat"
    return _table(f"{title} (duration {_error('rise_duration_s', 's')})", ["", "at", "duration"], rows)


def _range_table(found: Summary) -> str:
    rows = []
    narrow = 5.0  # minimum range of a motion in the table, degrees
    for r in found.ranges:
        widths = [high - low for low, high in (r.left, r.right)]
        if not np.isfinite(widths).all() or max(widths) < narrow:
            continue
        sides = [f"{low:.0f} to {high:.0f}" for low, high in (r.left, r.right)]
        name = f"{r.joint} {MOTIONS.get(r.motion, r.motion)}"
        rows.append([name, *sides, f"{round(widths[0] - widths[1]):+d}", _error(f"{r.joint}_{r.motion}_deg", "°")])
    head = ["degrees", "left", "right", "wider on the left by", "typical error"]
    return _table("Ranges of motion", head, rows) if rows else ""


def _curves(person: Person, found: Summary) -> str:
    times = person.times
    drawn = []
    for joint, motion in CURVES:
        sides = [found.angles.of(f"{side}_{joint}_{motion}") for side in ("left", "right")]
        known = np.concatenate([side[np.isfinite(side)] for side in sides])
        if len(known):
            drawn.append(_curve(f"{joint} {motion}, degrees", times, sides, known, person.track.contact))
    key = f'<p><i style="background:{LEFT}"></i>left <i style="background:{RIGHT}"></i>right; bars: foot contact</p>'
    return "".join(drawn) + key if drawn else ""


def _curve(title: str, times: np.ndarray, sides: Sequence[np.ndarray], known: np.ndarray, contact: np.ndarray) -> str:
    low, high = float(known.min()) - 2.0, float(known.max()) + 2.0
    end = max(float(times[-1]), 1e-6)

    width, height, edge = 640, 150, 34  # size and margin of a curve, pixels

    def x(time: float) -> float:
        return edge + (width - edge - 4) * time / end

    def y(value: float) -> float:
        return 6 + (height - 34) * (high - value) / (high - low)

    marks = []
    for value in (low + 2.0, high - 2.0):
        marks.append(f'<line class="grid" x1="{edge}" x2="{width}" y1="{y(value):.1f}" y2="{y(value):.1f}"/>')
        marks.append(f'<text x="2" y="{y(value) + 4:.1f}">{value:.0f}</text>')
    for side, (values, color) in enumerate(zip(sides, (LEFT, RIGHT), strict=True)):
        for span in spans(np.isfinite(values)):
            points = " ".join(f"{x(times[i]):.1f},{y(values[i]):.1f}" for i in range(span.start, span.stop))
            marks.append(f'<polyline class="line" stroke="{color}" points="{points}"/>')
        for span in spans(contact[:, side]):
            a, b = x(times[span.start]), x(times[span.stop - 1])
            top = height - 24 + 7 * side
            marks.append(f'<rect fill="{color}" x="{a:.1f}" y="{top}" width="{max(b - a, 1):.1f}" height="5"/>')
    marks.append(f'<text x="{edge}" y="{height - 1}">0 s</text>')
    marks.append(f'<text x="{width - 46}" y="{height - 1}">{end:.1f} s</text>')
    drawing = f'<svg viewBox="0 0 {width} {height}">{"".join(marks)}</svg>'
    return f"<figure><figcaption>{html.escape(title)}</figcaption>{drawing}</figure>"
