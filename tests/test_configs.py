"""The settings files that people start from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from toolkit.config import load_settings, settings_text
from toolkit.tracking.settings import HybridSettings

CONFIGS = Path(__file__).parents[1] / "configs"


def settings_by_name(values: dict[str, Any], section: str = "") -> dict[str, Any]:
    """Values by dotted name."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        found |= settings_by_name(value, f"{section}{name}.") if isinstance(value, dict) else {section + name: value}
    return found


def test_the_hybrid_file_shows_the_defaults() -> None:
    shown = settings_by_name(yaml.safe_load((CONFIGS / "hybrid.yaml").read_text(encoding="utf-8")))
    defaults = settings_by_name(yaml.safe_load(settings_text(HybridSettings())))
    assert shown == {name: defaults[name] for name in shown}
    assert {"hypotheses", "momentum", "patience", "fitting.iterations", "arms.margin"} <= set(shown)
    assert load_settings(HybridSettings, "hybrid") == HybridSettings()


def test_the_papers_variant_has_its_two_hypotheses_and_nothing_learnt() -> None:
    settings = load_settings(HybridSettings, "baak2013")
    assert settings.hypotheses == ("local", "extrema")
    assert settings.shape.seconds == 0 and settings.fitting.prior_weight == 0.0 and settings.fitting.cloud_samples == 0
