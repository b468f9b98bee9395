"""Drawings and formulas as inline SVG, with identifiers that are unique on a page."""

from __future__ import annotations

import html
import io
import re

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image


def figure_svg(figure: Figure, name: str, label: str) -> Markup:
    """Returns a matplotlib figure as an SVG element.

    Args:
        figure: The figure.
        name: Beginning of all identifiers in the SVG: letters, digits, hyphens and
            underscores. Each drawing of a page needs a different name.
        label: Text for screen readers.

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
    return _embed(stream.getvalue(), name, label)


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


def _embed(svg: str, name: str, label: str) -> Markup:
    """Turns the text of an SVG file into an element of an HTML page.

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
    label = html.escape(label.replace("`", ""))
    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1))
