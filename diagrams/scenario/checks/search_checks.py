"""Checks of robots that search."""

from __future__ import annotations

from collections.abc import Mapping

from diagrams.scenario.participants import OdorSearcher, Robot, SoundSearcher
from diagrams.scenario.run_parameters import RunParameters
from systems.framework.input_error import InputError
from systems.search.parameters import CALLER


def address_of_robot(robot: OdorSearcher | SoundSearcher) -> int:
    """Returns the address of a searching robot in its radio frames, 1 to 3."""
    own = robot.search if isinstance(robot, OdorSearcher) else robot.sound_search
    return own.address


def check_searches(robots: Mapping[str, Robot], run: RunParameters) -> None:
    """Raises an error if a robot searches, but lacks its source or a necessary sensor.

    Args:
        robots: Robots of the scenario, by name.
        run: Fields of the run that belong to no robot.

    Raises:
        InputError: A searching robot lacks its source or a sensor.
        InputError: Two robots have the same radio address.
    """
    taken: dict[int, str] = {}
    for name, robot in robots.items():
        if isinstance(robot, OdorSearcher):
            group = "search"
            _check_odor(run)
        elif isinstance(robot, SoundSearcher):
            group = "sound_search"
            _check_sound(f"robots.{name}.", robot, robots)
        else:
            continue
        address = address_of_robot(robot)
        if address in taken:
            raise InputError(
                f"robots.{name}.{group}.address",
                f"{address} is that of robot {taken[address]!r}; give each robot "
                "its own address, 1 to 3",
            )
        taken[address] = name


def _check_odor(run: RunParameters) -> None:
    if run.odor is None:
        raise InputError(
            "odor",
            "is missing, and law 'plume_search' searches for one; set odor.position_m",
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
    prefix: str, robot: SoundSearcher, robots: Mapping[str, Robot]
) -> None:
    if len(robot.robot.microphones_m) < 4:
        raise InputError(
            f"{prefix}robot.microphones_m",
            f"has {len(robot.robot.microphones_m)} microphones, but law "
            "'sound_search' needs four, with the first in the middle; use "
            "robot.preset song2011_hearing",
        )
    called = any(
        isinstance(other, OdorSearcher) and other.search.address == CALLER
        for other in robots.values()
    )
    if robot.sound_search.await_call and not called:
        raise InputError(
            f"{prefix}sound_search.await_call",
            f"is on, but no robot that smells has the radio address {CALLER}, so that "
            "no robot calls; set it to false, or give a robot law plume_search and "
            f"search.address {CALLER}",
        )
