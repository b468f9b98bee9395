"""The blocks of a diagram and the wires between them, as a drawing."""

from analysis.wiring.block_diagram import write_block_diagram
from analysis.wiring.wires import Wire, blocks, wires

__all__ = ["Wire", "blocks", "wires", "write_block_diagram"]
