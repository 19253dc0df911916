"""Pages of the documentation site that are made from other files, and its navigation."""

from pathlib import Path

import pytest
from mkdocs.config import load_config

from scripts import site_pages

ROOT = Path(__file__).parents[1]


def test_every_page_and_every_package_is_in_the_navigation() -> None:
    config = site_pages.on_config(load_config(str(ROOT / "mkdocs.yml")))
    pages = site_pages._pages_of(config.nav)
    assert len(pages) == len(set(pages))
    assert {path.name for path in (ROOT / "docs").glob("*.md")} | set(site_pages.SOURCES) <= set(pages)
    packages = {path.parent.name for path in (ROOT / "toolkit").glob("*/__init__.py")}
    assert {f"reference/{name}.md" for name in packages} <= set(pages)


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ("[figures](../README.md#data)", "[figures](index.md#data)"),
        ("![plot](../benchmarks/results/a.png)", "![plot](benchmarks/results/a.png)"),
        ("[tour](../examples/tour.ipynb)", "tour (`examples/tour.ipynb`)"),
        ("[`configs/a.yaml`](../configs/a.yaml)", "`configs/a.yaml`"),
        ("[people](people.md)", "[people](people.md)"),
    ],
)
def test_a_link_out_of_the_pages_becomes_a_page_or_a_path(link: str, expected: str) -> None:
    assert site_pages.on_page_markdown(link, page=None) == expected


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ("[people](docs/people.md)", "[people](people.md)"),
        ("[licence](LICENSE)", "[licence](../LICENSE)"),
        ("![two men](docs/images/a.png)", "![two men](images/a.png)"),
        ("[site](https://example.org)", "[site](https://example.org)"),
    ],
)
def test_a_page_of_the_root_links_as_a_page_of_docs(link: str, expected: str) -> None:
    assert site_pages._from_root(link) == expected
