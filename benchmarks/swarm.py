"""The swarm tracker on the simulated suite: `depthmocap bench swarm [--split report] [--joints colour,depth,truth]`.

No database, no pose, no shape is given: the recording, and joints in the image, which the network finds in colour or
in the shaded depth (`depthmocap joints --fetch`), or which are the true ones with the errors of such a network
(`truth`, see `toolkit/testing/joints.py`). `--rows` chooses settings: those of `configs/swarm.yaml`, the paper's own
(`qammaz`, figures of Qammaz in its section 3.3), and parts of either switched off: Table 2 is `qammaz`, `qammaz depth`
and `qammaz joints`, Table 3 the rows `w_D ...` and `plain w_D ...`, in multiples of our weight as the paper's are of 3.
Delta is the mean distance of the joints, not capped; A(t) the share of them within t millimetres. Rows are compared
with the first one by a paired bootstrap over the recordings. With `--cold` every sixth frame is a first frame: right is
one of which 18 of 20 joints are within 150 mm.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._options import add_take_options
from benchmarks._record import save_figures
from benchmarks._swarm_rows import ROWS, calibration, figures_of, follow, print_row, settings_of
from benchmarks._takes import SOURCES, prepared
from toolkit.config import parse_overrides
from toolkit.evaluation.bootstrap import paired_bootstrap
from toolkit.testing.suite import GROUPS, LONGEST, WORK, chosen_takes


def main() -> None:
    """Track, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_take_options(parser)
    parser.add_argument("--joints", default="colour", help=f"out of {', '.join(SOURCES)}, with commas between them")
    parser.add_argument("--rows", default="swarm", help=f"out of {', '.join(ROWS)}, with commas between them")
    parser.add_argument("--first", type=int, help="follow only so many frames of each take")
    parser.add_argument("--cold", action="store_true", help="every sixth frame as a first frame")
    parser.add_argument("--seed", type=int, default=0, help="of the swarms")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of all rows")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    takes = chosen_takes(options.split, count=options.takes)
    figures: dict[str, Any] = {}
    print(f"{'':<28}{'Delta':>8} {'A(50)':>6} {'A(80)':>6} {'A(100)':>6} {'right':>6} {'median':>7} {'p99':>7} ms")
    for source in options.joints.split(","):
        deltas: dict[str, np.ndarray] = {}
        for row in options.rows.split(","):
            settings = settings_of(row, {"seed": options.seed, **parse_overrides(options.set)})
            tracked = []
            for take in takes:
                recording = prepared(take, source, options.work, options.frames)
                tracked.append(follow(settings, recording, cold=options.cold, frames=options.first))
                print_row(f"  {take.name[:25]}", figures_of(tracked[-1:]))
            groups = {
                group: figures_of([t for t, take in zip(tracked, takes, strict=True) if take.group == group])
                for group in GROUPS
                if any(take.group == group for take in takes)
            }
            groups["overall"] = figures_of(tracked)
            for group, found in groups.items():
                print_row(f"{source}, {row}, {group}", found)
            deltas[row] = np.array([1000.0 * t.errors.mean() for t in tracked])
            bins = calibration(tracked)
            print("confidence, found:", ", ".join(f"{b['said']:.2f} {b['found']:.2f}" for b in bins))
            figures[f"{source}, {row}"] = {
                "groups": groups,
                "confidence": bins,
                "recordings": {take.name: figures_of([t]) for take, t in zip(takes, tracked, strict=True)},
            }
        first, *others = deltas
        for row in others:
            worse = paired_bootstrap(deltas[row], deltas[first], np.random.default_rng(0))
            figures[f"{source}, {row}"]["worse_mm"] = asdict(worse)
            print(f"{row} is worse than {first} by {worse.mean:.1f} mm ({worse.low:.1f} to {worse.high:.1f})")
    whole = options.takes is None and options.frames >= LONGEST and not options.set
    told = options.joints.replace(",", "_")
    name = f"swarm_{options.split}_{told}{'_cold' if options.cold else ''}{'' if whole else '_part'}"
    settings = {key: getattr(options, key) for key in ("rows", "joints", "seed", "set", "first")}
    print("written:", save_figures(name, figures, settings))


if __name__ == "__main__":
    main()
