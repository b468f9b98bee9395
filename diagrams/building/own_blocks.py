"""A user's own blocks in a robot."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from diagrams.scenario.own_code import import_own, made
from systems.framework.block import Block
from systems.framework.input_error import InputError


def with_own_blocks(
    blocks: Mapping[str, Any], names: tuple[str, ...], parts: Mapping[str, Any]
) -> dict[str, Any]:
    """A robot's blocks by part, a user's own among them.

    Args:
        blocks: Ours by part.
        names: Of the user's own, ``package.module:Name`` or ``path/to/file.py:Name``;
            one stands in the place of ours of its part.
        parts: What its ``__init__`` may ask for, by the names of its arguments.

    Returns:
        Blocks by part: a copy with the user's own in their places.

    Raises:
        InputError: Two of them have one part, or there is no such block, it does not
            say what it is, or it cannot be made.
    """
    joined, own = dict(blocks), set()
    for name in names:
        block = _own_block(name, parts)
        part = block.part
        if part in own:
            raise InputError(
                "blocks",
                f"{name!r} is a second {part!r}; give each block a part of its own",
            )
        own.add(part)
        joined[part] = block
    return joined


def _own_block(name: str, parts: Mapping[str, Any]) -> Any:
    found = import_own(name, "blocks")
    if not (inspect.isclass(found) and issubclass(found, Block)):
        raise InputError(
            "blocks", f"{name!r} is not a Block; derive its class from systems.Block"
        )
    if not found.part:
        raise InputError(
            "blocks",
            f"{name!r} does not state its part; give the class an attribute part, "
            'as part = "rear_sonar"',
        )
    block = made(name, "blocks", found, parts)
    if not block.get_name():
        block.set_name(found.__name__)
    return block
