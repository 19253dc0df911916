"""Settings files in `configs/`."""

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from scripts.write_configs import HEADS, attributes_of, config_text
from toolkit.app.config import load_settings, settings_text
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.lopez2011.tracker import ParticleTrackerSettings
from toolkit.trackers.qammaz.tracker import SwarmTrackerSettings

CONFIGS = Path(__file__).parents[1] / "configs"


def settings_by_name(values: dict[str, Any], section: str = "") -> dict[str, Any]:
    """Return values by dotted name."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        found |= settings_by_name(value, f"{section}{name}.") if isinstance(value, dict) else {section + name: value}
    return found


def settings_classes(kind: type) -> list[type]:
    """Return a settings class and the nested ones."""
    inner = [type(getattr(kind(), field.name)) for field in fields(kind)]
    return [kind, *(found for part in inner if is_dataclass(part) for found in settings_classes(part))]


@pytest.mark.parametrize("kind", [inner for kind in HEADS for inner in settings_classes(kind)])
def test_every_setting_is_explained_where_its_value_stands(kind: type) -> None:
    told = [name for names in attributes_of(kind) for name in names.split(", ")]
    plain = [field.name for field in fields(kind) if not is_dataclass(getattr(kind(), field.name))]
    assert [name for name in told if name in plain] == plain
    assert set(told) <= {field.name for field in fields(kind)}
    assert all(attributes_of(kind).values())


@pytest.mark.parametrize("kind", HEADS)
def test_a_file_of_defaults_is_the_one_that_the_settings_classes_write(kind: type) -> None:
    name = kind().tracker
    assert (CONFIGS / f"{name}.yaml").read_text(encoding="utf-8") == config_text(kind)
    shown = settings_by_name(yaml.safe_load((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")))
    assert shown == settings_by_name(yaml.safe_load(settings_text(kind())))
    assert load_settings(kind, name) == kind()


@pytest.mark.parametrize("kind", HEADS)
def test_a_tracker_has_at_most_25_settings(kind: type) -> None:
    assert len(settings_by_name(yaml.safe_load(settings_text(kind())))) <= 25


VARIANTS = [(HybridSettings, "baak2013"), (SwarmTrackerSettings, "qammaz"), (ParticleTrackerSettings, "lopez2011")]


@pytest.mark.parametrize(("kind", "variant"), VARIANTS)
def test_what_is_written_beside_a_run_makes_the_same_settings_again(kind: type, variant: str, tmp_path: Path) -> None:
    """Constants that a variant changes are in the file; those equal to the parent's default keep it."""
    changed = {"fitting.iterations": 9}
    for settings in (load_settings(kind, variant), load_settings(kind, None, changed)):
        (tmp_path / "config.yaml").write_text(settings_text(settings), encoding="utf-8")
        assert load_settings(kind, tmp_path / "config.yaml") == settings
    assert load_settings(kind, None, changed).fitting == replace(kind().fitting, iterations=9)
