"""Finds when loudspeakers sound in a run."""

from __future__ import annotations

import numpy as np

from diagrams import RunResult
from systems.sound.parameters import SoundParameters


def sound_bursts(sound: SoundParameters, end: float) -> list[tuple[float, float]]:
    """Returns start and end, s, of the bursts of a sound until the time ``end``, s.

    Bursts that begin later are left out. A burst that lasts beyond ``end`` is cut off
    at ``end``.
    """
    starts = np.arange(sound.start_s, end, sound.period_s)
    return [(float(t), min(float(t) + sound.on_s, end)) for t in starts]


def call_time(result: RunResult) -> float | None:
    """Returns the time at which a robot begins to call the others, s, or None.

    A robot calls the others after it has found the odor source. The result is the time
    at which the first report of such a find arrives at the sink, the computer of the
    operator. It is None if no report arrives.
    """
    times = [
        float(result.time[np.argmax(values > 0.5)])
        for name, values in result.world.items()
        if name.endswith(".result") and (values > 0.5).any()
    ]
    return min(times, default=None)


def heard_bursts(result: RunResult) -> list[tuple[float, float]]:
    """Returns start and end, s, of the bursts of the source that one robot hears.

    If the source is a robot that searches for odor, there are bursts only after
    ``call_time``. A robot that drives to a goal hears no bursts.
    """
    if result.full_scenario.drives_to_point(result.name):
        return []
    sound, whole = result.scenario.source.sound, result.full_scenario
    caller = whole.robots.get(whole.target(result.name))
    if caller is not None and caller.searches == "odor":
        since = call_time(result)
        if since is None:
            return []
        sound = sound.model_copy(update={"start_s": since + sound.start_s})
    return sound_bursts(sound, result.simulated_s)
