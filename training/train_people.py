"""Train the person network on images of `training.room_images`.

    python -m training.train_people OUT.pt HELD.npz IMAGES.npz... --minutes 27 [--start WEIGHTS.pt] [--bfloat16]

The log-odds are those at even odds: people weigh as much as the rest, furniture as much as walls and floor. A person's
pixels weigh less the more there are, so that small and occluded people count. Heads are Gaussian peaks with the focal
loss of CenterNet (Zhou 2019, Eq. 1); an occluded head is neither a peak nor background. Prints the figures of the
held-out images every two minutes and at the end.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from training.loop import Forward, Recipe, options_of, train
from training.person_network import PersonNetwork, features
from training.room_images import COUNTS, FOCAL, FURNITURE, HEIGHT, SHELL, WIDTH

RECIPE = Recipe(batch=16, rate=2e-3, warm_up=100, norm=5.0)
PADDING = 4
"""Rows above and below an image, so that its height is a multiple of 16."""
SMALL = 20.0
"""Pixels that are added to a person's number of pixels, whose square root divides their weight."""
SHARES = {"person": 0.5, "furniture": 0.25, "shell": 0.25}
"""Fractions of the weight."""
HEAD_WEIGHT = 0.1
"""Weight of the loss of heads."""
HEAD_RADIUS = 0.15
"""Metres from a head's centre within which a pixel shows the head."""
VISIBLE = 2
"""Least number of pixels of a visible head."""
SPREAD, NARROWEST = 0.07, 0.8
"""Standard deviation of a peak, metres, and its least, pixels."""

Images = tuple[torch.Tensor, torch.Tensor, torch.Tensor]
"""Depths int16 (N, 120, 160), millimetres, owners int8 (N, 120, 160), and heads float32 (N, 8, 3)."""


def load_images(path: Path) -> Images:
    """Read images."""
    stored = np.load(path)
    depths, rest = stored["depth"].astype(np.int16), (stored["owner"], stored["heads"])
    return torch.from_numpy(depths), *map(torch.from_numpy, rest)


def batch_of(data: Images, rows: torch.Tensor | slice, augment: bool) -> Images:
    """Return depths (B, 128, 160), metres, owners (B, 64, 80) of each second pixel, and heads (B, 8, 3).

    `SHELL - 1` = no measurement.

    Augmentation: mirror image, size (0.92 to 1.08), noise, lost patches, a nearer end of the range.
    """
    depth, owner, heads = (tensor[rows] for tensor in data)
    z, owner, heads = depth.float() * 0.001, owner.clone(), heads.clone()
    count = len(z)
    if augment:

        def chance(share: float) -> torch.Tensor:
            return torch.rand(count, 1, 1) < share

        flip = torch.rand(count) < 0.5
        z[flip], owner[flip] = z[flip].flip(-1), owner[flip].flip(-1)
        heads[flip, :, 0] *= -1
        size = torch.empty(count, 1, 1).uniform_(0.92, 1.08)
        z, heads = z * size, heads * size
        z = z * (1 + 0.004 * torch.rand(count, 1, 1) * torch.randn(z.shape))
        patches = functional.interpolate(torch.rand(count, 1, 15, 20), size=z.shape[1:], mode="bilinear")[:, 0]
        lost = (patches > 1.15 - 0.5 * torch.rand(count, 1, 1)) & chance(0.3)
        end = torch.where(chance(0.15), torch.empty(count, 1, 1).uniform_(2.5, 6.0), torch.tensor(99.0))
        z = torch.where(lost | (z > end), 0.0, z)
    z = functional.pad(z, (0, 0, PADDING, PADDING))
    owner = functional.pad(owner, (0, 0, PADDING, PADDING), value=SHELL)[:, ::2, ::2].long()
    return z, torch.where(z[:, ::2, ::2] > 0, owner, SHELL - 1), heads


def peaks_of(depth: torch.Tensor, owner: torch.Tensor, heads: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the Gaussian peaks (B, h, w) of all heads in the image, 0 to 1, and True at those of visible heads."""
    z = depth[:, None, ::2, ::2]
    rows = torch.arange(owner.shape[1])[:, None].float()
    columns = torch.arange(owner.shape[2]).float()
    across, down = (2 * columns - 0.5 * (WIDTH - 1)) / FOCAL, (2 * rows - PADDING - 0.5 * (HEIGHT - 1)) / FOCAL
    x, y, away = (heads[:, :, k, None, None] for k in range(3))
    near = (across * z - x) ** 2 + (down * z - y) ** 2 + (z - away) ** 2 < HEAD_RADIUS**2
    numbers = torch.arange(heads.shape[1])[:, None, None]
    visible = (near & (owner[:, None] == numbers)).sum((2, 3), keepdim=True) >= VISIBLE
    front = away.clamp(min=0.2)
    u = ((FOCAL * x / front + 0.5 * (WIDTH - 1)) / 2).round()
    v = ((FOCAL * y / front + 0.5 * (HEIGHT - 1) + PADDING) / 2).round()
    spread = (FOCAL * SPREAD / front / 2).clamp(min=NARROWEST)
    squares = ((columns - u) / spread) ** 2 + ((rows - v) / spread) ** 2
    peaks = torch.exp(-0.5 * squares) * (away > 0.2)
    return peaks.amax(1), ((squares == 0) & (away > 0.2) & visible).any(1)


def weights_of(owner: torch.Tensor) -> dict[str, torch.Tensor]:
    """Return the weight (B, h, w) of each pixel, by the kinds of `SHARES`, before their normalisation."""
    person = torch.zeros(owner.shape)
    for number in range(len(COUNTS) - 1):
        mask = owner == number
        person += mask / torch.sqrt(mask.sum((1, 2), keepdim=True) + SMALL)
    return {"person": person, "furniture": (owner == FURNITURE).float(), "shell": (owner == SHELL).float()}


def weight_of(owner: torch.Tensor, totals: dict[str, float]) -> torch.Tensor:
    """Return the weight (B, h, w) of each pixel; `totals`: mean weight of an image by kind, see `mean_weights`."""
    parts = weights_of(owner)
    return sum((parts[kind] * (share / totals[kind]) for kind, share in SHARES.items()), torch.zeros(()))


def loss_of(log_odds: torch.Tensor, owner: torch.Tensor, totals: dict[str, float]) -> torch.Tensor:
    """Return the weighted cross entropy of people; `totals` as of `weight_of`."""
    weight = weight_of(owner, totals)
    cost = functional.binary_cross_entropy_with_logits(log_odds.float(), (owner >= 0).float(), reduction="none")
    return (weight * cost).sum() / len(owner)


def head_loss_of(log_odds: torch.Tensor, peaks: torch.Tensor, visible: torch.Tensor) -> torch.Tensor:
    """Return the focal loss of heads, by visible head."""
    x = log_odds.float()
    p = torch.sigmoid(x)
    hit = functional.softplus(-x) * (1 - p) ** 2 * visible
    miss = functional.softplus(x) * p**2 * (1 - peaks) ** 4 * ~visible
    return (hit + miss).sum() / visible.sum().clamp(min=1)


def mean_weights(data: Images) -> dict[str, float]:
    """Return the mean weight of an image, by kind."""
    totals = dict.fromkeys(SHARES, 0.0)
    for first in range(0, len(data[0]), 200):
        for kind, weight in weights_of(batch_of(data, slice(first, first + 200), augment=False)[1]).items():
            totals[kind] += float(weight.sum())
    return {kind: total / len(data[0]) for kind, total in totals.items()}


def held_out_text(net: PersonNetwork, data: Images, totals: dict[str, float]) -> str:
    """Return the loss, ranking and calibration on held-out images in one line."""
    from sklearn.metrics import roc_auc_score

    losses, head_losses, found, truths, weights = [], [], [], [], []
    net.eval()
    with torch.no_grad():
        for first in range(0, len(data[0]), 50):
            depth, owner, heads = batch_of(data, slice(first, first + 50), augment=False)
            log_odds, of_heads = net(features(depth)).unbind(1)
            head_losses.append(float(head_loss_of(of_heads, *peaks_of(depth, owner, heads))))
            losses.append(float(loss_of(log_odds, owner, totals)))
            measured = owner >= SHELL
            found.append(log_odds[measured])
            truths.append((owner >= 0)[measured])
            weights.append(weight_of(owner, totals)[measured])
    net.train()
    values, truth, weight = (torch.cat(parts).numpy() for parts in (found, truths, weights))
    area = roc_auc_score(truth, values, sample_weight=weight)
    right = [
        100 * np.average((values > 0)[truth == kind] == kind, weights=weight[truth == kind]) for kind in (True, False)
    ]
    means = f"loss {np.mean(losses):.4f}, heads {np.mean(head_losses):.4f}; area {area:.4f}"
    return f"{means}; people {right[0]:.1f} % and the rest {right[1]:.1f} % right"


def main() -> None:
    """Train by the options of the command line."""
    options = options_of(__doc__)
    held_out = load_images(options.held)
    depths, owners, places = (
        torch.cat(parts) for parts in zip(*(load_images(path) for path in options.data), strict=True)
    )
    totals = mean_weights((depths[:2000], owners[:2000], places[:2000]))

    def loss_of_rows(forward: Forward, rows: torch.Tensor) -> torch.Tensor:
        depth, owner, heads = batch_of((depths, owners, places), rows, augment=True)
        log_odds, of_heads = forward(features(depth)).unbind(1)
        return loss_of(log_odds, owner, totals) + HEAD_WEIGHT * head_loss_of(of_heads, *peaks_of(depth, owner, heads))

    train(PersonNetwork, RECIPE, len(depths), loss_of_rows, lambda net: held_out_text(net, held_out, totals), options)


if __name__ == "__main__":
    main()
