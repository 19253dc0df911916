"""Compare a track with the true joints in its recording.

    python examples/04_evaluate.py [RUN...]

Needs output/run of example 03. Writes output/evaluation with a table as CSV and JSON and two plots.
"""

import sys
from pathlib import Path

from rich.console import Console

from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.evaluation.scores import write_evaluation

OUTPUT = Path("output")


def main() -> None:
    # One row per run; the mean weights all recordings equally. Errors are capped at 1 m and include all frames.
    table = evaluate_runs(sys.argv[1:] or [OUTPUT / "run"])
    Console().print(table.to_rich())

    row = table.rows[0]
    if row.a100_joints:
        hardest = min(row.a100_joints, key=row.a100_joints.__getitem__)
        print(f"hardest joint: {hardest}, within 100 mm in {100 * row.a100_joints[hardest]:.0f} % of the frames")
    for stage, milliseconds in row.stages_ms.items():
        print(f"{stage}: {milliseconds:.1f} ms")

    for path in write_evaluation(table, OUTPUT / "evaluation"):
        print(path)


if __name__ == "__main__":
    main()
