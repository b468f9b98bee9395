"""Makes a page of text, tables and figures in one HTML file, for screen and paper.

The functions of this module turn plain text into HTML and escape the text. If a
function takes HTML, its docstring says so. A page needs no network connection and no
fonts of its own. Its only script allows scrolling with the keyboard through wide tables
and figures.
"""

from __future__ import annotations

import cmath
import html
import io
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

_HERE = Path(__file__).parent
#: CSS variables with the colors of pages, in light mode and in dark mode.
COLOURS_CSS = (_HERE / "page_colours.css").read_text("utf-8")
_CSS = COLOURS_CSS + (_HERE / "html_page.css").read_text("utf-8")

#: With this script, the Tab key reaches the elements that can be scrolled, and no
#: others.
_SCRIPT = """
const reach = () => document.querySelectorAll(".wide, .drawing, .equation").forEach(
  (box) => box.scrollWidth > box.clientWidth
    ? box.setAttribute("tabindex", 0) : box.removeAttribute("tabindex"));
addEventListener("resize", reach);
reach();
"""


class Judged(NamedTuple):
    """A value and the verdict on this value below it, in one cell of a table."""

    value: complex | str | None
    verdict: str


#: Content of a table cell: a text or a number. None is shown as a dash.
Cell = str | complex | Judged | None

#: Sign for a zero in a matrix, so that the other numbers stand out.
ZERO = "\u00b7"

#: Style classes of cells that have a color, by the text of the cell.
_VERDICT_CLASSES = {
    "pass": "pass",
    "fail": "fail",
    "not applicable": "none",
    "not computed": "none",
}


def heading(level: int, text: str, anchor: str = "") -> str:
    """Makes a heading of a page.

    Args:
        level: Level from 1 to 4.
        text: Plain text.
        anchor: Identifier of the heading, for links. Empty if there are no such links.

    Returns:
        HTML.
    """
    identity = f' id="{html.escape(anchor)}"' if anchor else ""
    return f"<h{level}{identity}>{html.escape(text)}</h{level}>"


def paragraph(text: str) -> str:
    """Makes a paragraph; text between backquotes is set as code."""
    return f"<p>{_inline(text)}</p>"


def links(targets: Iterable[tuple[str, str]]) -> str:
    """Makes a line of links to sections, given as pairs of anchor and text."""
    inner = " \u00b7 ".join(
        f'<a href="#{html.escape(anchor)}">{html.escape(text)}</a>'
        for anchor, text in targets
    )
    return f'<p class="links">{inner}</p>'


def note(text: str) -> str:
    """Makes a highlighted paragraph to read before the numbers."""
    return f'<p class="note">{_inline(text)}</p>'


def bullets(texts: Iterable[str]) -> str:
    """Makes a list with one bullet for each text."""
    return "<ul>" + "".join(f"<li>{_inline(text)}</li>" for text in texts) + "</ul>"


def definitions(rows: Iterable[tuple[str, str]]) -> str:
    """Makes a list of pairs of term and text, one pair per line."""
    lines = "".join(
        f"<dt>{_inline(term)}</dt><dd>{_inline(text)}</dd>" for term, text in rows
    )
    return f"<dl>{lines}</dl>"


def table(
    headings: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    *,
    caption: str = "",
    dense: bool = False,
) -> str:
    """Makes a table whose columns are as wide as their contents.

    Numbers are aligned to the right. Verdicts, for example "pass", have colors.

    Args:
        headings: One heading for each column. If all are empty, the table has no row of
            headings.
        rows: Cells of each row. A row with a single cell spans the table and is a
            heading for the rows below.
        caption: Text above the table.
        dense: Whether to use small type, for matrices.

    Returns:
        HTML. If the table is wider than the page, the reader can scroll the table.
    """
    kind = ' class="dense"' if dense else ""
    top = f"<caption>{_inline(caption)}</caption>" if caption else ""
    head = "".join(f"<th>{_inline(text)}</th>" for text in headings)
    head = f"<thead><tr>{head}</tr></thead>" if any(headings) else ""
    body = "".join(_row(row, len(headings)) for row in rows)
    return (
        f'<div class="wide"><table{kind}>{top}{head}<tbody>{body}</tbody></table></div>'
    )


def _row(cells: Sequence[Cell], columns: int) -> str:
    if len(cells) == 1 < columns:
        spanning = f'<td colspan="{columns}">{_inline(str(cells[0]))}</td>'
        return f'<tr class="group">{spanning}</tr>'
    return "<tr>" + "".join(_cell(cell) for cell in cells) + "</tr>"


def _cell(value: Cell) -> str:
    if isinstance(value, Judged):
        colour = _VERDICT_CLASSES.get(value.verdict.lower(), "")
        shown = value.value
        above = _inline(shown) if isinstance(shown, str) else number(shown)
        text = f"{above}<br>{_inline(value.verdict)}"
        return f'<td class="number {colour}">{text}</td>'
    if not isinstance(value, str):
        return f'<td class="number">{number(value)}</td>'
    if value == ZERO:
        return f'<td class="number">{ZERO}</td>'
    kind = _VERDICT_CLASSES.get(value.lower())
    opening = f'<td class="{kind}">' if kind else "<td>"
    return f"{opening}{_inline(value)}</td>"


def number(value: complex | None, digits: int = 4) -> str:
    """Writes a number with a fixed number of significant digits and a true minus sign.

    A complex number is written as a sum with j. A missing number is written as a dash.

    Args:
        value: The number; None and NaN mean that it is missing.
        digits: Number of significant digits of a float. Whole numbers keep all their
            digits.

    Returns:
        Plain text.
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


def _inline(text: str) -> str:
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text, quote=False))


def figure_html(figure: Figure, name: str, caption: str, *, scale: bool = False) -> str:
    """Makes a matplotlib figure part of an HTML page, as inline SVG.

    Args:
        figure: The figure.
        name: Beginning of all identifiers in the SVG: letters, digits and underscores.
            Each figure of a page needs a different name.
        caption: Text below the figure.
        scale: Whether the lightness of a color represents a value in this figure. If
            true, the page does not change the colors in dark mode.

    Returns:
        HTML. The same figure always gives the same HTML.
    """
    stream = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(
            stream,
            format="svg",
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    drawing = _embed(stream.getvalue(), name, caption)
    return _figure(drawing, caption, "scale" if scale else "")


def picture(file: str, caption: str) -> str:
    """Shows a picture file, as wide as the page.

    Args:
        file: Name of the picture in the directory of the page.
        caption: Text below the picture.

    Returns:
        HTML. A click on the picture opens the file.
    """
    label, source = html.escape(caption.replace("`", "")), html.escape(file)
    image = f'<a href="{source}"><img src="{source}" alt="{label}"></a>'
    return _figure(image, caption)


def _figure(drawing: str, caption: str, kind: str = "") -> str:
    """Makes a figure with a caption; a wide drawing can be scrolled."""
    opening = f'<figure class="{kind}">' if kind else "<figure>"
    return (
        f'{opening}<div class="drawing">{drawing}</div>'
        f"<figcaption>{_inline(caption)}</figcaption></figure>"
    )


def file_links(files: Iterable[tuple[str, str]]) -> str:
    """Makes a list of files beside the page, given as pairs of name and description."""
    lines = [
        f'<li><a href="{html.escape(name)}">{html.escape(name)}</a>: {_inline(text)}'
        for name, text in files
    ]
    return f"<ul>{'</li>'.join([*lines, ''])}</ul>"


def equation(tex: str, name: str, text: str) -> str:
    """Shows a formula on a line of its own.

    Args:
        tex: Formula in matplotlib's subset of TeX, without dollar signs.
        name: Beginning of all identifiers in the SVG: letters, digits and underscores.
            Each figure of a page needs a different name.
        text: Formula in words or plain characters, for screen readers.

    Returns:
        HTML.
    """
    stream = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": name, "mathtext.fontset": "cm"}):
        math_to_image(
            f"${tex}$", stream, prop=FontProperties(size=13), dpi=72, format="svg"
        )
    drawing = _embed(stream.getvalue().decode(), name, text)
    return f'<div class="equation">{drawing}</div>'


def _embed(svg: str, name: str, label: str) -> str:
    """Turns the text of an SVG file into an element of an HTML page.

    Identifiers must be unique on the page. If another part of the SVG refers to an
    identifier, the function puts the figure's name in front of the identifier. The
    function removes all other identifiers.
    """
    svg = svg[svg.index("<svg") :].strip()
    svg = re.sub(r"(?s)<metadata>.*?</metadata>", "", svg)
    svg = re.sub(r"<!--.*?-->", "", svg)
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', svg))

    def kept(match: re.Match[str]) -> str:
        return f' id="{name}-{match[1]}"' if match[1] in used else ""

    svg = re.sub(r' id="([^"]+)"', kept, svg)
    svg = re.sub(r'(href=")#', rf"\1#{name}-", svg)
    svg = svg.replace("url(#", f"url(#{name}-")
    label = html.escape(label.replace("`", ""))
    return svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)


def section(
    anchor: str,
    title: str,
    parts: Iterable[str],
    *,
    level: int = 2,
    fresh: bool = False,
) -> str:
    """Makes a section of a page: a heading and the parts below the heading.

    Args:
        anchor: Identifier of the section, for links.
        title: Plain text of the heading.
        parts: Parts in HTML.
        level: Level of the heading, from 1 to 4.
        fresh: Whether the section begins on a new sheet when the page is printed.

    Returns:
        HTML.
    """
    kind = ' class="fresh"' if fresh else ""
    inner = "\n".join(parts)
    return f"<section{kind}>{heading(level, title, anchor)}\n{inner}</section>"


def page(title: str, contents: Iterable[tuple[str, str]], parts: Iterable[str]) -> str:
    """Makes the whole HTML document.

    Args:
        title: Title of the browser window, and heading of the page.
        contents: Pairs of anchor and title, one pair for each section.
        parts: Parts of the page in HTML.

    Returns:
        HTML with an embedded style sheet. The page loads no other files, apart from its
        pictures.
    """
    links = "".join(
        f'<li><a href="#{html.escape(anchor)}">{html.escape(text)}</a></li>'
        for anchor, text in contents
    )
    inner = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{html.escape(title)}</title><link rel="icon" href="data:,">'
        f"<style>{_CSS}</style></head>\n<body>\n{heading(1, title)}\n"
        f"<nav><ol>{links}</ol></nav>\n{inner}\n<script>{_SCRIPT}</script></body></html>\n"
    )
