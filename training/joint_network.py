"""The joint network in PyTorch: from a depth crop of one person to 20 joints, their scales and two side logits.

A residual network; each of 144 anchors (12 x 12, one per 0.2 m) predicts the offset to every joint and its weight (A2J,
Xiong 2019). The network orders each pair of limbs itself and returns the log-odds that this order is (left, right),
once for the arms and once for the legs; the loss is the likelihood of the mixture of both orders.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

from toolkit.body import skeleton

JOINTS = skeleton.REPORTED
SIZE, STRIDE, PIXEL = 96, 8, 0.025
"""Pixels of a side of the crop; pixels between anchors; metres of a pixel at the reference depth."""
OFFSET = 0.2
"""Metres: unit of the offsets that an anchor predicts."""
CHANNELS = (16, 48, 96, 128)
MIN_LOG_SCALE, MAX_LOG_SCALE, LOG_SCALE_BIAS = -4.6, 0.3, -2.0
"""Range of the log of a scale in metres, and its value at a network output of 0."""
ARMS, LEGS = list(range(4, 12)), list(range(12, 20))
OPPOSITE = [
    JOINTS.index({"left": "right_", "right": "left_"}.get(side, side) + rest)
    for side, _, rest in (name.partition("_") for name in JOINTS)
]
"""Index of each joint's counterpart on the other side."""


def convolution(inputs: int, outputs: int, size: int = 3, stride: int = 1, relu: bool = True) -> nn.Sequential:
    """Return a convolution, batch norm and, where wanted, a ReLU."""
    layers = [nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs)]
    return nn.Sequential(*layers, nn.ReLU()) if relu else nn.Sequential(*layers)


class Block(nn.Module):
    """Residual block of two 3 x 3 convolutions."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.a, self.b = convolution(channels, channels), convolution(channels, channels, relu=False)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return relu(x + b(a(x)))."""
        return torch.relu(x + self.b(self.a(x)))


class JointNetwork(nn.Module):
    """The network; attribute names are those of the stored weights."""

    def __init__(self) -> None:
        super().__init__()
        c = CHANNELS
        self.stem = convolution(3, c[0], 5, 2)
        self.d1 = nn.Sequential(convolution(c[0], c[1], 3, 2), Block(c[1]))
        self.d2 = nn.Sequential(convolution(c[1], c[2], 3, 2), Block(c[2]))
        self.d3 = nn.Sequential(convolution(c[2], c[3], 3, 2), Block(c[3]))
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.p3 = convolution(c[3], c[2], 1, relu=False)
        self.u2 = nn.Sequential(Block(c[2]), convolution(c[2], c[3], 1))
        self.out, self.side = nn.Conv2d(c[3], 5 * len(JOINTS), 1), nn.Conv2d(c[3], 2, 6)
        nn.init.normal_(self.out.weight, std=0.01)
        nn.init.zeros_(self.side.weight)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Map crops (B, 3, 96, 96) to anchors (B, 100, 12, 12) and side logits (B, 2).

        Anchors hold, per joint: weight logit, offset x, y, z in units of `OFFSET`, log scale.
        """
        fine = self.d2(self.d1(self.stem(x)))
        coarse = self.d3(fine)
        y = self.u2(torch.relu(fine + self.up(self.p3(coarse))))
        return self.out(y), self.side(coarse).flatten(1)


def decoded(anchors: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return joints (B, 20, 3), metres from the crop's middle (x right, y down, z forward), and log scales (B, 20)."""
    batch, _, height, width = anchors.shape
    out = anchors.float().view(batch, len(JOINTS), 5, height * width)
    weight = torch.softmax(out[:, :, 0], -1)
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    places = torch.stack([x - 0.5 * (width - 1), y - 0.5 * (height - 1), 0.0 * x]).reshape(3, height * width)
    joints = (weight[:, :, None] * (places * STRIDE * PIXEL + OFFSET * out[:, :, 1:4])).sum(-1)
    log_scale = ((weight * out[:, :, 4]).sum(-1) + LOG_SCALE_BIAS).clamp(MIN_LOG_SCALE, MAX_LOG_SCALE)
    return joints, log_scale


def features(depth: torch.Tensor, unobserved: torch.Tensor) -> torch.Tensor:
    """Return the network input (B, 3, H, W) of depths (B, H, W), metres from the reference, NaN = none, and masks."""
    valid = ~torch.isnan(depth)
    z = torch.where(valid, (2 * depth).clamp(-2, 2), torch.zeros(()))
    return torch.stack([valid.float(), z, unobserved.float()], 1)


def loss_of(
    anchors: torch.Tensor, side: torch.Tensor, target: torch.Tensor, weight: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return the negative log-likelihood per joint, and the joints and log scales as `decoded` returns them.

    The error of a joint is exponentially distributed with its scale; `target` (B, 20, 3), metres; `weight` (B, 20).
    """
    joints, log_scale = decoded(anchors)

    def cost(truth: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
        error = (joints - truth).pow(2).sum(-1).add(1e-6).sqrt()
        return weights * (error * torch.exp(-log_scale) + log_scale)

    same, swapped = cost(target, weight), cost(target[:, OPPOSITE], weight[:, OPPOSITE])
    total = same[:, :4].sum(1)
    for limb, rows in enumerate((ARMS, LEGS)):
        logit = side[:, limb].float()
        both = [
            functional.logsigmoid(logit) - same[:, rows].sum(1),
            functional.logsigmoid(-logit) - swapped[:, rows].sum(1),
        ]
        total = total - torch.logsumexp(torch.stack(both), 0)
    return total.mean() / len(JOINTS), joints, log_scale


def sided(joints: torch.Tensor, log_scale: torch.Tensor, side: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return joints and log scales with left and right in the likelier order."""
    joints, log_scale = joints.clone(), log_scale.clone()
    for limb, rows in enumerate((ARMS, LEGS)):
        opposite = [OPPOSITE[row] for row in rows]
        swap = side[:, limb] < 0
        others, scales = joints[:, opposite], log_scale[:, opposite]
        joints[:, rows] = torch.where(swap[:, None, None], others, joints[:, rows])
        log_scale[:, rows] = torch.where(swap[:, None], scales, log_scale[:, rows])
    return joints, log_scale
