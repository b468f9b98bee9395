"""Adds a user's own blocks to a robot."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from diagrams.scenario.own_classes import made
from diagrams.scenario.own_code import import_own
from diagrams.scenario.own_gains import check_own_gains, set_gains
from diagrams.scenario.participants import Robot
from systems.framework.block import Block
from systems.framework.input_error import InputError


def with_own_blocks(
    blocks: Mapping[str, Any], robot: Robot, parts: Mapping[str, Any]
) -> dict[str, Any]:
    """Adds a user's own blocks to the blocks of a robot.

    The part of a block is its role in the robot, such as ``plant``. A user's block
    replaces the package's block with the same part.

    Args:
        blocks: Blocks of the package, by part.
        robot: The robot, whose field ``blocks`` names the user's blocks.
        parts: Values of the arguments that the constructor of a user's block can take,
            by name of the argument.

    Returns:
        A new mapping of blocks by part.

    Raises:
        InputError: Two of the user's blocks have the same part.
        InputError: A block does not exist, does not state its part, or cannot be made.
        InputError: None of the robot's blocks, and not its law, has one of its gains.
    """
    joined, own = dict(blocks), set()
    check_own_gains(robot)
    for name in robot.blocks:
        block = _own_block(name, robot, parts)
        part = block.part
        if part in own:
            raise InputError(
                "blocks",
                f"{name!r} is a second {part!r}; give each block a part of its own",
            )
        own.add(part)
        joined[part] = block
    return joined


def _own_block(name: str, robot: Robot, parts: Mapping[str, Any]) -> Any:
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
    block = made(name, "blocks", found, {**parts, **set_gains(found, robot.own_gains)})
    if not block.get_name():
        block.set_name(found.__name__)
    return block
