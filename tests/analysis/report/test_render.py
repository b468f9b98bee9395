"""Pages of text, tables and figures."""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from analysis.report.render import html, page, text
from analysis.report.section import (
    Bullets,
    Column,
    Definitions,
    Figure,
    Files,
    Formula,
    Judged,
    Links,
    Note,
    Picture,
    Section,
    Table,
    number,
)


def drawing(title: str = "a < b") -> Drawing:
    figure = Drawing(figsize=(4.0, 3.0), layout="constrained")
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0], marker="o", label="line")
    axes.set_title(title)
    axes.legend()
    return figure


class Tags(HTMLParser):
    """Which elements are open, and what was seen."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: Counter[str] = Counter()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag not in {"meta", "link", "br"}:
            self.open.append(tag)
        if values.get("id"):
            self.ids[str(values["id"])] += 1
        for name in ("href", "xlink:href"):
            if (values.get(name) or "").startswith("#"):
                self.links.append(str(values[name])[1:])
        if tag in {"img", "iframe"} or "src" in values:
            self.loads.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in {"meta", "link", "br"}:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


SECTION = Section(
    "top",
    "Top",
    [
        "Tom & `K_0 < 3`",
        Note("Mind"),
        Links([("top", "Up & up")]),
        Definitions([("a", "b")]),
        Bullets(["one", "two"]),
        Files([("summary.json", "numbers")]),
        Table(
            ["x", Column("mass", "kg", digits=2), "verdict"],
            [["Heavy"], [1.5, 12.345, "pass"], [None, -1.0, "fail"]],
            "Numbers",
        ),
        Formula(r"\frac{a}{b}", "a / b"),
        Figure(drawing, "One"),
        Figure(drawing, "Two"),
        Section("inner", "Inner", ["deep"]),
    ],
)


def document() -> Tags:
    tags = Tags()
    tags.feed(page("A & B", [("top", "Top")], [html(SECTION, "top")]))
    return tags


def test_elements_close_in_order() -> None:
    assert document().open == []


def test_identifiers_are_unique_and_links_lead_to_them() -> None:
    tags = document()
    assert tags.ids.most_common(1)[0][1] == 1
    assert tags.links
    assert set(tags.links) <= set(tags.ids)


def test_nothing_is_loaded() -> None:
    assert document().loads == []


def test_text_is_escaped_and_backquotes_are_code() -> None:
    assert html("a < b & `c<d`") == "<p>a &lt; b &amp; <code>c&lt;d</code></p>"
    assert "A & B" in document().text
    assert "&lt;i&gt;" in html(Table(["<i>"], [["<i>"]], "<i>"))
    assert "<i>" not in html(Table(["<i>"], [["<i>"]], "<i>"))
    assert html(Markup("<i>kept</i>")) == "<i>kept</i>"


def test_sections_have_anchors_and_headings_of_their_level():
    shown = html(SECTION, "top")
    assert '<h2 id="top">Top</h2>' in shown
    assert '<h3 id="top-inner">Inner</h3>' in shown
    assert '<section><h3 id="a">A</h3>' in html(Section("a", "A"), "a", level=3)


def test_pictures_are_links_to_their_files():
    shown = html(Picture("run.png", "The `run`"))
    assert '<a href="run.png"><img src="run.png" alt="The run"></a>' in shown
    assert "<figcaption>The <code>run</code> Full size: " in shown
    assert '<a href="run.png">run.png</a></figcaption>' in shown
    assert '<img class="tall" src' in html(Picture("run.png", "Run", tall=True))


def test_tables_without_headings_are_pairs():
    """On paper, these tables are in two columns."""
    assert '<table class="pairs"><tbody>' in html(Table(["", ""], [["mass", 2.0]]))
    assert "<table><thead>" in html(Table(["part", ""], [["mass", 2.0]]))


def test_figures_are_well_formed_and_the_same_each_time() -> None:
    once, again = (html(Figure(drawing, "Text"), "f") for _ in range(2))
    assert once == again
    svg = re.search(r"(?s)<svg.*</svg>", once)
    assert svg
    root = ET.fromstring(svg[0])
    assert root.attrib["aria-label"] == "Text"


def test_verdicts_have_colors_and_numbers_stand_right() -> None:
    cells = html(Table(["a", "b", "c"], [["pass", "Not applicable", 2.0]]))
    assert '<td class="pass">pass</td>' in cells
    assert '<td class="none">Not applicable</td>' in cells
    assert '<td class="number">2</td>' in cells
    both = html(Table(["a"], [[Judged(-2.5, "fail")]]))
    assert '<td class="number fail">\u22122.5<br>fail</td>' in both


def test_numbers() -> None:
    assert number(0.1234567) == "0.1235"
    assert number(-2.5) == "\u22122.5"
    assert number(12) == "12"
    assert number(None) == number(float("nan")) == "\u2013"
    assert number(float("inf")) == "\u221e"
    assert number(-0.1269 - 0.7011j) == "\u22120.1269 \u2212 0.7011j"


def test_tables_in_a_terminal_have_columns_of_equal_width():
    table = Table(
        ["law", Column("delay", "s", digits=3), "b"],
        [
            ["active", 0.12345, Judged(-1.5, "fail")],
            ["Group"],
            ["guarded", None, Judged("yes", "not applicable")],
        ],
        "Delays",
    )
    assert text(table).splitlines() == [
        "Delays",
        "law      delay (s)           b",
        "active       0.123  -1.5  fail",
        "Group",
        "guarded          \u2013   yes   n/a",
    ]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("a " * 60, "a " * 43 + "a\n" + "a " * 15 + "a"),
        (Note("Mind"), "Mind"),
        (Bullets(["one", "two"]), "- one\n- two"),
        (Definitions([("a", "b")]), "a: b"),
        (Files([("a.json", "b")]), "a.json: b"),
        (Links([("top", "Up"), ("end", "Down")]), "Up, Down"),
        (Formula(r"\frac{a}{b}", "a / b"), "a / b"),
        (Figure(drawing, "One"), "Figure: One"),
        (Markup("<p>one</p>"), "one"),
        (Section("a", "Ab", ["c", Note("d")]), "Ab\n--\n\nc\n\nd"),
    ],
)
def test_every_content_has_a_text(content, words):
    assert text(content) == words


def test_a_page_states_its_date_version_commit_and_sources(monkeypatch):
    """1e9 s after 1970 is 2001-09-09; the commit is that of git."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    shown = page("Title", [("a", "A")], ["<p>As in Han 2019.</p>"])
    assert "Made on 2001-09-09 by phonotaxis " in shown
    root = Path(__file__).parents[3]
    if (root / ".git").exists():
        words = ["git", "-C", str(root), "rev-parse", "HEAD"]
        commit = subprocess.check_output(words, text=True)
        told = re.search(r"commit (\w+)", shown)
        assert told is not None
        assert commit.startswith(told[1])
    assert '<li><a href="#references">References</a></li>' in shown
    assert "Active Virtual Impedance Control for Sound-Following Robots" in shown
    assert "Engelbrecht" not in shown
    assert "References" not in page("Title", [("a", "A")], ["<p>Nothing.</p>"])
