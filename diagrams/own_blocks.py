"""A user's own blocks: made with what they ask for, and put in their places."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import LeafSystem

from diagrams.own_code import asked_for, import_own, why
from systems.framework.block_facts import BlockFacts
from systems.framework.input_error import InputError

__all__ = ["make_own_block", "with_own_blocks"]


def with_own_blocks(
    blocks: Mapping[str, Any], names: tuple[str, ...], parts: Mapping[str, Any]
) -> dict[str, Any]:
    """A robot's blocks by part, a user's own among them.

    Args:
        blocks: Ours by part.
        names: Of the user's own; one stands in the place of ours of its part.
        parts: What a block may ask for, see ``make_own_block``.

    Returns:
        Blocks by part: a copy with the user's own in their places.

    Raises:
        InputError: Two of them have one part, or see ``make_own_block``.
    """
    joined, own = dict(blocks), set()
    for name in names:
        block = make_own_block(name, parts)
        part = block.FACTS.part
        if part in own:
            raise InputError(
                "blocks", f"{name!r} is a second {part!r}; give each a part of its own"
            )
        own.add(part)
        joined[part] = block
    return joined


def make_own_block(name: str, parts: Mapping[str, Any]) -> Any:
    """Makes a block of a user's.

    Args:
        name: ``package.module:Name`` or ``path/to/file.py:Name``.
        parts: What its ``__init__`` may ask for, by the names of its arguments.

    Returns:
        The block, a LeafSystem with a name.

    Raises:
        InputError: There is no such block, it does not say what it is, or it cannot
            be made.
    """
    found = import_own(name, "blocks")
    if not (inspect.isclass(found) and issubclass(found, LeafSystem)):
        raise InputError("blocks", f"{name!r} is no LeafSystem; derive it from that")
    if not isinstance(getattr(found, "FACTS", None), BlockFacts):
        raise InputError(
            "blocks",
            f"{name!r} does not say what it is; give it an attribute FACTS, "
            "BlockFacts(part, stage)",
        )
    try:
        block = found(**asked_for(found, parts))
    except (Exception, SystemExit) as error:
        raise InputError(
            "blocks",
            f"{name!r} cannot be made ({why(error)}); it may ask for "
            f"{', '.join(parts)}",
        ) from error
    if not block.get_name():
        block.set_name(found.__name__)
    return block
