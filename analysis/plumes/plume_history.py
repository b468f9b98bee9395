"""The plume of a run again, for pictures: it depends on nothing that robots do."""

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
    """Wind and plume at an instant."""

    time_s: float
    wind: NDArray[np.float64]
    """The port ``wind``."""
    plume: NDArray[np.float64]
    """The port ``plume``."""


def plume_history(scenario: Scenario, end_s: float) -> Iterator[PlumeInstant]:
    """What the ports ``wind`` and ``plume`` of a run were, every 0.1 s.

    Args:
        scenario: That was run; it has an odour.
        end_s: Last instant, s.

    Yields:
        The instants, from 0 on.
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
        # As in a run, each sees the other as it was before this tick.
        before = wind.copy()
        wind_step.step(tick, wind, (), (), wind_step.numbers)
        plume_step.step(tick, plume, (before,), (), plume_step.numbers)


def concentration_map(
    plume: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Concentration on the floor over a grid.

    Args:
        plume: (n,) of the port ``plume``.
        x: (n,) in W, m.
        y: (m,) in W, m.

    Returns:
        (m, n) in units of the gas sensors' C1.
    """
    return np.array([[concentration(plume, u, v) for u in x] for v in y])
