"""The blocks of a diagram and the wires between them, as a drawing."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.wiring.block_diagram import write_block_diagram
    from analysis.wiring.wires import Wire, blocks, wires
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["Wire", "blocks", "wires", "write_block_diagram"]
