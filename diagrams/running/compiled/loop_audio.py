"""Saves the sound of a run in a compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from diagrams.running.audio.run_audio import LISTENING, RunAudio
from diagrams.running.compiled.plan import LoopPlan, LoopRobot
from diagrams.running.compiled.sounds import Sounds
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame, Emission


def save_sounds(
    plan: LoopPlan, robots: Mapping[str, LoopRobot], sounds: Sounds, audio: RunAudio
) -> None:
    """Makes a loop write the sound at the microphones and loudspeakers at every tick.

    Args:
        plan: Plan of the loop, which contains the robots.
        robots: Robots by name.
        sounds: Sounds of the run.
        audio: Open files for the sound.

    Raises:
        InputError: A robot that listens has no microphones that a compiled loop
            supports.
    """
    for name, ticks in audio.frame_ticks.items():
        robot = robots[name]
        if "audio" not in robot.carried:
            raise InputError(
                "save_audio",
                f"no block of {name} gives frames to a compiled loop; leave "
                "--save-audio out, or run with engine drake",
            )
        frame = robot.carried["audio"]
        asks = LISTENING in robot.made.sizes
        listening = robot.view(LISTENING) if asks else np.ones(1)
        plan.show(listening, partial(_hear, audio, name, frame), ticks)
    for name in audio.loudspeakers:
        function = partial(_play, audio, name, sounds.played[name])
        plan.show(np.ones(1), function, 1)


def _hear(
    audio: RunAudio,
    robot: str,
    frame: Callable[[int], AudioFrame],
    tick: int,
    listening: Any,
    _: Any,
) -> None:
    asked = tick > 0 and listening[0] > 0.5
    audio.hear(robot, tick, frame(tick) if asked else None)


def _play(
    audio: RunAudio,
    name: str,
    emission: Callable[[int], Emission],
    tick: int,
    _: Any,
    __: Any,
) -> None:
    audio.play(name, tick, emission(tick))
