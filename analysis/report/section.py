"""The contents of a report as data: sections with texts, tables, and figures.

``analysis.report.render`` writes these contents as HTML, or as text for a terminal. In
all texts, backquotes enclose code. Other characters have no special meaning.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NamedTuple

from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from analysis.report.criterion import Verdict


class Judged(NamedTuple):
    """A value and the verdict on this value, in one cell of a table."""

    value: complex | str | None
    verdict: str


#: Content of a table cell: a text or a number. None is shown as a dash.
Cell = str | complex | Judged | None

#: Sign for a zero in a matrix, so that the other numbers stand out.
ZERO = "\u00b7"


def number(value: complex | None, digits: int = 4) -> str:
    """Writes a number with a fixed number of significant digits and a true minus sign.

    A complex number is written as a sum with j. None and NaN are written as a dash.
    Whole numbers keep all their digits.
    """
    if value is None or cmath.isnan(value):
        return "\u2013"
    if isinstance(value, complex):
        sign = "\u2212" if value.imag < 0.0 else "+"
        return f"{number(value.real, digits)} {sign} {number(abs(value.imag), digits)}j"
    if math.isinf(value):
        return "\u221e" if value > 0.0 else "\u2212\u221e"
    if isinstance(value, int):
        return str(value)
    return f"{value:.{digits}g}".replace("-", "\u2212")


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    name: str
    unit: str = ""
    digits: int = 4
    """Number of significant digits."""

    @property
    def heading(self) -> str:
        """The name, and the unit in parentheses."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


@dataclass(frozen=True)
class Table:
    """A table of texts and numbers."""

    columns: Sequence[Column | str]
    """A text is the name of a column without a unit. If all names are empty, the table
    has no row of headings."""
    rows: Iterable[Sequence[Cell]]
    """Cells of each row. A row with a single cell spans the table and is a heading for
    the rows below."""
    caption: str = ""
    dense: bool = False
    """Whether to use small type, for matrices."""

    @classmethod
    def of(
        cls,
        objects: Iterable[Any],
        columns: Mapping[Column | str, str | Callable[[Any], Cell]],
        caption: str = "",
    ) -> Table:
        """Makes a table with one row per object.

        The mapping ``columns`` states where the cells of each column come from: either
        the name or the dotted path of an attribute of the object, or a function that
        takes the object and returns the cell.
        """
        cells = [attrgetter(x) if isinstance(x, str) else x for x in columns.values()]
        rows = [[cell(each) for cell in cells] for each in objects]
        return cls(list(columns), rows, caption)

    @property
    def heads(self) -> list[Column]:
        """The columns, all as ``Column``."""
        return [c if isinstance(c, Column) else Column(c) for c in self.columns]


@dataclass(frozen=True)
class Figure:
    """A figure that is drawn when the page is made."""

    draw: Callable[[], Drawing]
    caption: str
    scale: bool = False
    """Whether the lightness of a color represents a value in this figure. If so, the
    page does not change the colors in dark mode."""


@dataclass(frozen=True)
class Formula:
    """A formula on a line of its own."""

    tex: str
    """Formula in matplotlib's subset of TeX, without dollar signs."""
    text: str
    """Formula in words or plain characters, for screen readers and terminals."""


@dataclass(frozen=True)
class Note:
    """A highlighted paragraph to read before the numbers."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list with one bullet for each text."""

    texts: Iterable[str]


@dataclass(frozen=True)
class Definitions:
    """A list of pairs of term and text, one pair per line."""

    rows: Iterable[tuple[str, str]]


@dataclass(frozen=True)
class Links:
    """A line of links within a page, given as pairs of anchor and text."""

    targets: Iterable[tuple[str, str]]


@dataclass(frozen=True)
class Files:
    """A list of files beside the page, given as pairs of file name and description."""

    rows: Iterable[tuple[str, str]]


@dataclass(frozen=True)
class Picture:
    """A picture file in the directory of the page."""

    file: str
    caption: str
    tall: bool = False
    """Whether the picture may fill a page of paper."""


@dataclass(frozen=True)
class Section:
    """A section of a report."""

    key: str
    """Key of the section in the JSON document, and its anchor in links."""
    title: str
    contents: Sequence[Content] = ()
    """Paragraphs, tables, figures and sections, in the order in which they are read."""
    data: Any = None
    """Entry of the JSON document; ``plain`` must be able to convert it."""
    verdicts: Sequence[Verdict] = ()
    """Verdicts on the numbers of the section."""


#: What a section contains. A text is a paragraph; ``Markup`` is HTML.
Content = (
    str
    | Markup
    | Table
    | Figure
    | Formula
    | Note
    | Bullets
    | Definitions
    | Links
    | Files
    | Picture
    | Section
)


def figures_of(section: Section) -> Iterator[Figure]:
    """Yields the figures of a section and of the sections inside it."""
    for content in section.contents:
        if isinstance(content, Figure):
            yield content
        elif isinstance(content, Section):
            yield from figures_of(content)
