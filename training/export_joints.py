"""Write a trained joint network as an ONNX file in whole numbers for `cv2.dnn`.

    python -m training.export_joints WEIGHTS.pt CALIBRATION.npz OUT.onnx

CALIBRATION.npz holds crops of `training.joint_crops`; see `training.export`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import torch
from torch import nn

from training.export import HIGHEST, folded, run_export
from training.joint_network import CHANNELS, JOINTS, SIZE, STRIDE, JointNetwork
from training.train_joints import batch_of, load_crops
from training.whole_numbers import Values, WholeGraph

INPUT_EXPONENT = -8
"""The input is in steps of 1/256, 2 mm of depth."""


def export(net: JointNetwork, ranges: dict[str, float], out: Path) -> float:
    """Write the graph; its largest partial sum."""
    graph = WholeGraph()

    def exponent_of(name: str) -> int:
        return math.ceil(math.log2(ranges[name] / HIGHEST))

    def convolved(x: Values, block: nn.Sequential, name: str, stride: int = 1) -> Values:
        layer, exponent = folded(block, stride), exponent_of(name)
        return graph.rounded(graph.sum(layer, x, exponent), exponent, 0, HIGHEST, len(layer.bias))

    def residual(x: Values, block: nn.Module, name: str) -> Values:
        inner, exponent = convolved(x, block.a, f"{name}.a"), exponent_of(name)
        total = graph.sum(folded(block.b), inner, exponent, plus=x)
        return graph.rounded(total, exponent, 0, HIGHEST, x.channels)

    top = 2**-INPUT_EXPONENT
    x = convolved(Values("crop", INPUT_EXPONENT, -2 * top, 2 * top, 3), net.stem, "stem", 2)
    levels = []
    for name in ("d1", "d2", "d3"):
        stage = getattr(net, name)
        x = residual(convolved(x, stage[0], f"{name}.0", 2), stage[1], f"{name}.1")
        levels.append(x)
    fine, coarse = levels[1], levels[2]
    exponent = exponent_of("u2:input")
    total = graph.sum(folded(net.p3), coarse, exponent, plus=fine, doubled=True)
    y = graph.rounded(total, exponent, 0, HIGHEST, CHANNELS[2])
    y = convolved(residual(y, net.u2[0], "u2.0"), net.u2[1], "u2.1")
    anchors = graph.sum(folded(net.out), y, 0, rounded=False)
    sides = graph.sum(folded(net.side)._replace(pad=0), coarse, 0, rounded=False)
    side = SIZE // STRIDE
    outputs = {"anchors": (anchors, [1, 5 * len(JOINTS), side, side]), "sides": (sides, [1, 2, 1, 1])}
    graph.save(out, "joints", ("crop", [1, 3, SIZE, SIZE]), outputs)
    return graph.largest


def crops_of(path: Path) -> Iterable[torch.Tensor]:
    """Yield the inputs of crops of a file."""
    data = load_crops(path)
    return (batch_of(data, slice(k, k + 100), augment=False)[0] for k in range(0, len(data[0]), 100))


if __name__ == "__main__":
    run_export(__doc__, JointNetwork(), crops_of, export, (1, 3, SIZE, SIZE), ("anchors", "sides"))
