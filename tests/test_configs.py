"""The settings files that people start from."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from scripts.write_configs import HEADS, config_text
from toolkit.config import attributes_of, load_settings, settings_text
from toolkit.tracking.settings import HybridSettings

CONFIGS = Path(__file__).parents[1] / "configs"


def settings_by_name(values: dict[str, Any], section: str = "") -> dict[str, Any]:
    """Values by dotted name."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        found |= settings_by_name(value, f"{section}{name}.") if isinstance(value, dict) else {section + name: value}
    return found


def settings_classes(kind: type) -> list[type]:
    """A settings class and those inside it."""
    inner = [type(getattr(kind(), field.name)) for field in fields(kind)]
    return [kind, *(found for part in inner if is_dataclass(part) for found in settings_classes(part))]


@pytest.mark.parametrize("kind", [inner for kind in HEADS for inner in settings_classes(kind)])
def test_every_setting_is_explained_where_its_value_stands(kind: type) -> None:
    told = [name for names in attributes_of(kind) for name in names.split(", ")]
    plain = [field.name for field in fields(kind) if not is_dataclass(getattr(kind(), field.name))]
    assert told == plain
    assert all(attributes_of(kind).values())


@pytest.mark.parametrize("kind", HEADS)
def test_a_file_of_defaults_is_the_one_that_the_settings_classes_write(kind: type) -> None:
    name = kind().tracker
    assert (CONFIGS / f"{name}.yaml").read_text(encoding="utf-8") == config_text(kind)
    shown = settings_by_name(yaml.safe_load((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")))
    assert shown == settings_by_name(yaml.safe_load(settings_text(kind())))
    assert load_settings(kind, name) == kind()


def test_the_papers_variant_has_its_two_hypotheses_and_nothing_learnt() -> None:
    settings = load_settings(HybridSettings, "baak2013")
    assert settings.hypotheses == ("local", "extrema")
    assert settings.shape.seconds == 0 and settings.fitting.prior_weight == 0.0 and settings.fitting.cloud_samples == 0
