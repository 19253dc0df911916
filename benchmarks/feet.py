"""Feet that carry: `depthmocap bench feet --database suite.npz`.

Simulated people who walk, squat, rise and stand (`benchmarks/_movement.py`), tracked; truth says which foot carries.
Sliding is the root mean square of the distance along the floor of the carrying sole (that of heel and ball that moves
less) from its mean place, step by step; jitter is that of the ankles of somebody who stands on both feet about their
own course (a Gaussian of 0.15 s); contacts are compared frame by frame. As tracked, and with the feet held where they
rest (`toolkit/biomechanics/resting.py`), for which the errors of all joints are given too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks._movement import TAKES, Tracked, movement_options, tracked
from benchmarks._record import save_figures
from toolkit import skeleton
from toolkit.biomechanics.contact import contacts_of_soles, ground_height, smoothed, spans
from toolkit.biomechanics.resting import at_rest
from toolkit.body.sole import soles
from toolkit.runs import Person
from toolkit.track import TRACKED

SHORTEST = 5
"""Frames of a step that is measured."""
COURSE = 0.15
"""Seconds."""


def true_contacts(found: Tracked) -> np.ndarray:
    """Which feet carry, of the true poses: bool (T, 2)."""
    placed, times = soles(found.body, found.poses), found.person.track.timestamps
    everywhere = np.ones(len(placed), dtype=bool)
    return contacts_of_soles(placed, times, ground_height(placed, times, everywhere) or 0.0, everywhere)


def sliding_mm(person: Person, contact: np.ndarray) -> list[float]:
    """Root mean square of each step's sliding, millimetres, without its first and last frame."""
    placed, rows = soles(person.body, person.track.pose), []
    for side in range(2):
        for span in spans(contact[:, side] & (person.track.state == TRACKED)):
            inner = slice(span.start + 1, span.stop - 1)
            if inner.stop - inner.start < SHORTEST:
                continue
            flat = placed[inner, side][..., [0, 2]]
            off = np.linalg.norm(flat - flat.mean(axis=0), axis=2)
            rows.append(1000.0 * float(np.sqrt((off**2).mean(axis=0)).min()))
    return rows


def jitter_mm(person: Person, contact: np.ndarray) -> float | None:
    """Root mean square of the ankles' distance from their own course while both feet carry, millimetres."""
    ankles = person.track.joints[:, [skeleton.REPORTED.index(f"{s}_ankle") for s in ("left", "right")]]
    times, parts = person.track.timestamps, []
    for span in spans(contact.all(axis=1) & (person.track.state == TRACKED)):
        if span.stop - span.start >= 2 * SHORTEST:
            rows = ankles[span].astype(np.float64)
            parts.append(np.linalg.norm(rows - smoothed(rows, times[span], COURSE), axis=2).ravel())
    return 1000.0 * float(np.sqrt((np.concatenate(parts) ** 2).mean())) if parts else None


def row(found: Tracked, person: Person, contact: np.ndarray) -> dict[str, Any]:
    """Figures of one way of placing the feet."""
    errors = 1000.0 * np.linalg.norm(person.track.joints - found.truth.track.joints, axis=2)
    steps = sliding_mm(person, contact)
    return {
        "sliding_mm": float(np.mean(steps)) if steps else None,
        "worst_step_mm": max(steps, default=None),
        "steps": len(steps),
        "jitter_mm": jitter_mm(person, contact),
        "error_mm": float(errors.mean()),
        "joints_mm": dict(zip(skeleton.REPORTED, errors.mean(axis=0).round(2).tolist(), strict=True)),
        "contacts_right": float((person.track.contact == contact).mean()),
    }


def main() -> None:
    options = movement_options(__doc__)
    figures = {}
    for take in TAKES:
        if take.name not in options.takes.split(","):
            continue
        found = tracked(take, options.work, options.database)
        contact = true_contacts(found)
        ways = {"tracked": found.person, "resting": at_rest(found.person)}
        figures[take.name] = {name: row(found, person, contact) for name, person in ways.items()}
        for name, own in figures[take.name].items():
            shown = {k: round(v, 2) for k, v in own.items() if isinstance(v, float)}
            print(f"{take.name:14} {name:8}", shown, flush=True)
    print(save_figures("feet", figures, vars(options)))


if __name__ == "__main__":
    main()
