"""Settings files: YAML mapped onto the frozen settings dataclasses by their type hints.

A settings file names any subset of the settings; the others keep their defaults. An unknown name, a wrong type or a
value out of range is an error that lists the valid ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml

from toolkit.io.errors import SettingsError
from toolkit.io.files import is_file, shipped
from toolkit.io.typed_values import TypedReader, is_constant, kind_of
from toolkit.io.yaml_reader import parse_yaml, read_yaml

Settings = TypeVar("Settings")
READER = TypedReader(SettingsError, written_by_hand=True, what="setting")


def load_settings(
    kind: type[Settings], path: str | Path | None = None, overrides: Mapping[str, Any] | None = None
) -> Settings:
    """Return settings from a YAML file with overrides on top of the defaults.

    Parameters
    ----------
    kind : the settings dataclass
    path : a YAML file, or the name of a shipped one such as `baak2013`; None for the defaults
    overrides : values by dotted name, for example `{"sensing.half_resolution": True}`

    Raises
    ------
    SettingsError
        The file cannot be read, or a name, type or value is invalid.
    UsageError
        Neither a file nor a shipped configuration has this name.
    """
    values = {} if path is None else _read(path)
    for name, value in (overrides or {}).items():
        _set(values, name, value)
    return READER.read(values, kind, "")


def tracker_name(path: str | Path | None, overrides: Mapping[str, Any] | None) -> Any:
    """Return the name of the tracker in file and overrides, or None if neither has one.

    Raises
    ------
    SettingsError, UsageError
        As `load_settings`.
    """
    values = {} if path is None else _read(path)
    return (overrides or {}).get("tracker", values.get("tracker"))


def parse_overrides(pairs: list[str]) -> dict[str, Any]:
    """Parse overrides from `name=value` texts; the value is YAML.

    Raises
    ------
    SettingsError
        A text has no `=`, or its value is invalid YAML.
    """
    overrides = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise SettingsError(f"{pair!r} is no setting; write NAME=VALUE, for example sensing.half_resolution=true")
        overrides[name.strip()] = parse_yaml(value, f"the value {value[:80]!r} of {name}", SettingsError, "correct it")
    return overrides


def settings_text(settings: Any) -> str:
    """Return all settings of a dataclass as YAML, and the constants that differ from their defaults."""
    shown = _plain(_shown(settings, type(settings)(), public=True))
    return yaml.safe_dump(shown, sort_keys=False, default_flow_style=False)


def _shown(settings: Any, default: Any, *, public: bool) -> dict[str, Any]:
    """Return settings by name, and the constants that differ from `default`."""
    shown: dict[str, Any] = {}
    for item in fields(settings):
        value, usual = getattr(settings, item.name), getattr(default, item.name)
        setting = public and not is_constant(item)
        if is_dataclass(value) and type(value) is type(usual):
            if inner := _shown(value, usual, public=setting):
                shown[item.name] = inner
        elif setting or value != usual:
            shown[item.name] = value
    return shown


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def _read(path: str | Path) -> dict[str, Any]:
    file = Path(path)
    if not is_file(file) and not file.suffix:
        file = shipped(f"{file}.yaml")
    hint = "name a YAML file of settings"
    values = read_yaml(file, str(file), SettingsError, hint)
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise SettingsError(f"{file} holds {kind_of(values)}; settings are names with values")
    return values


def _set(values: dict[str, Any], name: str, value: Any) -> None:
    *parents, last = name.split(".")
    for parent in parents:
        inner = values.setdefault(parent, {})
        if not isinstance(inner, dict):
            raise SettingsError(f"{name} cannot be set: {parent} is {kind_of(inner)} and has no settings inside")
        values = inner
    values[last] = value
