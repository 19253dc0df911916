"""The person network in PyTorch: from a depth image to the log-odds of a person and of a head in each second pixel.

A U-Net of depthwise separable convolutions (165,000 parameters). Its input is in `features`.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

CHANNELS, FINE = (16, 48, 96, 128), 16
"""Channels at strides of 2, 4, 8 and 16 pixels, and of the last layers at a stride of 2."""
BLOCKS = (1, 2, 3)
"""Residual blocks at strides of 4, 8 and 16 pixels."""
NEAREST, AROUND, RELIEF = 0.3, 15, 0.4
"""Metres of the nearest depth; pixels of a side of the surroundings; metres of depth against them that count as 1."""


def convolution(
    inputs: int, outputs: int, size: int = 1, stride: int = 1, *, depthwise: bool = False, relu: bool = True
) -> nn.Sequential:
    """Return a convolution, batch norm and, where wanted, a ReLU."""
    groups = inputs if depthwise else 1
    layers = [nn.Conv2d(inputs, outputs, size, stride, size // 2, groups=groups, bias=False), nn.BatchNorm2d(outputs)]
    return nn.Sequential(*layers, nn.ReLU()) if relu else nn.Sequential(*layers)


def separable(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    """Return a depthwise convolution of 5 x 5 pixels, and a convolution of single pixels."""
    depthwise = convolution(inputs, inputs, 5, stride, depthwise=True, relu=False)
    return nn.Sequential(depthwise, convolution(inputs, outputs))


class Block(nn.Module):
    """Residual block of a separable convolution."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.f = separable(channels, channels)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return x + f(x)."""
        return x + self.f(x)


class PersonNetwork(nn.Module):
    """The network; attribute names are those of the stored weights."""

    def __init__(self) -> None:
        super().__init__()
        c = CHANNELS
        self.stem = convolution(4, c[0], 5, 2)
        stages = zip(c[:-1], c[1:], BLOCKS, strict=True)
        self.d1, self.d2, self.d3 = (
            nn.Sequential(separable(i, o, 2), *(Block(o) for _ in range(count))) for i, o, count in stages
        )
        self.p3, self.u2 = convolution(c[3], c[2], relu=False), nn.Sequential(Block(c[2]), Block(c[2]))
        self.p2, self.u1 = convolution(c[2], c[1], relu=False), nn.Sequential(Block(c[1]), Block(c[1]))
        self.p1, self.s0 = convolution(c[1], FINE, relu=False), convolution(c[0], FINE, relu=False)
        self.u0 = Block(FINE)
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.fine = nn.Conv2d(FINE, 2, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Map features (B, 4, H, W) to log-odds (B, 2, H / 2, W / 2) of people and heads; H, W multiples of 16."""
        a = self.stem(x)
        b = self.d1(a)
        c = self.d2(b)
        c = self.u2(c + self.up(self.p3(self.d3(c))))
        b = self.u1(b + self.up(self.p2(c)))
        return self.fine(self.u0(torch.relu(self.s0(a) + self.up(self.p1(b)))))


def features(depth: torch.Tensor) -> torch.Tensor:
    """Return the network input (B, 4, H, W) of depths (B, H, W) in metres, 0 = no measurement.

    Measured or not, inverse depth, log of the depth, and depth against the mean of the surroundings.
    """
    valid = (depth > 0).to(depth.dtype)
    near = depth.clamp(min=NEAREST)

    def mean(values: torch.Tensor) -> torch.Tensor:
        across = functional.avg_pool2d(values[:, None], (1, AROUND), 1, (0, AROUND // 2))
        return functional.avg_pool2d(across, (AROUND, 1), 1, (AROUND // 2, 0))[:, 0]

    relief = ((depth - mean(depth) / mean(valid).clamp(min=1e-3)) / RELIEF).clamp(-2, 2)
    return torch.stack([valid, valid / near, valid * torch.log(near), valid * relief], 1)
