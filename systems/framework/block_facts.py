"""What a block says of itself, for logs, linear models and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from systems.framework.block import STAGES as STAGES, Stage as Stage, _Declared, part_of


@dataclass(frozen=True)
class BlockFacts:
    """A block's place in the whole, and names of what its ports and states hold.

    A block says it in its attribute ``FACTS``; one that does not is a controller.
    """

    part: str
    """What it is to its robot or source, as ``plant`` or ``tracker``: blocks that
    can stand in for one another have one part."""
    stage: Stage
    """Where in the signal's way it stands."""
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Output ports that a run's table has, and for each element its column's name;
    units are those of the block's port table."""
    states: tuple[str, ...] = ()
    """Names of the elements of its state, continuous first, group after group."""


def block_facts(block: Any) -> BlockFacts:
    """What a block says of itself; of a block without facts, that it controls."""
    if isinstance(block, _Declared):
        return BlockFacts(
            part_of(block), block.stage, block.columns, tuple(block.states)
        )
    facts = getattr(block, "FACTS", None)
    if isinstance(facts, BlockFacts):
        return facts
    return BlockFacts("controller", "control")
