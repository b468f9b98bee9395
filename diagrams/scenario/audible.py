"""Checks whether a run has sound that can be saved."""

from __future__ import annotations

from diagrams.scenario.participants import HasMicrophones
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.shorthand import field_in
from systems.framework.input_error import InputError
from systems.framework.signals import SAMPLE_RATE_HZ
from systems.sound.wav_writer import LARGEST_WAV_BYTES

#: Bytes per sample in the files of microphones and loudspeakers.
HEARD_BYTES, PLAYED_BYTES = 2, 4


def check_audible(scenario: Scenario) -> None:
    """Raises an error if a scenario has no sound that can be saved in WAV files.

    Args:
        scenario: The scenario to run.

    Raises:
        InputError: No robot hears sound waves.
        InputError: A sample rate is not a whole number of Hz.
        InputError: A file would exceed the maximum size of WAV files.
    """
    robots = scenario.robots
    listening = [name for name, own in robots.items() if own.listens]
    if not listening:
        ideal = any(not own.has_goal for own in robots.values())
        why = " (hearing is ideal)" if ideal else ""
        remedy = (
            "set hearing=audio"
            if ideal
            else ("use a scenario with a robot that follows a sound")
        )
        raise InputError(
            "save_audio",
            f"no robot hears sound waves{why}; {remedy}, or leave --save-audio out",
        )
    _check_size("of loudspeakers", SAMPLE_RATE_HZ * PLAYED_BYTES, scenario.duration_s)
    for name in listening:
        own = robots[name]
        assert isinstance(own, HasMicrophones)
        rate = own.microphones.sample_rate_hz
        if rate != round(rate):
            raise InputError(
                field_in("robots", name, "microphones.sample_rate_hz"),
                f"{rate} Hz is not a whole number, which sound files need; use "
                f"{round(rate)}, or leave --save-audio out",
            )
        a_second = len(own.robot.microphones_m) * rate * HEARD_BYTES
        _check_size(f"of {name}", a_second, scenario.duration_s)


def _check_size(whose: str, bytes_a_second: float, duration_s: float) -> None:
    longest = LARGEST_WAV_BYTES / bytes_a_second
    if duration_s > longest:
        raise InputError(
            "duration_s",
            f"{duration_s:g} s of the sound {whose} exceed the 4 GB that a WAV "
            f"file can hold; set {int(longest)} or less, or leave --save-audio "
            "out",
        )
