"""Stability against the silence between bursts, for each hold of the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.linear.burst_cycle import HOLDS, Hold, burst_cycle
from analysis.models.equilibria import follow_equilibrium
from analysis.models.linear_models import NEUTRAL
from analysis.models.operating_points import OperatingPoint, motion_model
from diagrams.scenario.scenario import Scenario


@dataclass(frozen=True)
class GapChart:
    """How fast the motion decays, against the silence in each cycle."""

    on_s: float
    """Sound in each cycle, s."""
    gaps_s: NDArray[np.float64]
    """(n,) silence in each cycle, s."""
    holds: tuple[Hold, ...]
    """What the target does meanwhile."""
    multiplier: NDArray[np.float64]
    """(holds, n) largest |multiplier| of a cycle."""
    today: tuple[float, Hold]
    """Silence, s, and hold of the scenario."""

    @property
    def growth_per_s(self) -> NDArray[np.float64]:
        """(holds, n) exponent of the slowest motion, 1/s; negative: decays."""
        return np.asarray(np.log(self.multiplier) / (self.on_s + self.gaps_s))

    def longest_stable_s(self, hold: Hold) -> float:
        """Largest of the gaps up to which every one is stable, s."""
        unstable = self.multiplier[self.holds.index(hold)] >= 1.0
        count = int(np.argmax(unstable)) if unstable.any() else len(unstable)
        return float(self.gaps_s[count - 1]) if count else 0.0


def gap_chart(
    scenario: Scenario,
    *,
    gaps_s: ArrayLike | None = None,
    holds: Sequence[Hold] = HOLDS,
    point: OperatingPoint | None = None,
) -> GapChart:
    """Largest multipliers for many gaps from the ticks of one long cycle.

    A tick's matrix depends on how long ago the sound was heard, and not on how
    long the silence will be, but for the tracker's memory of velocities, which
    does not move P where hearing is exact.

    Args:
        scenario: Any, see ``analysis.linear.burst_cycle.burst_cycle``.
        gaps_s: (n,) multiples of the control period, s; by default 0 to 4 s.
        holds: To compare.
        point: The equilibrium, where it is known already.

    Returns:
        Largest |multiplier| of a cycle for each hold and gap.
    """
    point = point or follow_equilibrium(scenario)
    gaps = np.arange(0.0, 4.01, 0.25) if gaps_s is None else np.asarray(gaps_s, float)
    tick_s = scenario.tick_s
    ticks = np.rint(gaps / tick_s).astype(int)
    on = scenario.source.sound.on_s
    heard, longest = round(on / tick_s), int(ticks.max()) * tick_s
    rows = []
    for hold in holds:
        cycle = burst_cycle(scenario, hold, on_s=on, gap_s=longest, point=point)
        # Over the sound, and so many ticks of silence after it.
        products = list(accumulate(cycle.matrices, lambda done, tick: tick @ done))
        rows.append([_largest(point, products[heard + n - 1]) for n in ticks])
    return GapChart(
        on_s=on,
        gaps_s=ticks * tick_s,
        holds=tuple(holds),
        multiplier=np.array(rows),
        today=(scenario.source.sound.period_s - on, scenario.follower.tracker.hold),
    )


def _largest(point: OperatingPoint, product: NDArray[np.float64]) -> float:
    poles = motion_model(point, product, 1.0).poles
    poles = poles[np.abs(poles - 1.0) > NEUTRAL]
    return float(np.abs(poles).max(initial=0.0))
