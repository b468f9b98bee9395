"""A page of text, tables and figures in one file, for the screen and for paper.

Plain functions from text to HTML: each takes plain text, which it escapes, and
returns a string of HTML; whatever takes HTML says so. Nothing on a page needs a
network or a font of its own; its only script lets keyboards scroll what is too wide.
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
#: Variables with the colours of pages, by day and by night.
COLOURS_CSS = (_HERE / "page_colours.css").read_text("utf-8")
_CSS = COLOURS_CSS + (_HERE / "html_page.css").read_text("utf-8")

#: What scrolls by itself is reached by the Tab key, and nothing else is.
_SCRIPT = """
const reach = () => document.querySelectorAll(".wide, .drawing, .equation").forEach(
  (box) => box.scrollWidth > box.clientWidth
    ? box.setAttribute("tabindex", 0) : box.removeAttribute("tabindex"));
addEventListener("resize", reach);
reach();
"""


class Judged(NamedTuple):
    """A number, or a word, above the verdict on it, in one cell."""

    value: complex | str | None
    verdict: str


#: Text, or a number; none is a dash.
Cell = str | complex | Judged | None

#: Stands for a zero among numbers, so that the others are seen.
ZERO = "\u00b7"

#: Cells that are coloured, by their text.
_VERDICT_CLASSES = {
    "pass": "pass",
    "fail": "fail",
    "not applicable": "none",
    "not computed": "none",
}


def heading(level: int, text: str, anchor: str = "") -> str:
    """A heading of level 1 to 4.

    Args:
        level: 1 to 4.
        text: Plain text.
        anchor: What links lead to; empty: none do.

    Returns:
        HTML.
    """
    identity = f' id="{html.escape(anchor)}"' if anchor else ""
    return f"<h{level}{identity}>{html.escape(text)}</h{level}>"


def paragraph(text: str) -> str:
    """A paragraph; `words` between backquotes are set as code."""
    return f"<p>{_inline(text)}</p>"


def links(targets: Iterable[tuple[str, str]]) -> str:
    """A line of links to sections, given as anchor and text."""
    inner = " \u00b7 ".join(
        f'<a href="#{html.escape(anchor)}">{html.escape(text)}</a>'
        for anchor, text in targets
    )
    return f'<p class="links">{inner}</p>'


def note(text: str) -> str:
    """A paragraph that stands out: what a reader must know before the numbers."""
    return f'<p class="note">{_inline(text)}</p>'


def bullets(texts: Iterable[str]) -> str:
    """A list with a dot before each text."""
    return "<ul>" + "".join(f"<li>{_inline(text)}</li>" for text in texts) + "</ul>"


def definitions(rows: Iterable[tuple[str, str]]) -> str:
    """Pairs of term and text, a line each."""
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
    """A table whose columns are as wide as they need to be.

    Args:
        headings: One for each column; all empty: no row of headings.
        rows: Cells; numbers are set to the right, verdicts in their colours. A row
            of a single cell spans the table and heads the rows that follow.
        caption: Stands above.
        dense: In small type, for matrices.

    Returns:
        HTML; a wide table scrolls by itself.
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
    """A number for readers: so many significant digits, a true minus sign.

    Nothing is a dash, a complex number is written as a sum with j.

    Args:
        value: Any; None and NaN are nothing.
        digits: Significant digits of a float; whole numbers keep all of theirs.

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
    """A figure as inline SVG.

    Args:
        figure: Drawn with matplotlib.
        name: Unlike that of any other figure on the page; letters, digits, _.
        caption: Stands below.
        scale: Whether lightness tells how much, so that it stays by night.

    Returns:
        HTML, the same at every run.
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
    """A picture that lies beside the page, as wide as the page.

    Args:
        file: Its name, in the page's directory.
        caption: Stands below.

    Returns:
        HTML; the picture leads to its file.
    """
    label, source = html.escape(caption.replace("`", "")), html.escape(file)
    image = f'<a href="{source}"><img src="{source}" alt="{label}"></a>'
    return _figure(image, caption)


def _figure(drawing: str, caption: str, kind: str = "") -> str:
    """A wide drawing scrolls by itself."""
    opening = f'<figure class="{kind}">' if kind else "<figure>"
    return (
        f'{opening}<div class="drawing">{drawing}</div>'
        f"<figcaption>{_inline(caption)}</figcaption></figure>"
    )


def file_links(files: Iterable[tuple[str, str]]) -> str:
    """A list of files that lie beside the page, given as name and what is in it."""
    lines = [
        f'<li><a href="{html.escape(name)}">{html.escape(name)}</a>: {_inline(text)}'
        for name, text in files
    ]
    return f"<ul>{'</li>'.join([*lines, ''])}</ul>"


def equation(tex: str, name: str, text: str) -> str:
    """A formula in matplotlib's subset of TeX, set off from the text.

    Args:
        tex: Without the dollar signs.
        name: As for ``figure_html``.
        text: The formula in words or plain signs, for those who hear the page.

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
    """An SVG file as an element that shares its page with others.

    Identifiers must differ on a page: those that are referred to get the figure's
    name in front, others are dropped.
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
    """Parts in HTML under a heading.

    Args:
        anchor: Where the contents lead.
        title: Text of the heading.
        parts: HTML.
        level: Of the heading.
        fresh: Whether it begins a sheet of paper.

    Returns:
        HTML.
    """
    kind = ' class="fresh"' if fresh else ""
    inner = "\n".join(parts)
    return f"<section{kind}>{heading(level, title, anchor)}\n{inner}</section>"


def page(title: str, contents: Iterable[tuple[str, str]], parts: Iterable[str]) -> str:
    """The whole document.

    Args:
        title: Of the window and at the top.
        contents: Anchor and title of each section.
        parts: HTML.

    Returns:
        HTML with its style sheet inside; nothing is loaded from elsewhere.
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
