"""Checks of robots that search."""

from __future__ import annotations

from collections.abc import Mapping

from diagrams.scenario.participants import FollowerParameters
from diagrams.scenario.run_parameters import RunParameters
from systems.framework.input_error import InputError
from systems.search.parameters import CALLER


def address_of_robot(robot: FollowerParameters) -> int:
    """Returns the address of a searching robot in its radio frames.

    Args:
        robot: A robot that searches.

    Returns:
        1 to 3.
    """
    smells = robot.searches == "odor"
    return robot.search.address if smells else robot.sound_search.address


def check_searches(
    robots: Mapping[str, tuple[str, FollowerParameters]], run: RunParameters
) -> None:
    """Refuses searches without a source, or without the necessary sensors.

    Args:
        robots: Robots by name, each with the prefix of its fields in messages.
        run: Fields of the run.

    Raises:
        InputError: A searching robot lacks its source or a sensor, has a guard, or has
            the address of another robot. The error names the field and the remedy.
    """
    searching = {name: each for name, each in robots.items() if each[1].searches}
    taken: dict[int, str] = {}
    for name, (prefix, robot) in searching.items():
        group = "search" if robot.searches == "odor" else "sound_search"
        if robot.searches == "odor":
            _check_odor(prefix, run)
        else:
            _check_sound(prefix, robot, robots)
        if robot.guard is not None:
            raise InputError(
                f"{prefix}guard",
                f"is set, but law {robot.law!r} drives the motors itself; leave guard "
                "out",
            )
        address = address_of_robot(robot)
        if address in taken:
            raise InputError(
                f"{prefix}{group}.address",
                f"{address} is that of robot {taken[address]!r}; give each robot "
                "its own address, 1 to 3",
            )
        taken[address] = name


def _check_odor(prefix: str, run: RunParameters) -> None:
    if run.odor is None:
        raise InputError(
            "odor",
            f"is missing, and {prefix}law 'plume_search' searches for one; set "
            "odor.position_m",
        )
    if run.room is not None and not run.room.contains(run.odor.position_m):
        x, y = run.odor.position_m
        raise InputError(
            "odor.position_m",
            f"({x:g}, {y:g}) is outside the room, which begins at "
            f"{tuple(run.room.corner.tolist())} and is {run.room.size_m} m; move it, "
            "or set room.corner_m",
        )


def _check_sound(
    prefix: str,
    robot: FollowerParameters,
    robots: Mapping[str, tuple[str, FollowerParameters]],
) -> None:
    if robot.hearing != "audio":
        raise InputError(
            f"{prefix}hearing",
            f"is {robot.hearing!r}, but law 'sound_search' needs the sound waves "
            "for cross-power spectra; set it to audio",
        )
    if len(robot.robot.microphones_m) < 4:
        raise InputError(
            f"{prefix}robot.microphones_m",
            f"has {len(robot.robot.microphones_m)} microphones, but law "
            "'sound_search' needs four, with the first in the middle; use "
            "robot.preset song2011_hearing",
        )
    called = any(
        other.searches == "odor" and other.search.address == CALLER
        for _, other in robots.values()
    )
    if robot.sound_search.await_call and not called:
        raise InputError(
            f"{prefix}sound_search.await_call",
            f"is on, but no robot that smells has the radio address {CALLER}, so that "
            "no robot calls; set it to false, or give a robot law plume_search and "
            f"search.address {CALLER}",
        )
