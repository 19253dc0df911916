"""Training loop and command line of both networks."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import torch
from torch import nn

TEST_SECONDS = 120.0
"""Interval between two tests on the held-out data, seconds."""

Forward = Callable[[torch.Tensor], torch.Tensor | tuple[torch.Tensor, ...]]
"""The network in training, in bfloat16 if chosen."""


class Recipe(NamedTuple):
    """Samples of a step; largest learning rate; steps in which it rises; largest norm of a gradient.

    After its rise the learning rate falls with a cosine.
    """

    batch: int
    rate: float
    warm_up: int
    norm: float


class Options(NamedTuple):
    """Options of the command line."""

    out: Path
    held: Path
    data: list[Path]
    minutes: float
    start: Path | None
    bfloat16: bool


def options_of(description: str | None) -> Options:
    """Read the command line, with one thread: two that share cores with other processes are ten times slower."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("held", type=Path)
    parser.add_argument("data", type=Path, nargs="+")
    parser.add_argument("--minutes", type=float, default=27.0)
    parser.add_argument("--start", type=Path, help="weights to start from")
    parser.add_argument("--bfloat16", action="store_true")
    torch.set_num_threads(1)
    return Options(**vars(parser.parse_args()))


def train(
    make: Callable[[], nn.Module],
    recipe: Recipe,
    samples: int,
    loss_of_rows: Callable[[Forward, torch.Tensor], torch.Tensor],
    held_out_text: Callable[[nn.Module], str],
    options: Options,
) -> None:
    """Train for some minutes and write the exponential average of the weights.

    Parameters
    ----------
    make : returns the network
    samples : number of training samples
    loss_of_rows : loss of the samples of some rows
    held_out_text : figures of the held-out data in one line, printed every two minutes and at the end
    """
    torch.manual_seed(0)
    net, average = make().to(memory_format=torch.channels_last), make()
    if options.start is not None:
        net.load_state_dict(torch.load(options.start))
    average.load_state_dict(net.state_dict())

    def forward(inputs: torch.Tensor) -> torch.Tensor | tuple[torch.Tensor, ...]:
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=options.bfloat16):
            return net(inputs.to(memory_format=torch.channels_last))

    optimiser = torch.optim.AdamW(net.parameters(), recipe.rate, weight_decay=0.01)
    begun, tested, step = time.monotonic(), 0.0, 0
    order = torch.empty(0, dtype=torch.long)
    while (elapsed := time.monotonic() - begun) < 60 * options.minutes:
        if len(order) < recipe.batch:
            order = torch.randperm(samples)
        rows, order = order[: recipe.batch], order[recipe.batch :]
        progress = elapsed / (60 * options.minutes)
        for group in optimiser.param_groups:
            rise = min(1.0, (step + 1) / recipe.warm_up)
            group["lr"] = recipe.rate * rise * 0.5 * (1 + math.cos(math.pi * progress)) + 1e-5
        loss = loss_of_rows(forward, rows)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), recipe.norm)
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
            print(f"{elapsed:.0f} s, step {step}: {held_out_text(average)}", flush=True)
            torch.save(average.state_dict(), options.out)
    torch.save(average.state_dict(), options.out)
    print(f"{step} steps of {recipe.batch} samples: {held_out_text(average)}")
