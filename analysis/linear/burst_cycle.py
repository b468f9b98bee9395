"""The burst cycle as a periodic system: 0.5 s heard, 1.5 s held, and again.

Between bursts the target is held in W, with the robot, or goes on with its own
velocity. The product of the one-period matrices of a cycle has the multipliers:
what is left after a cycle of what was off before it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.linear.delayed_run import kicked, offsets
from analysis.models.equilibria import follow_equilibrium
from analysis.models.ideal_loop import IdealLoop, ideal_loop
from analysis.models.ideal_scenarios import changed
from analysis.models.linear_models import NEUTRAL
from analysis.models.model_reduction import minimal_model
from analysis.models.open_loops import DIRECTIONS, Direction
from analysis.models.operating_points import OperatingPoint, motion_model
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point

Hold = Literal["world", "robot", "motion"]

#: What the tracker can do between bursts.
HOLDS: tuple[Hold, ...] = ("world", "robot", "motion")

#: Of the response, less than this part of the greatest is no share.
_NO_SHARE = 1e-14
#: Kick that starts a run, m/s.
_KICK_M_S = 1e-5
#: Cycles at rest before the linearisation: the tracker's memory settles.
_SETTLING_CYCLES = 3


@dataclass(frozen=True)
class BurstCycle:
    """Multipliers of the motion over one cycle of the sound, at rest."""

    hold: Hold
    """What the target does between bursts."""
    on_s: float
    """Sound in each cycle, s."""
    period_s: float
    """Length of a cycle, s."""
    along: NDArray[np.complex128]
    """Multipliers over a cycle along the line to the source, largest first; those
    of a continuum of equilibria left out."""
    across: NDArray[np.complex128]
    """The same across the line."""
    matrices: NDArray[np.float64] = field(repr=False)
    """(ticks, n, n) of the whole state, tick after tick of a cycle."""
    loop: IdealLoop = field(repr=False)
    """The build, with bursts."""
    state: NDArray[np.float64] = field(repr=False)
    """At the beginning of a cycle."""
    point: OperatingPoint = field(repr=False)
    """The same equilibrium with a sound that never stops."""

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Of both directions, largest first."""
        both = np.concatenate([self.along, self.across])
        return both[np.argsort(-np.abs(both))]

    @property
    def largest(self) -> float:
        """Largest |multiplier|: below 1 what is off decays."""
        return float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def stable(self) -> bool:
        """Whether all motions decay from cycle to cycle."""
        return self.largest < 1.0


@dataclass(frozen=True)
class BurstRun:
    """A simulated run over many cycles after a small kick."""

    hold: Hold
    """What the target does between bursts."""
    factor: float
    """Fitted growth over a cycle: the largest |multiplier| of that direction."""
    time_s: NDArray[np.float64] = field(repr=False)
    """(n,) s, every tick."""
    offset_m: NDArray[np.float64] = field(repr=False)
    """(n,) of P from the equilibrium in the direction of the kick, m."""


def burst_cycle(
    scenario: Scenario,
    hold: Hold,
    *,
    on_s: float | None = None,
    gap_s: float | None = None,
    point: OperatingPoint | None = None,
) -> BurstCycle:
    """Multipliers at the equilibrium that is nearest to the follow distance.

    Args:
        scenario: Any; its sensors are taken to be ideal, bodies to be at rest.
        hold: In place of ``tracker.hold``.
        on_s: In place of ``sound.on_s``, s.
        gap_s: Silence in each cycle, s, in place of the scenario's.
        point: The equilibrium, where it is known already.

    Returns:
        Multipliers over one cycle, along and across the line to the source.

    Raises:
        InputError: The cycle is no whole number of ticks, or has no sound; or
            there is no stable equilibrium.
    """
    point = point or follow_equilibrium(scenario)
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
        "ideal_hearing": {"burst_gaps": True},
        "sound": {"on_s": on, "period_s": period, "start_s": 0.0},
    }
    return changed(scenario, changes)


def _settled(loop: IdealLoop, point: OperatingPoint, ticks: int) -> NDArray[np.float64]:
    """The state at rest when the robot has listened for some cycles."""
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
    # Rounding, other on another machine, may leave states of the other direction in it,
    # whose share in the response is nothing.
    poles, modes = np.linalg.eig(line.A)
    seen, moved = (line.C @ modes)[0], np.linalg.solve(modes, line.B)[:, 0]
    share = np.abs(seen * moved)
    poles = poles[(np.abs(poles - 1.0) > NEUTRAL) & (share > _NO_SHARE * share.max())]
    return poles[np.argsort(-np.abs(poles))]


def simulate_burst_cycle(
    cycle: BurstCycle, cycles: int = 40, *, direction: Direction = "along"
) -> BurstRun:
    """Runs the diagram after a kick.

    Args:
        cycle: The analysed cycle.
        cycles: To simulate; the first quarter does not count.
        direction: Of the kick: along the line to the source, or across it.

    Returns:
        Growth over a cycle, and the way of P, m, at every tick.
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
    """|z| of the mode pair that is left in equally spaced samples.

    x[n + 2] = a x[n + 1] + b x[n], each row weighed by its own size.
    """
    rows = np.column_stack([samples[1:-1], samples[:-2]])
    size = np.linalg.norm(rows, axis=1)
    a, b = np.linalg.lstsq(rows / size[:, None], samples[2:] / size)[0]
    return float(np.abs(np.roots([1.0, -a, -b])).max())
