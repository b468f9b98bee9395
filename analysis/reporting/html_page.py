"""Contents of the pages of runs, sweeps and comparisons, as HTML.

The functions turn plain text into HTML and escape the text.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from analysis.reporting.render import html
from analysis.reporting.section import (
    Cell,
    Definitions,
    Figure,
    Files,
    Note,
    Picture,
    Section,
    Table,
)


def heading(level: int, text: str) -> str:
    """Makes a heading of a page, of a level from 1 to 4."""
    return Markup("<h{0}>{1}</h{0}>").format(level, text)


def paragraph(text: str) -> str:
    """Makes a paragraph; text between backquotes is set as code."""
    return html(text)


def note(text: str) -> str:
    """Makes a highlighted paragraph to read before the numbers."""
    return html(Note(text))


def definitions(rows: Iterable[tuple[str, str]]) -> str:
    """Makes a list of pairs of term and text, one pair per line."""
    return html(Definitions(rows))


def table(
    headings: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    *,
    caption: str = "",
) -> str:
    """Makes a table, which can be scrolled if it is wider than the page."""
    return html(Table(headings, rows, caption))


def figure_html(
    figure: Drawing, name: str, caption: str, *, scale: bool = False
) -> str:
    """Makes a matplotlib figure part of a page; each name may occur once on a page."""
    return html(Figure(lambda: figure, caption, scale), name)


def picture(file: str, caption: str) -> str:
    """Shows a picture file, as wide as the page; a click opens the file."""
    return html(Picture(file, caption))


def file_links(files: Iterable[tuple[str, str]]) -> str:
    """Makes a list of files beside the page, given as pairs of name and description."""
    return html(Files(files))


def section(anchor: str, title: str, parts: Iterable[str]) -> str:
    """Makes a section of a page from parts in HTML."""
    return html(Section(anchor, title, [Markup(part) for part in parts]), anchor)
