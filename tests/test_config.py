from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.app.config import READER, load_settings, parse_overrides, settings_text
from toolkit.io.errors import SettingsError, UsageError


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
