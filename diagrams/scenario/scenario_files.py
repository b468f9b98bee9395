"""The files that a scenario names: sounds, and a user's own code."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from diagrams.scenario.own_code import import_own
from diagrams.scenario.own_gains import check_own_gains
from diagrams.scenario.participants import HasMicrophones
from diagrams.scenario.shorthand import field_in
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario


def check_files(scenario: Scenario) -> None:
    """Raises an error if a scenario names files that a run cannot use.

    Such files are sound files and a user's own code. The ``InputError`` lists all of
    them.
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

            robot = name in scenario.robots
            group, sounds = ("robots", "loudspeaker") if robot else ("sources", "sound")
            field = field_in(group, name, f"{sounds}.file")
            check(read_played, sound.file or "", sound.low_hz, field)
    for name, own in scenario.robots.items():
        ears = own.microphones if isinstance(own, HasMicrophones) else None
        if own.listens and ears is not None and ears.ego_noise_file is not None:
            from systems.sound.sound_file import read_noise

            field = field_in("robots", name, "microphones.ego_noise_file")
            check(read_noise, ears.ego_noise_file, len(own.robot.microphones_m), field)
        for code, field in own.own_code.items():
            check(import_own, code, field_in("robots", name, field))
        check(check_own_gains, own, field_in("robots", name, ""))
    if faults:
        raise InputError.joined(faults)
