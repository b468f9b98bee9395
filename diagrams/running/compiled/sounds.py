"""The sounds in a compiled run, as functions of the tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.building.robot import seed_of
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.shorthand import fields_of
from systems.framework.host_step import HostFunction
from systems.framework.signals import Emission
from systems.sound.mic_array import microphone_reach
from systems.sound.parameters import SoundParameters
from systems.sound.sound_emitter import emissions_along, history_ticks
from systems.sound.waveforms import make_waveform


class Sounds(NamedTuple):
    """The sounds of a run."""

    heard: dict[str, dict[str, Callable[[int], Emission]]]
    """Emission at a tick, by robot and input port; empty for a robot that hears no
    sound waves."""
    carried: dict[str, HostFunction]
    """For each robot with a loudspeaker: a function that records the pose and velocity
    of the robot. At every tick, the loop calls this function before any robot hears the
    loudspeaker."""
    played: dict[str, Callable[[int], Emission]]
    """Emission at a tick, by source or robot with a loudspeaker; empty if no robot
    hears sound waves."""


def sounds_of_a_run(scenario: Scenario, times: NDArray[np.float64]) -> Sounds:
    """Returns the sounds of all sources and loudspeakers in a run.

    The motion of a source is known in advance. The motion of a robot with a loudspeaker
    is recorded during the run.

    Args:
        scenario: The scenario to run.
        times: (n,) times of the ticks, s.

    Returns:
        The sounds; their functions accept ticks below n.

    Raises:
        InputError: A sound file cannot be played.
    """
    robots = scenario.robots
    sounds = Sounds({name: {} for name in robots}, {}, {})
    hearing = [name for name, own in robots.items() if own.listens]
    ticks = history_ticks(
        microphone_reach(scenario.room, scenario.sound_speed_m_s),
        scenario.sound_speed_m_s,
        scenario.longest_frame_s,
        scenario.tick_s,
    )
    for source, sound in scenario.sounds().items() if hearing else ():
        p_WS, v_WS = np.zeros((2, ticks + len(times), 2))
        on_since: Callable[[], float | None] | None = None
        if source in robots:
            p_WS[:] = robots[source].start.position_m
            motion, calls = (p_WS[ticks:], v_WS[ticks:]), CalledOn()
            sounds.carried[source] = _remembering(*motion, calls, scenario.tick_s)
            if robots[source].searches == "odor":
                on_since = calls.since
        else:
            path = scenario.sources[source].path()
            p_WS[ticks:] = path.poses(times)[:, :2]
            p_WS[:ticks] = p_WS[ticks]
            v_WS[ticks:] = [path.velocity(time)[:2] for time in times.tolist()]
        waveform = _waveform(scenario, source, sound)
        emission = emissions_along(
            p_WS, v_WS, waveform, sound, ticks, scenario.tick_s, on_since
        )
        sounds.played[source] = emission
        for name in hearing:
            followed = scenario.target(name) == source
            sounds.heard[name]["emission" if followed else f"emission_{source}"] = (
                emission
            )
    return sounds


class CalledOn:
    """Time of the first call of a robot, which turns on its loudspeaker."""

    def __init__(self) -> None:
        self.time_s: float | None = None

    def since(self) -> float | None:
        """Returns the time, s; None before the first call."""
        return self.time_s


def _remembering(
    p_WS: NDArray[np.float64],
    v_WS: NDArray[np.float64],
    calls: CalledOn,
    tick_s: float,
) -> HostFunction:
    """Makes a function that records the motion of a robot, and its first call."""

    def remember(tick: int, motion: Any, _: Any) -> None:
        p_WS[tick], v_WS[tick] = motion[:2], motion[3:5]
        if calls.time_s is None and motion[6] > 0.5:
            calls.time_s = tick * tick_s

    return remember


def _waveform(
    scenario: Scenario, source: str, sound: SoundParameters
) -> NDArray[np.float32]:
    robot = source in scenario.robots
    group, field = ("robots", "loudspeaker") if robot else ("sources", "sound")
    with fields_of(group, source, sound=field):
        return make_waveform(sound, seed_of(scenario, "sound_emitter", source))
