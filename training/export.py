"""Export of a trained network as an ONNX file in whole numbers for `cv2.dnn`.

Batch norms are folded into the convolutions. The range of each activation is its 99.99th percentile over calibration
data, rounded up to `HIGHEST` steps of a power of two.
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
from training.whole_numbers import Layer

HIGHEST = 511
"""Largest activation: 9 bits leave 8 to 9 bits to most weights at sums of 24 bits."""
QUANTILE = 0.9999


def folded(block: nn.Sequential | nn.Conv2d, stride: int = 1) -> Layer:
    """Return weights and biases of a convolution with its batch norm folded in."""
    if isinstance(block, nn.Conv2d):
        return Layer(block.weight.detach().numpy(), block.bias.detach().numpy(), stride)
    conv, norm = block[0], block[1]
    scale = (norm.weight / torch.sqrt(norm.running_var + norm.eps)).detach().numpy().astype(np.float64)
    weights = conv.weight.detach().numpy() * scale[:, None, None, None]
    bias = norm.bias.detach().numpy() - norm.running_mean.numpy() * scale
    return Layer(weights, bias, stride)


def ranges_of(net: nn.Module, batches: Iterable[torch.Tensor]) -> dict[str, float]:
    """Return the largest `QUANTILE` of each activation over batches of inputs.

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


def run_export(
    description: str | None,
    net: nn.Module,
    batches_of: Callable[[Path], Iterable[torch.Tensor]],
    export: Callable[[nn.Module, dict[str, float], Path], float],
    shape: tuple[int, ...],
    outputs: tuple[str, ...],
) -> None:
    """Calibrate and write the network named on the command line, and the digest of its outputs.

    Parameters
    ----------
    net : network of the architecture
    batches_of : inputs from a file of calibration data
    export : writes the graph with the ranges of `ranges_of`, returns its largest partial sum
    shape, outputs : see `toolkit.sensing.exact_network.ExactNetwork`
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("weights", "calibration", "out"):
        parser.add_argument(name, type=Path)
    options = parser.parse_args()
    net.load_state_dict(torch.load(options.weights))
    net.eval()
    largest = export(net, ranges_of(net, batches_of(options.calibration)), options.out)
    write_digest(options.out, shape, outputs)
    print(f"{options.out}: {options.out.stat().st_size} bytes; largest partial sum {math.log2(largest):.2f} bits")
