"""Writes contents of reports as HTML, as pages, and as text for a terminal.

Pages come from one template, ``page.html.j2``, which escapes all texts. A page needs no
network connection and no fonts of its own. Its only script allows scrolling with the
keyboard through wide tables and figures.
"""

from __future__ import annotations

import html as escaping
import io
import re
import textwrap
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure as Drawing
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

from analysis.report.provenance import made_by
from analysis.report.references import cited_in
from analysis.report.section import (
    ZERO,
    Bullets,
    Cell,
    Column,
    Content,
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

_HERE = Path(__file__).parent
#: CSS variables with the colors of pages, in light mode and in dark mode.
COLORS_CSS = (_HERE / "page_colors.css").read_text("utf-8")

#: Style classes of cells that have a color, by the text of the cell.
_COLORS = {
    "pass": "pass",
    "fail": "fail",
    "undecided": "none",
    "not applicable": "none",
    "not computed": "none",
}
#: Width of the text in a terminal, in characters.
_COLUMNS = 88


def html(content: Content, name: str = "", level: int = 2) -> Markup:
    """Returns a paragraph, table, figure, section or other content as HTML.

    If the content is a section, ``name`` is its anchor, and ``level`` is the level of
    its heading, 1 to 4. If the content is a figure or a formula, all identifiers in its
    SVG begin with ``name``. Each name must be unique on the page.
    """
    return Markup(_template().show(content, name, level))


def heading(text: str) -> Markup:
    """Returns a heading inside a section of a page as HTML."""
    return Markup("<h3>{}</h3>").format(text)


def page(title: str, contents: Iterable[tuple[str, str]], parts: Iterable[str]) -> str:
    """Returns a whole HTML document with an embedded style sheet.

    The argument ``parts`` contains the sections as HTML, and ``contents`` contains the
    anchor and the title of each section. The page loads no other files, apart from its
    pictures. At its end, it lists the references that its text cites, and states the
    date and the version.
    """
    shown = [Markup(part) for part in parts]
    listed = list(contents)
    if cited := cited_in("".join(shown)):
        section = Section("references", "References", [Definitions(cited.items())])
        shown.append(html(section, section.key))
        listed.append(("references", "References"))
    return f"{_template().page(title, listed, shown, made_by())}\n"


def text(content: Content) -> str:
    """Returns content as plain text for a terminal; of a figure, only the caption."""
    match content:
        case Section():
            title = f"{content.title}\n{'-' * len(content.title)}"
            lines = "\n\n".join([title, *map(text, content.contents)])
        case Table():
            lines = _table_text(content)
        case Bullets():
            lines = "\n".join(_wrapped(f"- {each}", "  ") for each in content.texts)
        case Definitions() | Files():
            lines = "\n".join(_wrapped(f"{a}: {b}", "  ") for a, b in content.rows)
        case Links():
            lines = ", ".join(title for _, title in content.targets)
        case Note() | Formula():
            lines = _wrapped(content.text)
        case Figure() | Picture():
            lines = _wrapped(f"Figure: {content.caption}")
        case Markup():
            lines = content.striptags()
        case _:
            lines = _wrapped(content)
    return lines


def _wrapped(line: str, indent: str = "") -> str:
    return textwrap.fill(line, _COLUMNS, subsequent_indent=indent)


def _table_text(table: Table) -> str:
    heads, rows = table.heads, list(table.rows)
    whole = [row for row in rows if len(row) == len(heads)]
    columns = [
        _column_text(head, [row[k] for row in whole]) for k, head in enumerate(heads)
    ]
    head, *lines = ["  ".join(words).rstrip() for words in zip(*columns, strict=True)]
    body = iter(lines)
    return "\n".join(
        [
            *([table.caption] if table.caption else []),
            *([head] if head else []),
            *(next(body) if len(row) == len(heads) else str(row[0]) for row in rows),
        ]
    )


def _column_text(head: Column, cells: Sequence[Cell]) -> list[str]:
    """Returns a heading and cells of equal width, aligned left if a cell is a text."""
    words = [head.heading, *(_cell_text(cell, head.digits) for cell in cells)]
    width = max(map(len, words))
    left = any(isinstance(cell, str) and cell != ZERO for cell in cells)
    return [word.ljust(width) if left else word.rjust(width) for word in words]


def _cell_text(cell: Cell, digits: int) -> str:
    if isinstance(cell, Judged):
        verdict = {"not applicable": "n/a"}.get(cell.verdict, cell.verdict)
        return f"{_cell_text(cell.value, digits)}  {verdict:>4}"
    if isinstance(cell, str):
        return cell.replace("\u2212", "-")
    return number(cell, digits).replace("\u2212", "-")


@cache
def _template() -> Any:
    environment = Environment(
        loader=FileSystemLoader(_HERE),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {
        "kind": lambda item: type(item).__name__,
        "inline": _inline,
        "number": number,
        "color": lambda word: _COLORS.get(word.lower(), ""),
        "drawing": lambda item, name: figure_svg(item.draw(), name, item.caption),
        "formula": lambda item, name: formula_svg(item.tex, name, item.text),
    }
    environment.globals |= {
        "ZERO": ZERO,
        "CSS": Markup(COLORS_CSS + (_HERE / "html_page.css").read_text("utf-8")),
        "SCRIPT": Markup((_HERE / "page.js").read_text("utf-8")),
    }
    return environment.get_template("page.html.j2").module


def _inline(line: str) -> Markup:
    """Escapes a text; text between backquotes becomes code."""
    plain = escaping.escape(line, quote=False)
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", plain))


def figure_svg(figure: Drawing, name: str, label: str) -> Markup:
    """Returns a figure as an SVG element; the same figure always gives the same HTML.

    All identifiers in the SVG begin with ``name``, which must be unique on the page. A
    name consists of letters, digits, hyphens and underscores. The label is for screen
    readers.
    """
    stream = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(
            stream,
            format="svg",
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    width, height = figure.get_size_inches()
    shape = "tall" if height > width else "square" if height > 0.9 * width else ""
    return _embed(stream.getvalue(), name, label, shape)


def formula_svg(tex: str, name: str, label: str) -> Markup:
    """Returns a formula as an SVG element; see ``figure_svg`` for name and label.

    The formula is in matplotlib's subset of TeX, without dollar signs.
    """
    stream = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": name, "mathtext.fontset": "cm"}):
        math_to_image(
            f"${tex}$", stream, prop=FontProperties(size=13), dpi=72, format="svg"
        )
    return _embed(stream.getvalue().decode(), name, label)


def _embed(svg: str, name: str, label: str, shape: str = "") -> Markup:
    """Turns the text of an SVG file into an element of an HTML page.

    On paper, a drawing of the shape ``tall`` may fill the page, and two drawings of the
    shape ``square`` are side by side.

    Identifiers must be unique on the page. If another part of the SVG refers to an
    identifier, the function puts the drawing's name in front of the identifier. The
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
    label = escaping.escape(label.replace("`", ""))
    kind = f' class="{shape}"' if shape else ""
    start = f'<svg{kind} role="img" aria-label="{label}" '
    return Markup(svg.replace("<svg ", start, 1))
