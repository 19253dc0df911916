"""ONNX graphs of convolutions in whole numbers: every sum is exact, so that all processors return the same bits.

Weights and activations are whole numbers times powers of two. The largest partial sum of each output channel stays
below 2**24, so that float32 arithmetic rounds nowhere, in any order of summation, with or without fused multiply-add.
Activations return to whole numbers by Floor and Clip. Biases hold the half that turns Floor into rounding.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

EXACT = 2.0**24
"""Whole numbers up to this one are exact in float32."""
FINEST = 2047
"""Largest weight, where the sums allow it."""


class Values(NamedTuple):
    """A tensor of whole numbers from `low` to `high`, times 2**exponent; its name in the graph and its channels."""

    name: str
    exponent: int
    low: int
    high: int
    channels: int


class Layer(NamedTuple):
    """Weights (O, I, k, k) or (O, 1, k, k) for a depthwise layer, and biases (O,) of a convolution."""

    weights: np.ndarray
    bias: np.ndarray
    stride: int = 1
    pad: int | None = None


class WholeGraph:
    """Builder of a graph.

    Attributes
    ----------
    largest : largest partial sum so far, in its own unit
    """

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        self.largest = 0.0

    def sum(
        self,
        layer: Layer,
        x: Values,
        exponent: int,
        plus: Values | None = None,
        *,
        doubled: bool = False,
        rounded: bool = True,
    ) -> str:
        """Add a convolution of `x` in units of 2**exponent, and the name of its result.

        Parameters
        ----------
        plus : tensor that is added to it
        doubled : repeat each pixel of the convolution twice in both directions before `plus` is added
        rounded : add the half that a later Floor needs
        """
        whole, bias, unit = self._whole(layer, x, exponent, plus)
        offset = 0.5 if rounded else 0.0
        half = np.where(unit <= 0.5, offset, 0.0)  # a coarser unit has no halves
        size = layer.weights.shape[2]
        group = x.channels if layer.weights.shape[1] == 1 and x.channels > 1 else 1
        pad = size // 2 if layer.pad is None else layer.pad
        weights, biases = self._constant(whole * unit[:, None, None, None]), self._constant(bias * unit + half)
        total = self._add(
            "Conv", x.name, weights, biases, kernel_shape=[size, size], strides=[layer.stride] * 2, pads=[pad] * 4,
            group=group,
        )  # fmt: skip
        if doubled:
            total = self._doubled(total)
        if plus is not None:
            shift = 2.0 ** (plus.exponent - exponent)
            scaled = plus.name if shift == 1.0 else self._add("Mul", plus.name, self._constant(shift))
            total = self._add("Add", total, scaled)
        return total

    def added(self, x: Values, y: Values, exponent: int, low: int, high: int) -> Values:
        """Add two tensors, rounded to units of 2**exponent and brought to whole numbers from `low` to `high`."""
        scaled = [self._add("Mul", t.name, self._constant(2.0 ** (t.exponent - exponent))) for t in (x, y)]
        half = self._add("Add", scaled[0], self._constant(0.5))
        return self.rounded(self._add("Add", half, scaled[1]), exponent, low, high, x.channels)

    def rounded(self, total: str, exponent: int, low: int, high: int, channels: int) -> Values:
        """Bring a sum with halves back to whole numbers from `low` to `high`."""
        floor = self._add("Floor", total)
        return Values(
            self._add("Clip", floor, self._constant(float(low)), self._constant(float(high))),
            exponent,
            low,
            high,
            channels,
        )

    def _doubled(self, name: str) -> str:
        return self._add(
            "Resize", name, "", self._constant([1, 1, 2, 2]), mode="nearest",
            coordinate_transformation_mode="asymmetric", nearest_mode="floor",
        )  # fmt: skip

    def save(
        self, path: Path, name: str, source: tuple[str, list[int]], outputs: dict[str, tuple[str, list[int]]]
    ) -> None:
        """Check and write the graph: input name and shape, and per output its tensor and shape."""
        for output, (tensor, _) in outputs.items():
            self._nodes.append(helper.make_node("Identity", [tensor], [output]))
        described = [
            helper.make_tensor_value_info(output, TensorProto.FLOAT, shape) for output, (_, shape) in outputs.items()
        ]
        graph = helper.make_graph(
            self._nodes, name, [helper.make_tensor_value_info(source[0], TensorProto.FLOAT, source[1])], described,
            self._constants,
        )  # fmt: skip
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
        model.ir_version = 8
        onnx.checker.check_model(model)
        onnx.save(model, str(path))

    def _whole(
        self, layer: Layer, x: Values, exponent: int, plus: Values | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return integer weights and biases, as fine as exact sums allow, and the exponent of each channel's unit."""
        weights, bias = layer.weights.astype(np.float64), layer.bias.astype(np.float64)
        largest = np.maximum(np.abs(weights).max(axis=(1, 2, 3)), 1e-9)
        power = np.ceil(np.log2(largest / FINEST))
        while True:
            whole = np.rint(weights / 2.0 ** power[:, None, None, None])
            unit = 2.0 ** (power + x.exponent)
            whole_bias = np.rint(bias / unit)
            ends = whole * x.low, whole * x.high
            up, down = (f(*ends).sum(axis=(1, 2, 3)) for f in (np.maximum, np.minimum))
            bound = np.maximum(np.maximum(up, 0), -np.minimum(down, 0)) + np.abs(whole_bias) + 1
            if plus is not None:
                finest = np.minimum(unit, 2.0**plus.exponent)
                bound = (bound * unit + max(plus.high, -plus.low) * 2.0**plus.exponent) / finest
            # The half of a rounded sum is a whole number of units, or there is none.
            if (bound < EXACT).all():
                break
            power += bound >= EXACT
        self.largest = max(self.largest, float(bound.max()))
        return whole, whole_bias, unit * 2.0**-exponent

    def _constant(self, value: object) -> str:
        name = f"c{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(np.asarray(value, np.float32), name))
        return name

    def _add(self, kind: str, *inputs: str, **attributes: object) -> str:
        name = f"n{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, list(inputs), [name], name=name, **attributes))
        return name
