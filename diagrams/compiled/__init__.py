"""A run as one compiled loop over the same blocks that Drake simulates."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from diagrams.compiled.loop import CompiledLoop, compile_loop
    from diagrams.compiled.loop_blocks import LoopBlocks, shared_blocks
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["CompiledLoop", "LoopBlocks", "compile_loop", "shared_blocks"]
