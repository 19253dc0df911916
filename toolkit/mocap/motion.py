"""A motion made by rule: a cycle of key poses in named controls."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Motion:
    """A cycle of key poses.

    Attributes
    ----------
    keys : share of the cycle in [0, 1) and the controls that differ from `hold`, in order
    seconds : length of one cycle
    cycles : how often it is played
    hold : controls that differ from the base pose during the whole motion
    sided : whether it may as well be played by the other side
    settled : whether it begins, ends and rests in the pose that `hold` gives, instead of standing at ease
    on_floor : whether the body rests on the floor with whatever is lowest, instead of on its feet
    """

    keys: tuple[tuple[float, dict[str, float]], ...]
    seconds: float = 2.0
    cycles: int = 2
    hold: dict[str, float] = field(default_factory=dict)
    sided: bool = False
    settled: bool = False
    on_floor: bool = False


def left(**controls: float) -> dict[str, float]:
    """Controls of the left arm or leg."""
    return {f"left_{name}": value for name, value in controls.items()}


def right(**controls: float) -> dict[str, float]:
    """Controls of the right arm or leg."""
    return {f"right_{name}": value for name, value in controls.items()}


def both(**controls: float) -> dict[str, float]:
    """The same controls for both sides."""
    return left(**controls) | right(**controls)
