"""Formulas as MathML, which browsers draw by themselves: no script, no network.

The font is that of ziamath: few systems have one with brackets that grow.
"""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"
    app.config.html_static_path.append(str(files("ziamath") / "fonts"))
    return {"parallel_read_safe": True}


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(_mathml(node, "inline"))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{_mathml(node, "block")}</div>')
    raise nodes.SkipNode


def _mathml(node: nodes.Node, display: str) -> str:
    """Bars are as high as letters and close; as converted they are relations."""
    drawn = convert(node.astext(), display=display)
    return re.sub(
        r'<mo(?: stretchy="false")?>(&#x0(?:007C|2016);)',
        r'<mo stretchy="false" lspace="0" rspace="0">\1',
        drawn,
    )
