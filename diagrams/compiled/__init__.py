"""A run as one compiled loop over the same blocks that Drake simulates."""

from diagrams.compiled.loop import CompiledLoop, compile_loop
from diagrams.compiled.loop_blocks import LoopBlocks, shared_blocks

__all__ = ["CompiledLoop", "LoopBlocks", "compile_loop", "shared_blocks"]
