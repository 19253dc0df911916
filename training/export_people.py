"""Write a trained person network as an ONNX file in whole numbers for `cv2.dnn`.

    python -m training.export_people WEIGHTS.pt CALIBRATION.npz OUT.onnx

CALIBRATION.npz holds images of `training.room_images`; see `training.export`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import torch
from torch import nn

from toolkit.people.person_network import INPUT_EXPONENT, INPUT_RANGE
from training.export import HIGHEST, folded, run_export
from training.person_network import FINE, PersonNetwork, features
from training.room_images import HEIGHT, WIDTH
from training.train_people import PADDING, batch_of, load_images
from training.whole_numbers import Values, WholeGraph

CALIBRATED = 300
"""Images that give the ranges."""
SHAPE = (1, 4, HEIGHT + 2 * PADDING, WIDTH)


def export(net: PersonNetwork, ranges: dict[str, float], out: Path) -> float:
    """Write the graph; its largest partial sum."""
    graph = WholeGraph()

    def exponent_of(name: str) -> int:
        return math.ceil(math.log2(ranges[name] / HIGHEST))

    def convolved(x: Values, block: nn.Sequential, name: str, stride: int = 1) -> Values:
        layer, exponent = folded(block, stride), exponent_of(name)
        low = 0 if isinstance(block[-1], nn.ReLU) else -HIGHEST
        return graph.rounded(graph.sum(layer, x, exponent), exponent, low, HIGHEST, len(layer.bias))

    def separable(x: Values, block: nn.Sequential, name: str, stride: int = 1) -> Values:
        return convolved(convolved(x, block[0], f"{name}.0", stride), block[1], f"{name}.1")

    def residual(x: Values, block: nn.Module, name: str) -> Values:
        return graph.added(x, separable(x, block.f, f"{name}.f"), exponent_of(name), -HIGHEST, HIGHEST)

    def residuals(x: Values, blocks: nn.Sequential, name: str) -> Values:
        for number, block in enumerate(blocks):
            x = residual(x, block, f"{name}.{number}")
        return x

    def down(x: Values, stage: nn.Sequential, name: str) -> Values:
        x = separable(x, stage[0], f"{name}.0", 2)
        for number, block in enumerate(stage[1:], start=1):
            x = residual(x, block, f"{name}.{number}")
        return x

    def up(x: Values, coarse: Values, block: nn.Sequential, name: str) -> Values:
        layer, exponent = folded(block), exponent_of(name)
        total = graph.sum(layer, coarse, exponent, plus=x, doubled=True)
        return graph.rounded(total, exponent, -HIGHEST, HIGHEST, x.channels)

    a = convolved(Values("depth", INPUT_EXPONENT, -INPUT_RANGE, INPUT_RANGE, 4), net.stem, "stem", 2)
    b = down(a, net.d1, "d1")
    c = down(b, net.d2, "d2")
    c = residuals(up(c, down(c, net.d3, "d3"), net.p3, "u2:input"), net.u2, "u2")
    b = residuals(up(b, c, net.p2, "u1:input"), net.u1, "u1")
    exponent = exponent_of("u0:input")
    skipped = convolved(a, net.s0, "s0")
    total = graph.sum(folded(net.p1), b, exponent, plus=skipped, doubled=True)
    fine = residual(graph.rounded(total, exponent, 0, HIGHEST, FINE), net.u0, "u0")
    outputs = {"log_odds": (graph.sum(folded(net.fine), fine, 0, rounded=False), [1, 2, SHAPE[2] // 2, SHAPE[3] // 2])}
    graph.save(out, "people", ("depth", list(SHAPE)), outputs)
    return graph.largest


def images_of(path: Path) -> Iterable[torch.Tensor]:
    """Yield the inputs of the first `CALIBRATED` images of a file."""
    data = load_images(path)
    last = min(len(data[0]), CALIBRATED)
    return (features(batch_of(data, slice(k, k + 50), augment=False)[0]) for k in range(0, last, 50))


if __name__ == "__main__":
    run_export(__doc__, PersonNetwork(), images_of, export, SHAPE, ("log_odds",))
