"""The files that a scenario names: sounds, and a user's own code."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from diagrams.scenario.own_code import import_own
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario


def check_files(scenario: Scenario) -> None:
    """Refuses files that a run cannot use, before the simulation is loaded.

    Args:
        scenario: The scenario to check.

    Raises:
        InputError: Files are missing or unusable; the error lists all of them.
    """
    faults: list[InputError] = []

    def check(read: Callable[..., Any], *arguments: Any) -> None:
        try:
            read(*arguments)
        except InputError as error:
            faults.append(error)

    for name, sound in scenario.sounds().items():
        if sound.kind == "wav":
            from systems.sound.sound_file import read_played

            field = f"{scenario.sound_field(name)}.file"
            check(read_played, sound.file or "", sound.low_hz, field)
    for prefix, robot in scenario.robot_fields():
        noise = robot.microphones.ego_noise_file
        if noise is not None and robot.listens:
            from systems.sound.sound_file import read_noise

            field = f"{prefix}microphones.ego_noise_file"
            check(read_noise, noise, len(robot.robot.microphones_m), field)
        if ":" in robot.law:
            check(import_own, robot.law, f"{prefix}law")
        for block in robot.blocks:
            check(import_own, block, f"{prefix}blocks")
    if faults:
        raise InputError.joined(faults)
