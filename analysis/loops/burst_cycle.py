"""The loop as a periodic system, while the source alternates between sound and silence.

A burst cycle is one period of the source, for example 0.5 s of sound and 1.5 s of
silence. During the silence, the tracker holds the target in the world frame W, holds it
relative to the robot, or moves it at its last estimated velocity.

For each control period, a matrix maps small deviations from an equilibrium at the
beginning of the period to deviations at the end. The product of these matrices over a
cycle maps deviations before the cycle to deviations after it. The eigenvalues of the
product are the multipliers of the cycle.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.loops.delayed_run import kicked, offsets
from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.ideal_loop import IdealLoop, ideal_loop
from analysis.loops.ideal_scenarios import changed
from analysis.loops.linear_models import NEUTRAL, minimal_model
from analysis.loops.open_loops import DIRECTIONS, Direction
from analysis.loops.operating_points import OperatingPoint, motion_model
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point

Hold = Literal["world", "robot", "motion"]

#: How the tracker can hold the target during the silence.
HOLDS: tuple[Hold, ...] = ("world", "robot", "motion")

#: A mode is left out if its share in the response is below this fraction of the largest
#: share.
_NO_SHARE = 1e-14
#: Velocity that the kick adds to the virtual mass, m/s.
_KICK_M_S = 1e-5
#: Number of cycles at rest before the linearization. In this time, the memory of the
#: tracker settles.
_SETTLING_CYCLES = 3


@dataclass(frozen=True)
class BurstCycle:
    """Multipliers of the motion of P over one cycle, about an equilibrium at rest."""

    hold: Hold
    """How the tracker holds the target during the silence."""
    on_s: float
    """Duration of the sound in each cycle, s."""
    period_s: float
    """Duration of a cycle, s."""
    along: NDArray[np.complex128]
    """Multipliers of motions along the line to the source, largest first. Multipliers
    equal to 1, which belong to a continuum of equilibria, are left out."""
    across: NDArray[np.complex128]
    """Multipliers of motions across this line, in the same form."""
    matrices: NDArray[np.float64] = field(repr=False)
    """(ticks, n, n) matrices of the whole state, one for each control period of a
    cycle."""
    loop: IdealLoop = field(repr=False)
    state: NDArray[np.float64] = field(repr=False)
    """(n,) state at the beginning of a cycle."""
    point: OperatingPoint = field(repr=False)
    """The same equilibrium for a sound without pauses."""

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Multipliers of both directions, largest first."""
        both = np.concatenate([self.along, self.across])
        return both[np.argsort(-np.abs(both))]

    @property
    def largest(self) -> float:
        """Largest |multiplier|. If it is below 1, deviations decay."""
        return float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def stable(self) -> bool:
        """Whether all deviations decay from cycle to cycle."""
        return self.largest < 1.0


@dataclass(frozen=True)
class BurstRun:
    """Simulated motion over many cycles after a small change of velocity."""

    hold: Hold
    factor: float
    """Fitted growth factor per cycle, to compare with the largest |multiplier|."""
    time_s: NDArray[np.float64] = field(repr=False)
    """(n,) times of the ends of the control periods, s."""
    offset_m: NDArray[np.float64] = field(repr=False)
    """(n,) deviation of P from the equilibrium in the direction of the kick, m."""


def burst_cycle(
    scenario: Scenario,
    hold: Hold,
    *,
    on_s: float | None = None,
    gap_s: float | None = None,
    point: OperatingPoint | None = None,
) -> BurstCycle:
    """Computes the multipliers at the equilibrium where the robot follows the source.

    The source alternates between ``on_s`` of sound and ``gap_s`` of silence, by default
    those of the scenario. A multiplier is an eigenvalue of the map over one such cycle.
    The calculation assumes exact sensors and bodies at rest. ``point`` is the
    equilibrium, if the caller already knows it. Raises InputError if the cycle is not a
    whole number of control periods or has no sound, or if there is no stable
    equilibrium.
    """
    sound = scenario.source.sound
    on = sound.on_s if on_s is None else on_s
    gap = sound.period_s - sound.on_s if gap_s is None else gap_s
    tick_s = scenario.tick_s
    ticks = (on + gap) / tick_s
    if on <= 0.0 or gap < 0.0 or abs(ticks - round(ticks)) > 1e-6:
        raise InputError(
            "sound",
            f"{on:g} s of sound and {gap:g} s of silence are not a cycle of whole "
            f"ticks; give multiples of {tick_s} s, and some sound",
        )
    point = point or follow_equilibrium(scenario)
    loop = ideal_loop(_with_bursts(point.loop.scenario, hold, on, on + gap))
    state = _settled(loop, point, round(ticks))
    matrices = _matrices(loop, state, round(ticks))
    return BurstCycle(
        hold=hold,
        on_s=on,
        period_s=on + gap,
        along=_multipliers(point, matrices, 0),
        across=_multipliers(point, matrices, 1),
        matrices=matrices,
        loop=loop,
        state=state,
        point=point,
    )


def _with_bursts(scenario: Scenario, hold: Hold, on: float, period: float) -> Scenario:
    changes = {
        "tracker": {"hold": hold, "maximum_age_s": max(6.0, 3.0 * period)},
        "hearing": "ideal",
        "sound": {"on_s": on, "period_s": period, "start_s": 0.0},
    }
    return changed(scenario, changes)


def _settled(loop: IdealLoop, point: OperatingPoint, ticks: int) -> NDArray[np.float64]:
    """State (n,) of the robot at rest after ``_SETTLING_CYCLES`` cycles of the sound.

    ``ticks`` is the number of control periods per cycle.
    """
    x, y = control_point(
        (*point.p_WP, point.theta_WB), -loop.scenario.only.robot.control_point_m
    )
    state, _ = loop.settled_state((x, y, point.theta_WB))
    still = {("command", "acceleration_W"): (0.0, 0.0)}
    return loop.period_map(state, 0.0, fixed=still, periods=_SETTLING_CYCLES * ticks)


def _matrices(
    loop: IdealLoop, state: NDArray[np.float64], ticks: int
) -> NDArray[np.float64]:
    start, found = _SETTLING_CYCLES * ticks, []
    for k in range(start, start + ticks):
        period = loop.period_derivatives(state, k * loop.tick_s)
        found.append(period.A)
        state = period.next_state
    return np.array(found)


def _multipliers(
    point: OperatingPoint, matrices: NDArray[np.float64], direction: int
) -> NDArray[np.complex128]:
    product = np.eye(matrices.shape[1])
    for matrix in matrices:
        product = matrix @ product
    motion = motion_model(point, product, 1.0)
    axis = point.axes[direction]
    line = minimal_model(
        replace(
            motion,
            B=motion.B @ axis[:, None],
            C=axis[None] @ motion.C,
            D=np.zeros((1, 1)),
        )
    )
    # Rounding errors may leave modes of the other direction in the model. Their share
    # in the response is negligible.
    poles, modes = np.linalg.eig(line.A)
    seen, moved = (line.C @ modes)[0], np.linalg.solve(modes, line.B)[:, 0]
    share = np.abs(seen * moved)
    poles = poles[(np.abs(poles - 1.0) > NEUTRAL) & (share > _NO_SHARE * share.max())]
    return poles[np.argsort(-np.abs(poles))]


def simulate_burst_cycle(
    cycle: BurstCycle, cycles: int = 40, *, direction: Direction = "along"
) -> BurstRun:
    """Simulates many cycles of sound and silence after a small kick to the robot.

    The kick changes the velocity of the virtual mass in one direction. The fit of the
    growth factor leaves out the first quarter of the cycles.
    """
    loop, point = cycle.loop, cycle.point
    axis = point.axes[DIRECTIONS.index(direction)]
    state = kicked(point, cycle.state, _KICK_M_S * axis)
    ticks = round(cycle.period_s / loop.tick_s)
    start, plant = _SETTLING_CYCLES * ticks, loop.indices("plant")[:3]
    run = loop.runner(state, start * loop.tick_s)
    poses = []
    for k in range(start, start + cycles * ticks):
        run.advance((k + 1) * loop.tick_s)
        poses.append(run.state()[plant])
    offset = offsets(point, poses, axis)
    once = offset.reshape(cycles, ticks)[cycles // 4 :, -1]
    factor = _dominant_factor(once)
    time_s: NDArray[np.float64] = loop.tick_s * np.arange(1.0, len(offset) + 1)
    return BurstRun(cycle.hold, factor, time_s, offset)


def _dominant_factor(samples: NDArray[np.float64]) -> float:
    """|z| of the dominant mode or pair of modes in equally spaced samples.

    The samples are fitted by x[n + 2] = a x[n + 1] + b x[n]. Each equation is weighted
    by the inverse of the norm of (x[n + 1], x[n]).
    """
    rows = np.column_stack([samples[1:-1], samples[:-2]])
    size = np.linalg.norm(rows, axis=1)
    a, b = np.linalg.lstsq(rows / size[:, None], samples[2:] / size)[0]
    return float(np.abs(np.roots([1.0, -a, -b])).max())
