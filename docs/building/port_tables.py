"""Port tables of blocks, which stand in docstrings as Drake's own do."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from ruamel.yaml import YAML
from sphinx.util.docutils import SphinxDirective


class PortTable(SphinxDirective):
    """The directive ``pydrake_system``, as a table of inputs and outputs."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """The table."""
        told = YAML(typ="safe").load("\n".join(self.content))
        lines = [".. list-table::", "   :header-rows: 1", "   :class: ports", ""]
        lines += ["   * - input ports", "     - output ports"]
        for mark, side in (("*", "input_ports"), (" ", "output_ports")):
            ports = [
                str(next(iter(port))) if isinstance(port, dict) else str(port)
                for port in told.get(side) or []
            ]
            lines.append(f"   {mark} - " + ("" if ports else "none"))
            lines += [f"       | {port}" for port in ports]
        box = nodes.container()
        self.state.nested_parse(StringList(lines, self.name), 0, box)
        return box.children


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.add_directive("pydrake_system", PortTable)
    return {"parallel_read_safe": True}
