"""What sounds in a compiled run: functions of the tick, known beforehand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from diagrams.robot import naming_sounds, seed_of
from diagrams.scenario import Scenario
from systems.framework.signals import Emission
from systems.sound.mic_array import microphone_reach
from systems.sound.sound_emitter import emissions_along, history_ticks
from systems.sound.waveforms import make_waveform

__all__ = ["emissions_at_ticks"]


def emissions_at_ticks(
    scenario: Scenario, times: NDArray[np.float64]
) -> dict[str, dict[str, Callable[[int], Emission]]]:
    """What robots hear of sources, on which nothing acts back.

    Args:
        scenario: Its robots carry no loudspeakers.
        times: (n,) of the ticks, s.

    Returns:
        Of each robot, by its input port, the emission at a tick below n; nothing where
        it hears no waves.

    Raises:
        InputError: A sound file cannot be played.
    """
    heard: dict[str, dict[str, Callable[[int], Emission]]] = {
        name: {} for name in scenario.all_robots
    }
    hearing = [
        name for name, own in scenario.all_robots.items() if own.hearing == "audio"
    ]
    for source, parameters in scenario.all_sources.items() if hearing else ():
        path, sound = parameters.path(), parameters.sound
        with naming_sounds(scenario, source, sound):
            waveform = make_waveform(sound, seed_of(scenario, "sound_emitter", source))
        emission = emissions_along(
            path.poses(times),
            np.array([path.velocity(time) for time in times.tolist()]),
            waveform,
            sound,
            history_ticks(
                microphone_reach(scenario.room, scenario.acoustics),
                scenario.acoustics.c,
                scenario.longest_frame_s,
                scenario.tick_s,
            ),
            scenario.tick_s,
        )
        for name in hearing:
            followed = scenario.target(name) == source
            heard[name]["emission" if followed else f"emission_{source}"] = emission
    return heard
