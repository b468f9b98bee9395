"""Stability of the robot's motion as a function of the silence between bursts of sound.

The tracker can hold the target during the silence in several ways (``Hold``). Each way
has its own results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.loops.burst_cycle import HOLDS, Hold, burst_cycle
from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.linear_models import NEUTRAL, growth_per_s
from analysis.loops.operating_points import OperatingPoint, motion_model
from diagrams.scenario.scenario import Scenario


@dataclass(frozen=True)
class GapChart:
    """Decay of P's motion as a function of the silence in each cycle of the sound."""

    on_s: float
    """Duration of the sound in each cycle, s."""
    gaps_s: NDArray[np.float64]
    """(n,) durations of the silence in each cycle, s."""
    holds: tuple[Hold, ...]
    """How the tracker holds the target during the silence."""
    multiplier: NDArray[np.float64]
    """(holds, n) largest |multiplier| over one cycle. Below 1 the motion decays."""
    today: tuple[float, Hold]
    """Duration of the silence, s, and hold in the scenario."""

    @property
    def growth_per_s(self) -> NDArray[np.float64]:
        """(holds, n) growth rates of the slowest motion, 1/s; negative if it decays."""
        return np.asarray(growth_per_s(self.multiplier, self.on_s + self.gaps_s))

    def longest_stable_s(self, hold: Hold) -> float:
        """Longest silence for which this one and all shorter ones are stable, s."""
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
    """Computes how the robot's motion decays, for many durations of the silence.

    The source alternates between sound and silence. A multiplier is an eigenvalue of
    the map over one such cycle. The one-period matrices of one long cycle suffice for
    all durations. Each matrix depends on the time since the last sound, but not on the
    length of the silence to come. The exception is the tracker's memory of velocities.
    With exact hearing this memory does not move the robot.

    Args:
        scenario: Any scenario, see ``analysis.loops.burst_cycle.burst_cycle``.
        gaps_s: (n,) durations of the silence, multiples of the control period, s. The
            default is 0 to 4 s.
        holds: Ways of holding the target to compare: ``world``, ``robot``, ``motion``.
        point: Equilibrium, if it is already known.

    Returns:
        Largest |multiplier| for each hold and duration.
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
        # For each n: product over the sound and n ticks of silence after it.
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
