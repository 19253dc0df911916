"""Train the joint network on crops of `training.joint_crops`.

    python -m training.train_joints OUT.pt HELD.npz CROPS.npz... --minutes 27 [--start WEIGHTS.pt] [--bfloat16]

`--bfloat16` halves the time on processors with AVX512-BF16. Prints loss and errors on the held-out crops every two
minutes and at the end.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from training.joint_crops import SELF_OCCLUDED, UNOBSERVED, VISIBLE
from training.joint_network import (
    ARMS,
    JOINTS,
    LEGS,
    OPPOSITE,
    PIXEL,
    SIZE,
    JointNetwork,
    decoded,
    features,
    loss_of,
    sided,
)
from training.loop import Forward, Recipe, options_of, train

RECIPE = Recipe(batch=64, rate=2.5e-3, warm_up=200, norm=2.0)
MIN_PIXELS = 60
WEIGHTS = torch.tensor([0.4, 0.8, 1.0])
"""Weight in the loss of joints that are outside, self-occluded and visible."""
ENDS = torch.tensor(
    [row for row, name in enumerate(JOINTS) if name.split("_")[-1] in ("hand", "wrist", "foot", "head")]
)
HELD_OUT = 1000
"""Crops on which the network is tested."""

Crops = tuple[torch.Tensor, ...]
"""Depths int16 (N, 128, 128); joints (N, 20, 3) as pixels of the crop and depth in metres; centre (N, 4): column and
row of the median, median depth, reference depth; visibility (N, 20)."""


def load_crops(path: Path) -> Crops:
    """Read crops with at least `MIN_PIXELS` measured pixels."""
    stored = np.load(path)
    depth, crop, joints, seen = (stored[name] for name in ("depth", "crop", "joints", "seen"))
    side = depth.shape[1]
    valid = (depth > 0) & (depth < UNOBSERVED)
    keep = valid.sum(axis=(1, 2)) > MIN_PIXELS
    depth, crop, joints, seen, valid = (a[keep] for a in (depth, crop, joints, seen, valid))
    half = (valid.sum(axis=(1, 2)) / 2)[:, None]
    column, row = ((np.cumsum(valid.sum(axis=axis), axis=1) < half).sum(axis=1) for axis in (1, 2))
    middle = np.array([np.median(z[v]) for z, v in zip(depth, valid, strict=True)]) * 0.001
    across = (joints[..., :2] / joints[..., 2:] - crop[:, None, 1:]) * (crop[:, :1, None] / PIXEL) + 0.5 * (side - 1)
    placed = np.concatenate([across, joints[..., 2:]], axis=-1).astype(np.float32)
    centre = np.stack([column, row, middle, crop[:, 0]], axis=1).astype(np.float32)
    return tuple(torch.from_numpy(a) for a in (depth.view(np.int16), placed, centre, seen))


def batch_of(data: Crops, rows: torch.Tensor | slice, augment: bool) -> Crops:
    """Return network input (B, 3, 96, 96), target joints (B, 20, 3) in metres, their weights and visibility (B, 20).

    Augmentation: centre, depth, size (0.88 to 1.12), rotation in the image, mirror image, coarse pixels, noise, lost
    patches and pixels, no information about occlusion, truncated feet, a missing hand, foot or head.
    """
    depth, placed, centre, seen = (tensor[rows] for tensor in data)
    raw = depth.to(torch.int32) & 0xFFFF
    count, side = len(raw), raw.shape[1]

    def uniform(low: float, high: float, *shape: int) -> torch.Tensor:
        return torch.empty(count, *shape).uniform_(low, high)

    def chance(share: float, *shape: int) -> torch.Tensor:
        return torch.rand(count, *shape) < share

    middle, reference, column_row = centre[:, 2].clone(), centre[:, 3], centre[:, :2].clone()
    size, angle, flip = torch.ones(count), torch.zeros(count), torch.ones(count)
    if augment:
        column_row += 2.0 * torch.randn(count, 2) * torch.where(chance(0.2, 1), 3.0, 1.0)
        middle += 0.05 * torch.randn(count)
        size, angle = uniform(0.88, 1.12), torch.where(chance(0.8), 0.12, 0.35) * torch.randn(count)
        flip = torch.where(chance(0.5), -1.0, 1.0)
    scale = reference / middle / size  # stored pixels per pixel of the input
    cos, sin = torch.cos(angle), torch.sin(angle)
    turn = torch.stack([torch.stack([cos * flip, -sin], -1), torch.stack([sin * flip, cos], -1)], 1)
    line = torch.arange(SIZE) - 0.5 * (SIZE - 1)
    grid = torch.stack(torch.meshgrid(line, line, indexing="xy"), -1).reshape(1, -1, 2)
    if augment:
        coarse = torch.where(chance(0.25, 1, 1), uniform(1.2, 2.2, 1, 1), 1.0)
        grid = torch.round(grid / coarse) * coarse
    source = torch.round((grid * scale[:, None, None]) @ turn.transpose(1, 2) + column_row[:, None]).long()
    inside = ((source >= 0) & (source < side)).all(-1)
    flat = source.clamp(0, side - 1)
    got = torch.gather(raw.view(count, -1), 1, flat[..., 1] * side + flat[..., 0]).view(count, SIZE, SIZE)
    inside = inside.view(count, SIZE, SIZE)
    unobserved = (got == UNOBSERVED) & inside
    valid = (got > 0) & (got < UNOBSERVED) & inside
    z = (got * 0.001 - middle[:, None, None]) * size[:, None, None]

    offset = ((placed[..., :2] - column_row[:, None]) @ turn) / scale[:, None, None] * PIXEL
    target = torch.cat([offset, (placed[..., 2:] - middle[:, None, None]) * size[:, None, None]], -1)
    mirrored = flip < 0
    target[mirrored] = target[mirrored][:, OPPOSITE]
    seen = torch.where(mirrored[:, None], seen[:, OPPOSITE], seen)
    if augment:
        z = z + uniform(0, 0.012, 1, 1) * torch.randn(z.shape)
        patches = functional.interpolate(torch.rand(count, 1, 12, 12), size=(SIZE, SIZE), mode="bilinear")[:, 0]
        lost = (patches > 1.1 - 0.35 * torch.rand(count, 1, 1)) & chance(0.25, 1, 1)
        valid &= ~(lost | (torch.rand(z.shape) < 0.1 * uniform(-1, 1, 1, 1)))
        unobserved &= ~chance(0.15, 1, 1)
        rows_of, columns_of = torch.arange(SIZE)[None, :, None], torch.arange(SIZE)[None, None]
        lowest = torch.where(valid.any(2), torch.arange(SIZE), -1).amax(1)
        valid &= (rows_of <= lowest[:, None, None] - uniform(1, 6, 1, 1)) | ~chance(0.25, 1, 1)
        end = target[torch.arange(count), ENDS[torch.randint(len(ENDS), (count,))], :2] / PIXEL + 0.5 * (SIZE - 1)
        distance = (columns_of - end[:, :1, None]) ** 2 + (rows_of - end[:, 1:, None]) ** 2
        valid &= (distance > uniform(1, 5, 1, 1) ** 2) | ~chance(0.15, 1, 1)
    inputs = features(torch.where(valid, z, torch.nan), unobserved)
    return inputs, target, WEIGHTS[seen.long()], seen


def held_out_text(net: JointNetwork, data: Crops, step: int = 250) -> str:
    """Return the loss and errors on held-out crops in one line."""
    losses, errors, swapped, seen_parts, scales = [], [], [], [], []
    net.eval()
    with torch.no_grad():
        for first in range(0, len(data[0]), step):
            inputs, target, weight, seen = batch_of(data, slice(first, first + step), augment=False)
            anchors, side = net(inputs)
            losses.append(float(loss_of(anchors, side, target, weight)[0]))
            joints, log_scale = sided(*decoded(anchors), side)
            errors.append((joints - target).norm(dim=-1))
            swapped.append((joints - target[:, OPPOSITE]).norm(dim=-1))
            seen_parts.append(seen)
            scales.append(log_scale.exp())
    net.train()
    error, other, seen, scale = (torch.cat(parts).numpy() for parts in (errors, swapped, seen_parts, scales))
    exchanged = [100 * (other[:, rows].mean(axis=1) < error[:, rows].mean(axis=1)).mean() for rows in (ARMS, LEGS)]
    return (
        f"loss {np.mean(losses):.3f}; mean error {1000 * error[seen == VISIBLE].mean():.0f} mm visible, "
        f"{1000 * error[seen == SELF_OCCLUDED].mean():.0f} mm self-occluded; sides exchanged {exchanged[0]:.1f} % "
        f"(arms), {exchanged[1]:.1f} % (legs); {100 * (error < scale).mean():.0f} % within the scale"
    )


def main() -> None:
    """Train by the options of the command line."""
    options = options_of(__doc__)
    held_out = tuple(tensor[:HELD_OUT] for tensor in load_crops(options.held))
    data = tuple(torch.cat(parts) for parts in zip(*(load_crops(path) for path in options.data), strict=True))

    def loss_of_rows(forward: Forward, rows: torch.Tensor) -> torch.Tensor:
        inputs, target, weight, _ = batch_of(data, rows, augment=True)
        anchors, side = forward(inputs)
        return loss_of(anchors, side, target, weight)[0]

    train(JointNetwork, RECIPE, len(data[0]), loss_of_rows, lambda net: held_out_text(net, held_out), options)


if __name__ == "__main__":
    main()
