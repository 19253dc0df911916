"""Pages from other files: HTML whose text stays text, the documentation site and its navigation."""

from html.parser import HTMLParser
from pathlib import Path

import pytest
from mkdocs.config import load_config

from scripts import site_pages
from toolkit.io.html import page, table


class Read(HTMLParser):
    """Cells of a page by row, its words, and its pictures."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[tuple[str, bool]]] = []
        self.words: list[str] = []
        self.pictures: list[dict[str, str | None]] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append(("", ("class", "n") in attrs))
        if tag == "img":
            self.pictures.append(dict(attrs))

    def handle_data(self, data: str) -> None:
        self.words.append(data)
        if self.tags[-1] in ("td", "th"):
            text, number = self.rows[-1][-1]
            self.rows[-1][-1] = (text + data.strip(), number)


def test_cells_come_back_and_columns_of_numbers_stand_at_the_right() -> None:
    read = Read(table(("limb", "from (s)", "peak"), [("arm", "1.25", "40"), ("leg", "2.50", "none")]))
    assert [[text for text, _ in row] for row in read.rows] == [
        ["limb", "from (s)", "peak"], ["arm", "1.25", "40"], ["leg", "2.50", "none"],
    ]  # fmt: skip
    assert all([right for _, right in row] == [False, True, False] for row in read.rows)
    assert [text for text, _ in Read(table(("alone",), [])).rows[0]] == ["alone"]


def test_a_name_with_a_tag_stays_text_and_parts_stay_html() -> None:
    read = Read(page("<b>run</b>", ["<p>said</p>"], about=": a page"))
    assert "b" not in read.tags and "p" in read.tags
    assert "<b>run</b>" in read.words and "<b>run</b>: a page" in read.words and "said" in read.words


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
