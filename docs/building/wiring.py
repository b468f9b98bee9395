"""Wiring, written as chains ``Block -- ports --> Block``, as rows of boxes.

GitHub draws these with Mermaid, a script of megabytes; boxes in rows can be read on a
phone as well.
"""

from __future__ import annotations

import re
from html import escape
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

__all__ = ["setup"]


class Wiring(SphinxDirective):
    """The ``mermaid`` fence of a flow chart; other charts are refused."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """The rows.

        Raises:
            ExtensionError: A line is no chain.
        """
        first, *chains = (line.strip() for line in self.content if line.strip())
        if not first.startswith("flowchart"):
            raise self.error(f"no flow chart: {first}")
        rows = "".join(f"<li>{self._row(chain)}</li>" for chain in chains)
        return [nodes.raw("", f'<ul class="wiring">{rows}</ul>', format="html")]

    def _row(self, chain: str) -> str:
        blocks = re.split(r" -- (.+?) --> ", chain)
        if len(blocks) < 3:
            raise self.error(f"no chain of blocks: {chain}")
        return " ".join(
            f'<span class="ports">{escape(part)} →</span>'
            if number % 2
            else " ".join(f"<code>{escape(b)}</code>" for b in part.split(" & "))
            for number, part in enumerate(blocks)
        )


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.add_directive("mermaid", Wiring)
    return {"parallel_read_safe": True}
