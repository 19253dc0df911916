"""Hook of the documentation site: pages made from files outside `docs/`, and links that lead out of it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PICTURES = "benchmarks/results"
"""Folder of plots that pages of figures show."""
SOURCES = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}
"""Pages of the site -> files of the repository's root."""
PUBLIC = """# depthmocap

::: depthmocap.tracks.track

::: depthmocap.step.Tracker

::: depthmocap.step.Pose

::: depthmocap.tracks.Track

::: depthmocap.tracks.evaluate

::: database_builder.build.build_database

`depthmocap.open_recording` is [`toolkit.recordings.opening.open_recording`][]; every error is a
[`DepthMocapError`][toolkit.io.errors.DepthMocapError].
"""
"""Page of the names that `import depthmocap` gives."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Append the reference, and pages of `docs/` that the navigation lacks."""
    nav = list(config.nav or [])
    named = set(_pages_of(nav))
    rest = [path.name for path in sorted(Path(config.docs_dir).glob("*.md")) if path.name not in named]
    reference = ["reference/depthmocap.md", *(f"reference/{name}.md" for name in _packages())]
    config.nav = [*nav, {"API reference": reference}, *([{"More": rest}] if rest else [])]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here, and the plots of the benchmarks."""
    made = {page: _from_root((ROOT / source).read_text(encoding="utf-8")) for page, source in SOURCES.items()}
    made["reference/depthmocap.md"] = PUBLIC
    for name in _packages():
        modules = [path.stem for path in sorted((ROOT / "toolkit" / name).glob("*.py")) if path.stem[0] != "_"]
        inner = [path.parent.name for path in sorted((ROOT / "toolkit" / name).glob("*/__init__.py"))]
        blocks = [f"::: toolkit.{name}.{module}" for module in modules + inner]
        made[f"reference/{name}.md"] = f"# toolkit.{name}\n\n" + "\n\n".join([f"::: toolkit.{name}", *blocks]) + "\n"
    for page, text in made.items():
        files.append(File.generated(config, page, content=text))
    for picture in sorted((ROOT / PICTURES).glob("*.png")):
        files.append(File.generated(config, f"{PICTURES}/{picture.name}", abs_src_path=str(picture)))
    return files


def on_page_markdown(markdown: str, page: Page, **others: Any) -> str:
    """Turn links out of `docs/` into pages of the site, or into the path in the repository."""
    return re.sub(r"(!?)\[([^\]]*)\]\(\.\./([^)\s]+)\)", _inside, markdown)


def _inside(link: re.Match[str]) -> str:
    mark, text, target = link.groups()
    path, _, anchor = target.partition("#")
    pages = {source: made for made, source in SOURCES.items()}
    if path in pages:
        return f"{mark}[{text}]({pages[path]}{'#' + anchor if anchor else ''})"
    if path.startswith(PICTURES) and path.endswith(".png"):
        return f"{mark}[{text}]({path})"
    return text if text.strip("`") == path else f"{text} (`{path}`)"


def _from_root(markdown: str) -> str:
    """Return a page of the repository's root with the links of a page in `docs/`."""

    def moved(link: re.Match[str]) -> str:
        text, target = link.groups()
        return f"[{text}]({target.removeprefix('docs/') if target.startswith('docs/') else '../' + target})"

    return re.sub(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:|#|mailto:)([^)\s]+)\)", moved, markdown)


def _pages_of(nav: Any) -> list[str]:
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [page for part in parts for page in _pages_of(part)]


def _packages() -> list[str]:
    """Return the packages of the toolkit by name."""
    return sorted(path.parent.name for path in (ROOT / "toolkit").glob("*/__init__.py"))
