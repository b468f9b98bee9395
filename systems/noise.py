"""Random numbers that depend on a seed and a tick alone."""

from __future__ import annotations

from numpy.random import SFC64, Generator

__all__ = ["BEFORE_THE_RUN", "tick_generator"]

#: Tick of what is drawn once, when a block is built; no run gets there.
BEFORE_THE_RUN = 2**62


def tick_generator(seed: int, tick: int) -> Generator:
    """A fresh generator for one tick of one block.

    Blocks keep no generator: a context that is run again, or a block that is
    read twice, must see the same noise. SFC64 is numpy's fastest; its start
    from hashed words makes the streams of different ticks independent.
    """
    return Generator(SFC64([seed, tick]))
