"""YAML mapped onto the frozen settings dataclasses of the rooms, by their type hints.

A settings file names any subset of the settings; the rest keep their defaults. Nothing is guessed: an unknown name, a
wrong type or a value out of range is an error that lists what there is.
"""

from __future__ import annotations

import inspect
import textwrap
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import yaml

from toolkit.constants import is_constant
from toolkit.errors import SettingsError
from toolkit.files import is_file, save_text, shipped
from toolkit.plain import parse_yaml, read_yaml

Settings = TypeVar("Settings")


def load_settings(
    kind: type[Settings], path: str | Path | None = None, overrides: Mapping[str, Any] | None = None
) -> Settings:
    """Settings from a YAML file and overrides on top of the defaults.

    Parameters
    ----------
    kind : the settings dataclass
    path : a YAML file, or the name of a shipped one such as `baak2013`; None for the defaults
    overrides : values by dotted name, for example `{"sensing.half_resolution": True}`

    Raises
    ------
    SettingsError
        The file cannot be read, or a name, a type or a value is not one that the dataclass knows.
    UsageError
        There is neither a file nor a shipped one of this name.
    """
    values = {} if path is None else _read(path)
    for name, value in (overrides or {}).items():
        _set(values, name, value)
    return from_mapping(kind, values)


def setting_of(name: str, path: str | Path | None = None, overrides: Mapping[str, Any] | None = None) -> Any:
    """One top-level value as `load_settings` would see it, None where neither file nor overrides name it.

    Raises
    ------
    SettingsError, UsageError
        As `load_settings`.
    """
    values = {} if path is None else _read(path)
    return (overrides or {}).get(name, values.get(name))


def parse_overrides(pairs: list[str]) -> dict[str, Any]:
    """Overrides from `name=value` texts; a value is read as YAML.

    Raises
    ------
    SettingsError
        A text has no `=`, or its value is no YAML.
    """
    overrides = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals or not name:
            raise SettingsError(f"{pair!r} is no setting; write NAME=VALUE, for example sensing.half_resolution=true")
        overrides[name.strip()] = parse_yaml(value, f"the value {value[:80]!r} of {name}", SettingsError, "correct it")
    return overrides


def save_settings(settings: Any, path: str | Path) -> None:
    """Write the settings in force as YAML, which `load_settings` reads back."""
    save_text(path, settings_text(settings))


def settings_text(settings: Any) -> str:
    """All settings of a dataclass as YAML, and those constants that are not as they stand in the code."""
    shown = _plain(_shown(settings, type(settings)(), public=True))
    return yaml.safe_dump(shown, sort_keys=False, default_flow_style=False)


def _shown(settings: Any, default: Any, *, public: bool) -> dict[str, Any]:
    """Settings by name; of constants those that differ from `default`."""
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


def explained_text(settings: Any, indent: str = "") -> str:
    """The settings, without constants, with what its class says of each value above it.

    The settings dataclasses tell of every field in the `Attributes` of their docstring what it is, in which unit, and
    why it has its value: there and nowhere else.
    """
    lines: list[str] = []
    said = attributes_of(type(settings))
    for field in (field for field in fields(settings) if not is_constant(field)):
        value = getattr(settings, field.name)
        for names, text in said.items():
            if names.split(", ")[0] == field.name:
                told = f"{names}: {text}" if ", " in names else text
                lines += textwrap.wrap(
                    told, 110, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ", break_on_hyphens=False
                )
        if is_dataclass(value):
            lines += [f"{indent}{field.name}:", explained_text(value, indent + "  "), ""]
        else:
            plain = _plain(value)
            flow = yaml.safe_dump(plain, default_flow_style=True, width=1000).removesuffix("\n...\n").strip()
            lines.append(f"{indent}{field.name}: {flow}")
    return "\n".join(lines).rstrip("\n") + ("\n" if not indent else "")


def attributes_of(kind: type) -> dict[str, str]:
    """What the docstring of a class says of its attributes: text by name, or by names with commas between them."""
    told: dict[str, str] = {}
    _, _, section = inspect.cleandoc(kind.__doc__ or "").partition("Attributes\n----------\n")
    for line in section.splitlines():
        if line and not line.startswith(" "):
            names, _, text = line.partition(" : ")
            told[names] = text
        elif line:
            told[names] += " " + line.strip()
        else:
            break
    return told


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
        raise SettingsError(f"{file} holds {_kind(values)}; settings are names with values")
    return values


def _set(values: dict[str, Any], name: str, value: Any) -> None:
    *parents, last = name.split(".")
    for parent in parents:
        inner = values.setdefault(parent, {})
        if not isinstance(inner, dict):
            raise SettingsError(f"{name} cannot be set: {parent} is {_kind(inner)} and has no settings inside")
        values = inner
    values[last] = value


def from_mapping(
    kind: type[Settings], values: Mapping[str, Any], where: str = "", base: Settings | None = None
) -> Settings:
    """A settings dataclass from plain values by name, the others as in `base` or else as its class has them.

    `where` is the dotted name of what is being read.

    Raises
    ------
    SettingsError
        As `load_settings`.
    """
    hints = typing.get_type_hints(kind)
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    if unknown := [name for name in values if name not in names]:
        public = [field.name for field in fields(kind) if not is_constant(field)]  # type: ignore[arg-type]
        raise SettingsError(f"unknown setting {_inside(where, unknown[0])}; there are: {', '.join(public)}")
    made = {}
    for name, value in values.items():
        usual = next(field.default for field in fields(kind) if field.name == name)  # type: ignore[arg-type]
        if is_dataclass(usual) and not isinstance(usual, type):
            inside = _expect(value, dict, _inside(where, name), "names with values")
            made[name] = from_mapping(type(usual), inside, _inside(where, name), usual)
        else:
            made[name] = _convert(value, hints[name], _inside(where, name))
    try:
        return kind(**made) if base is None else replace(base, **made)  # type: ignore[type-var]
    except TypeError as error:
        raise SettingsError(f"{where or kind.__name__}: {error}") from error


def _inside(where: str, name: object) -> str:
    return f"{where}.{name}" if where else str(name)


def _convert(value: Any, hint: Any, where: str) -> Any:
    """`value` as `hint` wants it."""
    if is_dataclass(hint) and isinstance(hint, type):
        return from_mapping(hint, _expect(value, dict, where, "names with values"), where)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return _convert_union(value, arguments, where)
    if origin is Literal:
        if value not in arguments:
            raise SettingsError(f"{where} is {value!r}; it can be: {', '.join(map(str, arguments))}")
        return value
    if origin is tuple:
        return _convert_tuple(_expect(value, (list, tuple), where, "a list"), arguments, where)
    if origin is dict:
        return {
            key: _convert(item, arguments[1], _inside(where, key))
            for key, item in _expect(value, dict, where, "names with values").items()
        }
    return _convert_plain(value, hint, where)


def _convert_plain(value: Any, hint: Any, where: str) -> Any:
    if hint is float:
        if isinstance(value, str):  # YAML 1.1 takes 1e-3, which has no point, for text
            try:
                return float(value)
            except ValueError:
                pass
        elif not isinstance(value, bool) and isinstance(value, int):
            return float(value)
        return _expect(value, float, where, "a number")
    if hint is int:
        if isinstance(value, bool):
            raise SettingsError(f"{where} is {value}; it must be a whole number")
        return _expect(value, int, where, "a whole number")
    if hint is Path:
        return Path(_expect(value, str, where, "a path"))
    words = {bool: "true or false", str: "text"}
    return _expect(value, hint, where, words.get(hint, "something else"))


def _convert_tuple(value: Any, arguments: tuple[Any, ...], where: str) -> tuple[Any, ...]:
    kinds = [arguments[0]] * len(value) if arguments[1:] == (Ellipsis,) else list(arguments)
    if len(kinds) != len(value):
        raise SettingsError(f"{where} has {len(value)} values; it must have {len(kinds)}")
    return tuple(_convert(item, kind, f"{where}[{i}]") for i, (item, kind) in enumerate(zip(value, kinds, strict=True)))


def _convert_union(value: Any, arguments: tuple[Any, ...], where: str) -> Any:
    if value is None and type(None) in arguments:
        return None
    errors = []
    for argument in arguments:
        if argument is type(None):
            continue
        try:
            return _convert(value, argument, where)
        except SettingsError as error:
            errors.append(error)
    raise errors[0]


def _expect(value: Any, kind: Any, where: str, words: str) -> Any:
    if not isinstance(value, kind):
        raise SettingsError(f"{where} is {_kind(value)}; it must be {words}")
    return value


def _kind(value: Any) -> str:
    if value is None:
        return "empty"
    return "a list" if isinstance(value, list) else "a group of settings" if isinstance(value, dict) else repr(value)
