"""Train the person network on images of `training.room_images`.

    python -m training.train_people OUT.pt HELD.npz IMAGES.npz... --minutes 27 [--start WEIGHTS.pt] [--bfloat16]

The log-odds are those at even odds: people weigh as much as the rest, furniture as much as walls and floor. A person's
pixels weigh less the more there are, so that small and occluded people count. Prints the figures of the held-out images
every two minutes and at the end.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from training.person_network import PersonNetwork, features
from training.room_images import COUNTS, FURNITURE, SHELL

BATCH, RATE, WARM_UP = 16, 2e-3, 100
"""Images of a step; largest learning rate; steps in which it rises. It then falls with a cosine."""
PADDING = 4
"""Rows above and below an image, so that its height is a multiple of 16."""
SMALL = 20.0
"""Pixels that are added to a person's number of pixels, whose square root divides their weight."""
SHARES = {"person": 0.5, "furniture": 0.25, "shell": 0.25}
"""Fractions of the weight."""
TEST_SECONDS = 120.0

Images = tuple[torch.Tensor, torch.Tensor]
"""Depths int16 (N, 120, 160), millimetres, and owners int8 (N, 120, 160)."""


def load_images(path: Path) -> Images:
    """Read images."""
    stored = np.load(path)
    return torch.from_numpy(stored["depth"].astype(np.int16)), torch.from_numpy(stored["owner"])


def batch_of(data: Images, rows: torch.Tensor | slice, augment: bool) -> tuple[torch.Tensor, torch.Tensor]:
    """Depths (B, 128, 160), metres, and the owners (B, 64, 80) of each second pixel; `SHELL - 1` without measurement.

    Augmentation: mirror image, size (0.92 to 1.08), noise, lost patches, a nearer end of the range, coarse pixels.
    """
    depth, owner = (tensor[rows] for tensor in data)
    z, owner = depth.float() * 0.001, owner.clone()
    count = len(z)
    if augment:

        def chance(share: float) -> torch.Tensor:
            return torch.rand(count, 1, 1) < share

        flip = torch.rand(count) < 0.5
        z[flip], owner[flip] = z[flip].flip(-1), owner[flip].flip(-1)
        z = z * torch.empty(count, 1, 1).uniform_(0.92, 1.08)
        z = z * (1 + 0.004 * torch.rand(count, 1, 1) * torch.randn(z.shape))
        patches = functional.interpolate(torch.rand(count, 1, 15, 20), size=z.shape[1:], mode="bilinear")[:, 0]
        lost = (patches > 1.15 - 0.5 * torch.rand(count, 1, 1)) & chance(0.3)
        end = torch.where(chance(0.15), torch.empty(count, 1, 1).uniform_(2.5, 6.0), torch.tensor(99.0))
        z = torch.where(lost | (z > end), 0.0, z)
    z = functional.pad(z, (0, 0, PADDING, PADDING))
    owner = functional.pad(owner, (0, 0, PADDING, PADDING), value=SHELL)[:, ::2, ::2].long()
    return z, torch.where(z[:, ::2, ::2] > 0, owner, SHELL - 1)


def weights_of(owner: torch.Tensor) -> dict[str, torch.Tensor]:
    """Weight (B, h, w) of each pixel, by the kinds of `SHARES`, before their normalisation."""
    person = torch.zeros(owner.shape)
    for number in range(len(COUNTS) - 1):
        mask = owner == number
        person += mask / torch.sqrt(mask.sum((1, 2), keepdim=True) + SMALL)
    return {"person": person, "furniture": (owner == FURNITURE).float(), "shell": (owner == SHELL).float()}


def loss_of(log_odds: torch.Tensor, owner: torch.Tensor, totals: dict[str, float]) -> torch.Tensor:
    """Weighted cross entropy; `totals`: mean weight of an image by kind, see `mean_weights`."""
    parts = weights_of(owner)
    weight = sum((parts[kind] * (share / totals[kind]) for kind, share in SHARES.items()), torch.zeros(()))
    cost = functional.binary_cross_entropy_with_logits(log_odds.float(), (owner >= 0).float(), reduction="none")
    return (weight * cost).sum() / len(owner)


def mean_weights(data: Images) -> dict[str, float]:
    """Mean weight of an image, by kind."""
    totals = dict.fromkeys(SHARES, 0.0)
    for first in range(0, len(data[0]), 200):
        for kind, weight in weights_of(batch_of(data, slice(first, first + 200), augment=False)[1]).items():
            totals[kind] += float(weight.sum())
    return {kind: total / len(data[0]) for kind, total in totals.items()}


def held_out_text(net: PersonNetwork, data: Images, totals: dict[str, float]) -> str:
    """Loss, ranking and calibration on held-out images in one line."""
    from sklearn.metrics import roc_auc_score

    losses, found, truths, weights = [], [], [], []
    net.eval()
    with torch.no_grad():
        for first in range(0, len(data[0]), 50):
            depth, owner = batch_of(data, slice(first, first + 50), augment=False)
            log_odds = net(features(depth))
            losses.append(float(loss_of(log_odds, owner, totals)))
            parts, measured = weights_of(owner), owner >= SHELL
            weight = sum((parts[kind] * (share / totals[kind]) for kind, share in SHARES.items()), torch.zeros(()))
            found.append(log_odds[measured])
            truths.append((owner >= 0)[measured])
            weights.append(weight[measured])
    net.train()
    values, truth, weight = (torch.cat(parts).numpy() for parts in (found, truths, weights))
    area = roc_auc_score(truth, values, sample_weight=weight)
    right = [
        100 * np.average((values > 0)[truth == kind] == kind, weights=weight[truth == kind]) for kind in (True, False)
    ]
    return f"loss {np.mean(losses):.4f}; area {area:.4f}; people {right[0]:.1f} % and the rest {right[1]:.1f} % right"


def train(
    paths: list[Path], held: Path, out: Path, minutes: float, start: Path | None = None, bfloat16: bool = False
) -> None:
    """Train for some minutes and write the exponential average of the weights."""
    torch.manual_seed(0)
    net, average = PersonNetwork().to(memory_format=torch.channels_last), PersonNetwork()
    if start is not None:
        net.load_state_dict(torch.load(start))
    average.load_state_dict(net.state_dict())
    held_out = load_images(held)
    data = tuple(torch.cat(parts) for parts in zip(*(load_images(path) for path in paths), strict=True))
    totals = mean_weights((data[0][:2000], data[1][:2000]))
    optimiser = torch.optim.AdamW(net.parameters(), RATE, weight_decay=0.01)
    begun, tested, step = time.monotonic(), 0.0, 0
    order = torch.empty(0, dtype=torch.long)
    while (elapsed := time.monotonic() - begun) < 60 * minutes:
        if len(order) < BATCH:
            order = torch.randperm(len(data[0]))
        rows, order = order[:BATCH], order[BATCH:]
        progress = elapsed / (60 * minutes)
        for group in optimiser.param_groups:
            group["lr"] = RATE * min(1.0, (step + 1) / WARM_UP) * 0.5 * (1 + math.cos(math.pi * progress)) + 1e-5
        depth, owner = batch_of((data[0], data[1]), rows, augment=True)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=bfloat16):
            log_odds = net(features(depth).to(memory_format=torch.channels_last))
        loss = loss_of(log_odds, owner, totals)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        step += 1
        keep = min(0.998, step / (step + 20))
        averages, current = average.state_dict(), net.state_dict()
        for name, value in averages.items():
            if value.dtype.is_floating_point:
                value.lerp_(current[name], 1 - keep)
            else:
                value.copy_(current[name])
        if elapsed > tested + TEST_SECONDS:
            tested = elapsed
            print(f"{elapsed:.0f} s, step {step}: {held_out_text(average, held_out, totals)}", flush=True)
            torch.save(average.state_dict(), out)
    torch.save(average.state_dict(), out)
    print(f"{step} steps of {BATCH} images: {held_out_text(average, held_out, totals)}")


def main() -> None:
    """Train by the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("held", type=Path)
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--minutes", type=float, default=27.0)
    parser.add_argument("--start", type=Path, help="weights to start from")
    parser.add_argument("--bfloat16", action="store_true")
    options = parser.parse_args()
    torch.set_num_threads(1)
    train(options.images, options.held, options.out, options.minutes, options.start, options.bfloat16)


if __name__ == "__main__":
    main()
