"""Pages of text, tables and figures."""

from __future__ import annotations

import re
from collections import Counter
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

from matplotlib.figure import Figure

from analysis.reporting.html_page import (
    Judged,
    definitions,
    equation,
    figure_html,
    links,
    note,
    number,
    page,
    paragraph,
    section,
    table,
)


def picture(title: str = "a < b") -> Figure:
    figure = Figure(figsize=(4.0, 3.0), layout="constrained")
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


def document() -> Tags:
    parts = [
        paragraph("Tom & `K_0 < 3`"),
        note("Mind"),
        links([("top", "Up & up")]),
        definitions([("a", "b")]),
        table(["x", "verdict"], [[1.5, "pass"], [None, "fail"]], caption="Numbers"),
        equation(r"\frac{a}{b}", "ratio", "a / b"),
        figure_html(picture(), "first", "One"),
        figure_html(picture(), "second", "Two"),
    ]
    tags = Tags()
    tags.feed(page("A & B", [("top", "Top")], [section("top", "Top", parts)]))
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
    assert paragraph("a < b & `c<d`") == ("<p>a &lt; b &amp; <code>c&lt;d</code></p>")
    assert "A & B" in document().text


def test_figures_are_well_formed_and_the_same_each_time() -> None:
    once, again = (figure_html(picture(), "f", "Text") for _ in range(2))
    assert once == again
    svg = re.search(r"(?s)<svg.*</svg>", once)
    assert svg
    root = ET.fromstring(svg[0])
    assert root.attrib["aria-label"] == "Text"


def test_verdicts_have_colours_and_numbers_stand_right() -> None:
    cells = table(["a", "b", "c"], [["pass", "Not applicable", 2.0]])
    assert '<td class="pass">pass</td>' in cells
    assert '<td class="none">Not applicable</td>' in cells
    assert '<td class="number">2</td>' in cells
    both = table(["a"], [[Judged(-2.5, "fail")]])
    assert '<td class="number fail">\u22122.5<br>fail</td>' in both


def test_numbers() -> None:
    assert number(0.1234567) == "0.1235"
    assert number(-2.5) == "\u22122.5"
    assert number(12) == "12"
    assert number(None) == number(float("nan")) == "\u2013"
    assert number(float("inf")) == "\u221e"
    assert number(-0.1269 - 0.7011j) == "\u22120.1269 \u2212 0.7011j"
