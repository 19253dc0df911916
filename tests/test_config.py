"""Settings: values, overrides, messages, and the files in `configs/`."""

from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from scripts.write_configs import HEADS, attributes_of, config_text
from toolkit.app.config import READER, load_settings, parse_overrides, settings_text
from toolkit.io.errors import SettingsError, UsageError
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.lopez2011.tracker import ParticleTrackerSettings
from toolkit.trackers.qammaz.tracker import SwarmTrackerSettings


@dataclass(frozen=True)
class Inner:
    tau: float = 0.05
    count: int = 20
    fast: bool = True

    def __post_init__(self) -> None:
        if self.tau <= 0:
            raise SettingsError(f"inner.tau is {self.tau}; it must be above 0")


@dataclass(frozen=True)
class Outer:
    inner: Inner = field(default_factory=Inner)
    name: str = "x"
    mode: Literal["a", "b"] = "a"
    size: tuple[int, int] = (1, 2)
    weights: tuple[float, ...] = ()
    limit: float | None = None
    groups: dict[str, float] = field(default_factory=dict)
    file: Path = Path("a")


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_file_names_some_settings_and_the_rest_keep_their_defaults(tmp_path: Path) -> None:
    file = write(tmp_path / "s.yaml", "inner: {tau: 1e-3, count: 7}\nsize: [3, 4]\nweights: [1, 2.5]\ngroups: {a: 1}\n")
    assert load_settings(Outer, file) == Outer(
        inner=Inner(tau=0.001, count=7), size=(3, 4), weights=(1.0, 2.5), groups={"a": 1.0}
    )
    assert load_settings(Outer) == Outer()
    assert load_settings(Outer, write(tmp_path / "empty.yaml", "")) == Outer()


def test_overrides_win_over_the_file(tmp_path: Path) -> None:
    file = write(tmp_path / "s.yaml", "inner: {tau: 0.1}\n")
    overrides = parse_overrides(["inner.tau=0.2", "limit=null", "mode=b", "inner.fast=false"])
    assert load_settings(Outer, file, overrides) == Outer(inner=Inner(tau=0.2, fast=False), mode="b")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"tua": 1}, "unknown setting tua; there are: inner, name"),
        ({"inner": {"tua": 1}}, r"unknown setting inner\.tua; there are: tau, count, fast"),
        ({"inner": 3}, "inner is 3; it must be names with values"),
        ({"inner": {"tau": -1.0}}, r"inner\.tau is -1\.0; it must be above 0"),
        ({"mode": "c"}, "mode is 'c'; it can be: a, b"),
    ],
)
def test_a_wrong_setting_is_one_sentence_with_the_valid_names(values: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        READER.read(values, Outer, "")


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"s\.yaml"):
        load_settings(Outer, write(tmp_path / "s.yaml", "a: [1"))
    with pytest.raises(SettingsError, match="names with values"):
        load_settings(Outer, write(tmp_path / "list.yaml", "- 1\n"))
    with pytest.raises(SettingsError, match=r"absent\.yaml"):
        load_settings(Outer, tmp_path / "absent.yaml")
    with pytest.raises(UsageError, match="there are"):
        load_settings(Outer, "no_such_shipped_settings")


@given(
    st.builds(
        Outer,
        inner=st.builds(Inner, tau=st.floats(1e-12, 1e12), count=st.integers(), fast=st.booleans()),
        name=st.text(st.characters(codec="utf-8", exclude_categories=("C",))),
        mode=st.sampled_from("ab"),
        size=st.tuples(st.integers(), st.integers()),
        weights=st.lists(st.floats(allow_nan=False)).map(tuple),
        limit=st.none() | st.floats(allow_nan=False),
        groups=st.just({"a": 1.0}),
        file=st.just(Path("b/c")),
    )
)
def test_written_settings_are_read_back_equal(settings: Outer) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "config.yaml").write_text(settings_text(settings), encoding="utf-8")
        assert load_settings(Outer, Path(folder) / "config.yaml") == settings


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


def test_lopez2011_names_the_defaults_of_its_settings() -> None:
    assert load_settings(ParticleTrackerSettings, "lopez2011") == ParticleTrackerSettings()


@pytest.mark.parametrize(("kind", "variant"), VARIANTS)
def test_what_is_written_beside_a_run_makes_the_same_settings_again(kind: type, variant: str, tmp_path: Path) -> None:
    """Constants that a variant changes are in the file; those equal to the parent's default keep it."""
    changed = {"fitting.iterations": 9}
    for settings in (load_settings(kind, variant), load_settings(kind, None, changed)):
        (tmp_path / "config.yaml").write_text(settings_text(settings), encoding="utf-8")
        assert load_settings(kind, tmp_path / "config.yaml") == settings
    assert load_settings(kind, None, changed).fitting == replace(kind().fitting, iterations=9)
