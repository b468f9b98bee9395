"""Simulation of the diagram with exact sensors and one additional delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.delay_margin import DelayMargin, DelayPlace, delay_margin
from analysis.loops.open_loops import DIRECTIONS, Direction
from analysis.loops.operating_points import OperatingPoint
from systems.framework.input_error import InputError
from systems.hearing.ideal_source_sensor import relative_position

#: Change of velocity that starts the motion, m/s. The motion is far above rounding
#: errors and still so small that it is linear.
_KICK_M_S = 1e-6


@dataclass(frozen=True)
class DelayedRun:
    """Simulated motion about an operating point after a small change of velocity."""

    delay_s: float
    duration_s: float
    growth_per_s: float
    """Fitted growth rate of the envelope, 1/s; negative if the motion decays."""
    frequency_rad_s: float
    """Fitted frequency, rad/s; 0 if the motion has fewer than three peaks."""
    time_s: NDArray[np.float64] = field(repr=False)
    """(n,) times of the ends of the control periods, s."""
    offset_m: NDArray[np.float64] = field(repr=False)
    """(n,) deviation of P from the operating point in the direction of the kick, m."""


@dataclass(frozen=True)
class DelayCheck:
    """Computed delay margin, and two simulated runs with delays below and above it."""

    margin: DelayMargin
    below: DelayedRun
    """Run with 0.95 of the delay margin. Its motion should decay."""
    above: DelayedRun
    """Run with 1.05 of the delay margin. Its motion should grow."""

    @property
    def confirmed(self) -> bool:
        """Whether the run below the margin decays and the run above it grows."""
        return self.below.growth_per_s < 0.0 < self.above.growth_per_s


def check_delay_margin(
    point: OperatingPoint,
    at: DelayPlace = "sensor",
    direction: Direction = "along",
    *,
    duration_s: float = 300.0,
) -> DelayCheck:
    """Simulates the loop with delays of 0.95 and 1.05 of its delay margin.

    Raises InputError if the loop has no finite delay margin.
    """
    margin = delay_margin(point, at, direction)
    if not np.isfinite(margin.delay_s):
        raise InputError(
            f"{at}, {direction}", "no delay makes this loop unstable; nothing to check"
        )
    below, above = (
        simulate_delayed(
            point,
            at,
            share * margin.delay_s,
            direction=direction,
            duration_s=duration_s,
        )
        for share in (0.95, 1.05)
    )
    return DelayCheck(margin, below, above)


def simulate_delayed(
    point: OperatingPoint,
    at: DelayPlace,
    delay_s: float,
    *,
    direction: Direction = "along",
    duration_s: float = 300.0,
) -> DelayedRun:
    """Simulates the diagram with one delayed signal, after a small kick to the robot.

    The kick changes the velocity of the virtual mass in one direction. Both elements of
    the signal are delayed. About a point at rest, the motions along and across the line
    to the source are decoupled. The motion after a kick in one direction therefore
    depends only on the loop of this direction. Raises InputError if the operating point
    moves or the delay is negative.
    """
    if point.moves:
        raise InputError(
            "point",
            "moves, and simulate_delayed needs a point at rest; use one of "
            "find_equilibria(scenario).points",
        )
    if delay_s < 0.0:
        raise InputError("delay_s", f"is {delay_s}; give a delay of 0 s or more")
    loop, axis = point.loop, point.axes[DIRECTIONS.index(direction)]
    state = kicked(point, point.state, _KICK_M_S * axis)
    advance = _wheels_late if at == "wheels" else _hearing_late
    ticks = round(duration_s / loop.tick_s)
    offset = offsets(point, advance(point, state, delay_s, ticks), axis)
    time_s: NDArray[np.float64] = loop.tick_s * np.arange(1.0, ticks + 1)
    growth, frequency = fitted_oscillation(time_s, offset)
    return DelayedRun(delay_s, duration_s, growth, frequency, time_s, offset)


def kicked(
    point: OperatingPoint, state: NDArray[np.float64], kick_W: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns a copy of the (n,) state after a change of velocity.

    ``kick_W`` (2,) in W, m/s, is added to the velocity of the virtual mass.
    """
    names, moved = point.loop.state_names, state.copy()
    moved[[names.index(f"command.v_WP_{k}") for k in "xy"]] += kick_W
    return moved


def offsets(
    point: OperatingPoint,
    poses_WB: Sequence[NDArray[np.float64]],
    axis: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Returns (n,) deviations of P from an equilibrium along a (2,) unit vector, m.

    ``poses_WB`` are n poses x, y, theta of the robot in W, m and rad.
    """
    x, y, theta = np.array(poses_WB).T
    epsilon = point.loop.scenario.only.robot.control_point_m
    places = np.column_stack([x + epsilon * np.cos(theta), y + epsilon * np.sin(theta)])
    found: NDArray[np.float64] = (places - point.p_WP) @ axis
    return found


def _wheels_late(
    point: OperatingPoint, state: NDArray[np.float64], delay_s: float, ticks: int
) -> list[NDArray[np.float64]]:
    """Poses of a run in which the plant receives wheel commands ``delay_s`` late."""
    loop, tick_s = point.loop, point.loop.tick_s
    start = round(point.time_s / tick_s)
    late, part = divmod(delay_s, tick_s)
    port = ("plant", "wheel_speeds")
    run = loop.runner(state, point.time_s, fixed=(port,))
    sent = deque([np.zeros(2)] * (int(late) + 2), maxlen=int(late) + 2)
    wheels, plant = loop.indices("command")[2:], loop.indices("plant")[:3]
    poses = []
    for k in range(start, start + ticks):
        # Drake's tick times are multiples of the period. Repeated additions would give
        # slightly different times.
        now, then = k * tick_s, (k + 1) * tick_s
        # The newest command is the last. In the first ``part`` seconds of the period,
        # the plant still has the command before the one that is due.
        run.fix(port, sent[1] if late else sent[-1])
        run.advance(now + max(part, 1e-9))
        sent.append(run.state()[wheels])
        run.fix(port, sent[1])
        run.advance(then)
        poses.append(run.state()[plant])
    return poses


def _hearing_late(
    point: OperatingPoint, state: NDArray[np.float64], delay_s: float, ticks: int
) -> list[NDArray[np.float64]]:
    """Poses of a run in which hearing outputs its measurements ``delay_s`` late."""
    loop, tick_s = point.loop, point.loop.tick_s
    start = round(point.time_s / tick_s)
    late, part = divmod(delay_s, tick_s)
    pose_WS = loop.scenario.source.path().pose(0.0)
    epsilon = loop.scenario.only.robot.control_point_m
    hearing, plant = loop.indices("hearing")[:2], loop.indices("plant")[:3]
    run = loop.runner(state, point.time_s)
    measured = deque([state[hearing]] * (int(late) + 2), maxlen=int(late) + 2)
    poses = []
    for k in range(start, start + ticks):
        # Drake's tick times are multiples of the period. Repeated additions would give
        # slightly different times.
        then = (k + 1) * tick_s
        run.advance(then - part)
        # The tracker reads this measurement ``late`` ticks later than without delay.
        pose: Any = run.state()[plant]
        measured.append(np.array(relative_position(pose, pose_WS, epsilon)))
        run.advance(then)
        run.set_state(hearing, measured[0])
        poses.append(run.state()[plant])
    return poses


def fitted_oscillation(
    time_s: NDArray[np.float64], offset_m: NDArray[np.float64]
) -> tuple[float, float]:
    """Fits the growth rate, 1/s, and the frequency, rad/s, of an oscillation.

    The peaks of |offset_m| give the envelope, and their spacing gives the frequency. If
    there are fewer than three peaks, the frequency is 0, and the growth rate is that of
    |offset_m|. ``time_s`` (n,) is evenly spaced, and ``offset_m`` is (n,). The first
    fifth of the time is left out, because other modes decay there.
    """
    later = time_s >= time_s[0] + 0.2 * (time_s[-1] - time_s[0])
    t, x = time_s[later], offset_m[later]
    size = np.abs(x)
    peaks = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
    if len(peaks) < 3:
        slope = np.polyfit(t, np.log(np.maximum(size, 1e-300)), 1)[0]
        return float(slope), 0.0
    # Vertex of the parabola through each peak sample and its two neighbors.
    a, b, c = size[peaks - 1], size[peaks], size[peaks + 1]
    bend = np.maximum(2.0 * b - a - c, 1e-300)
    shift = 0.5 * (c - a) / bend
    when = t[peaks] + shift * (t[1] - t[0])
    top = b + 0.25 * (c - a) * shift
    growth = np.polyfit(when, np.log(top), 1)[0]
    spacing = np.polyfit(np.arange(len(when)), when, 1)[0]
    return float(growth), float(np.pi / spacing)
