"""Recomputes the odor plume of a run for pictures.

The log of a run does not contain the plume. The plume does not depend on the robots, so
the scenario is sufficient to compute the plume again.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.building.robot import world_seeds
from diagrams.building.world_blocks import world_blocks
from diagrams.scenario.scenario import Scenario
from systems.odor.odor_plume import concentration


class PlumeInstant(NamedTuple):
    """Wind and plume at one instant."""

    time_s: float
    wind: NDArray[np.float64]
    """Values of the port ``wind``."""
    plume: NDArray[np.float64]
    """Values of the port ``plume``."""


def plume_history(scenario: Scenario, end_s: float) -> Iterator[PlumeInstant]:
    """Yields the values of the ports ``wind`` and ``plume`` every 0.1 s, from 0 on.

    They are equal to the values in a run of the scenario until ``end_s``, s. If the
    scenario has no plume, the result is empty.
    """
    blocks = world_blocks(scenario, world_seeds(scenario))
    if "plume" not in blocks:
        return
    wind_step, plume_step = blocks["wind"].step, blocks["plume"].step
    wind: Any = np.array(wind_step.state)
    plume: Any = np.array(plume_step.state)
    for tick in range(int(end_s / scenario.tick_s + 1e-9) + 1):
        if tick % wind_step.numbers.period == 0:
            yield PlumeInstant(tick * scenario.tick_s, wind.copy(), plume.copy())
        # As in a run, the plume reads the wind from before the update of this tick.
        before = wind.copy()
        wind_step.step(tick, wind, (), (), wind_step.numbers)
        plume_step.step(tick, plume, (before,), (), plume_step.numbers)


def concentration_map(
    plume: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Computes concentrations of the odor on a grid with (n,) x and (m,) y in W, m.

    ``plume`` is the value of the port ``plume``. The result has the shape (m, n). Its
    unit is C1, the constant of the gas sensors.
    """
    return np.array([[concentration(plume, u, v) for u in x] for v in y])
