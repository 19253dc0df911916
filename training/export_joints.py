"""Write a trained joint network as an ONNX file in whole numbers for `cv2.dnn`.

    python -m training.export_joints WEIGHTS.pt CALIBRATION.npz OUT.onnx

Batch norms are folded into the convolutions. The range of each activation is its 99.99th percentile over the crops of
CALIBRATION.npz (`training.joint_crops`), rounded up to `HIGHEST` steps of a power of two.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import torch
from torch import nn

from toolkit.sensing.exact_network import write_digest
from training.joint_network import CHANNELS, JOINTS, SIZE, STRIDE, JointNetwork
from training.train_joints import batch_of, load_crops
from training.whole_numbers import Layer, Values, WholeGraph

HIGHEST = 511
"""Largest activation: 9 bits leave 8 to 9 bits to most weights at sums of 24 bits."""
QUANTILE = 0.9999
INPUT_EXPONENT = -8
"""The input is in steps of 1/256, 2 mm of depth."""


def folded(block: nn.Sequential | nn.Conv2d, stride: int = 1) -> Layer:
    """Weights and biases of a convolution with its batch norm folded in."""
    if isinstance(block, nn.Conv2d):
        return Layer(block.weight.detach().numpy(), block.bias.detach().numpy(), stride)
    conv, norm = block[0], block[1]
    scale = (norm.weight / torch.sqrt(norm.running_var + norm.eps)).detach().numpy().astype(np.float64)
    weights = conv.weight.detach().numpy() * scale[:, None, None, None]
    bias = norm.bias.detach().numpy() - norm.running_mean.numpy() * scale
    return Layer(weights, bias, stride)


def ranges_of(net: nn.Module, batches: Iterable[torch.Tensor]) -> dict[str, float]:
    """Largest `QUANTILE` of each activation over batches of inputs.

    Its name is that of the module that returns it, or of the first module that takes it with `:input` behind it.
    """
    found: dict[str, float] = {}

    def note(name: str, values: torch.Tensor) -> None:
        found[name] = max(found.get(name, 1e-6), float(np.quantile(values.abs().numpy(), QUANTILE)))

    def hook(name: str) -> Callable[..., None]:
        def called(_: nn.Module, inputs: tuple[torch.Tensor, ...], output: torch.Tensor) -> None:
            note(f"{name}:input", inputs[0])
            note(name, output)

        return called

    handles = [module.register_forward_hook(hook(name)) for name, module in net.named_modules() if name]
    with torch.no_grad():
        for batch in batches:
            net(batch)
    for handle in handles:
        handle.remove()
    return found


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


def main() -> None:
    """Calibrate and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("weights", "calibration", "out"):
        parser.add_argument(name, type=Path)
    options = parser.parse_args()
    net = JointNetwork()
    net.load_state_dict(torch.load(options.weights))
    net.eval()
    data = load_crops(options.calibration)
    batches = [batch_of(data, slice(k, k + 100), augment=False)[0] for k in range(0, len(data[0]), 100)]
    largest = export(net, ranges_of(net, batches), options.out)
    write_digest(options.out, (1, 3, SIZE, SIZE), ("anchors", "sides"))
    print(f"{options.out}: {options.out.stat().st_size} bytes; largest partial sum {math.log2(largest):.2f} bits")


if __name__ == "__main__":
    main()
