"""Worlds of MRPB: maps of ROS with start and goal poses of several tests.

The folder of a map contains ``map.yaml`` with its image, and ``config.txt``. A heading
``# Test N`` in ``config.txt`` begins a test. Lines below it give its poses: ``<arg
name="initial_pose_x" default="8.671"/>``, and the same for ``initial_pose_y`` (m),
``initial_pose_a`` (rad), ``goal_pose_x`` and ``goal_pose_y``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from diagrams.scenario.worlds.world import World
from systems.framework.input_error import InputError

MAP, TESTS = "map.yaml", "config.txt"
_TEST = re.compile(r"#\s*Test\s+(\w+)")
_VALUE = re.compile(r"<arg\s+name=\"(\w+)\"\s+default=\"([^\"]*)\"\s*/>")
_NEEDED = ("initial_pose_x", "initial_pose_y", "initial_pose_a")
_GOAL = ("goal_pose_x", "goal_pose_y")


def map_tests(folder: Path) -> dict[str, Callable[[], World]]:
    """Returns a function that makes the world of each test, by name of the world.

    The name is that of the map's folder and the number of the test, for example
    ``maze_1``.

    Args:
        folder: Folder of a map, or folder that contains such folders.

    Returns:
        The functions in alphabetical order of the maps. Empty: there are no maps.

    Raises:
        InputError: A file ``config.txt`` is not valid.
    """
    folders = [folder, *sorted(each for each in folder.iterdir() if each.is_dir())]
    found: dict[str, Callable[[], World]] = {}
    for each in folders:
        if (each / MAP).is_file() and (each / TESTS).is_file():
            for number, values in _tests(each / TESTS).items():
                name = f"{each.resolve().name}_{number}"
                found[name] = partial(_world, name, each / MAP, values)
    return found


def _world(name: str, walls: Path, values: dict[str, float]) -> World:
    x, y, heading = (values[key] for key in _NEEDED)
    goal_x, goal_y = (values[key] for key in _GOAL)
    return World(
        name,
        (),
        (x, y),
        math.degrees(math.remainder(heading, 2.0 * math.pi)),
        (goal_x, goal_y),
        map_file=str(walls.resolve()),
    )


def _tests(path: Path) -> dict[str, dict[str, float]]:
    """Returns the values of each test, by number of the test."""
    tests: dict[str, dict[str, float]] = {}
    try:
        lines = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"cannot be read ({error})") from None
    for number, line in enumerate(lines, start=1):
        if heading := _TEST.match(line.strip()):
            tests[heading[1]] = {}
        for name, text in _VALUE.findall(line):
            if not tests:
                raise InputError(
                    str(path),
                    f"line {number} precedes all tests; begin with '# Test 1'",
                )
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise InputError(
                    str(path), f"line {number}: {name} is {text!r}; give a number"
                )
            tests[[*tests][-1]][name] = value
    for test, values in tests.items():
        for name in (*_NEEDED, *_GOAL):
            if name not in values:
                raise InputError(
                    str(path),
                    f'test {test} has no {name}; add <arg name="{name}" default="0"/>',
                )
    if not tests:
        raise InputError(str(path), "has no tests; begin the first with '# Test 1'")
    return tests
