"""The all-ideal diagram simulated with a delay put into one of its wires."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.linear.delay_margin import DelayMargin, DelayPlace, delay_margin
from analysis.models.open_loops import DIRECTIONS, Direction
from analysis.models.operating_points import OperatingPoint
from systems.framework.input_error import InputError
from systems.hearing.ideal_source_sensor import relative_position

#: Kick that starts a run, m/s: far above rounding, far below what is not linear.
_KICK_M_S = 1e-6


@dataclass(frozen=True)
class DelayedRun:
    """How the motion about an operating point went on after a small kick."""

    delay_s: float
    """In the wire, s."""
    duration_s: float
    """Simulated, s."""
    growth_per_s: float
    """Fitted exponent of the envelope, 1/s; negative where it decays."""
    frequency_rad_s: float
    """Fitted, rad/s."""
    time_s: NDArray[np.float64] = field(repr=False)
    """(n,) s."""
    offset_m: NDArray[np.float64] = field(repr=False)
    """(n,) of P from the operating point, in the direction of the kick, m."""


@dataclass(frozen=True)
class DelayCheck:
    """A computed delay margin and runs on both sides of it."""

    margin: DelayMargin
    """As computed."""
    below: DelayedRun
    """With 0.95 of it: must decay."""
    above: DelayedRun
    """With 1.05 of it: must grow."""

    @property
    def confirmed(self) -> bool:
        """Whether both runs did."""
        return self.below.growth_per_s < 0.0 < self.above.growth_per_s


def check_delay_margin(
    point: OperatingPoint,
    at: DelayPlace = "sensor",
    direction: Direction = "along",
    *,
    duration_s: float = 300.0,
) -> DelayCheck:
    """Simulates 0.95 and 1.05 of the computed delay margin.

    Args:
        point: Equilibrium, at rest.
        at: Where the delay comes in.
        direction: Of the motion, and of the kick.
        duration_s: To simulate, s.

    Returns:
        The margin, and the runs on both sides of it.

    Raises:
        InputError: The loop has no finite delay margin.
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
    """Runs the built diagram with one wire delayed, after a kick to v_P.

    Both elements of the wire are delayed; at rest the motions along and across
    do not touch, so that a kick along shows the loop along.

    Args:
        point: At rest.
        at: Wheel commands late at the motors, or estimates of where the
            source was that much earlier still.
        delay_s: Any, s.
        direction: Of the kick.
        duration_s: To simulate, s.

    Returns:
        Fitted growth, 1/s, and frequency, rad/s, and the way of P, m.

    Raises:
        InputError: The operating point moves, or the delay is negative.
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
    """A state after a kick to the virtual mass.

    Args:
        point: Names the states.
        state: (n,) of the diagram.
        kick_W: (2,) m/s.

    Returns:
        (n,) a copy.
    """
    names, moved = point.loop.state_names, state.copy()
    moved[[names.index(f"command.v_WP_{k}") for k in "xy"]] += kick_W
    return moved


def offsets(
    point: OperatingPoint,
    poses_WB: Sequence[NDArray[np.float64]],
    axis: NDArray[np.float64],
) -> NDArray[np.float64]:
    """How far P is off an equilibrium along an axis.

    Args:
        point: The equilibrium.
        poses_WB: n poses of the robot, m and rad.
        axis: (2,) unit vector in W.

    Returns:
        (n,) m.
    """
    x, y, theta = np.array(poses_WB).T
    epsilon = point.loop.scenario.only.robot.control_point_m
    places = np.column_stack([x + epsilon * np.cos(theta), y + epsilon * np.sin(theta)])
    found: NDArray[np.float64] = (places - point.p_WP) @ axis
    return found


def _wheels_late(
    point: OperatingPoint, state: NDArray[np.float64], delay_s: float, ticks: int
) -> list[NDArray[np.float64]]:
    """The plant's input is cut off, and fed with older commands."""
    loop, tick_s = point.loop, point.loop.tick_s
    start = round(point.time_s / tick_s)
    late, part = divmod(delay_s, tick_s)
    port = ("plant", "wheel_speeds")
    run = loop.runner(state, point.time_s, fixed=(port,))
    sent = deque([np.zeros(2)] * (int(late) + 2), maxlen=int(late) + 2)
    wheels, plant = loop.indices("command")[2:], loop.indices("plant")[:3]
    poses = []
    for k in range(start, start + ticks):
        # Ticks are multiples in Drake's arithmetic too: a sum would miss them.
        now, then = k * tick_s, (k + 1) * tick_s
        # Newest last; until the end of ``part`` the one before the due one holds.
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
    """Hearing's state is replaced by what it would have measured earlier."""
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
        # Ticks are multiples in Drake's arithmetic too: a sum would miss them.
        then = (k + 1) * tick_s
        run.advance(then - part)
        # Taken for the tick after the next ``late`` ones.
        pose: Any = run.state()[plant]
        measured.append(np.array(relative_position(pose, pose_WS, epsilon)))
        run.advance(then)
        run.set_state(hearing, measured[0])
        poses.append(run.state()[plant])
    return poses


def fitted_oscillation(
    time_s: NDArray[np.float64], offset_m: NDArray[np.float64]
) -> tuple[float, float]:
    """Growth and frequency of an oscillation.

    Peaks between the zeros give the envelope, their spacing the frequency; the
    first fifth, where faster modes die out, does not count.

    Args:
        time_s: (n,) ascending and evenly spaced, s.
        offset_m: (n,) from rest, m.

    Returns:
        Exponent of the envelope, 1/s, and frequency, rad/s; 0 rad/s with fewer than
        three peaks.
    """
    later = time_s >= time_s[0] + 0.2 * (time_s[-1] - time_s[0])
    t, x = time_s[later], offset_m[later]
    size = np.abs(x)
    peaks = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
    if len(peaks) < 3:
        slope = np.polyfit(t, np.log(np.maximum(size, 1e-300)), 1)[0]
        return float(slope), 0.0
    # The vertex of the parabola through a peak and its neighbours.
    a, b, c = size[peaks - 1], size[peaks], size[peaks + 1]
    bend = np.maximum(2.0 * b - a - c, 1e-300)
    shift = 0.5 * (c - a) / bend
    when = t[peaks] + shift * (t[1] - t[0])
    top = b + 0.25 * (c - a) * shift
    growth = np.polyfit(when, np.log(top), 1)[0]
    spacing = np.polyfit(np.arange(len(when)), when, 1)[0]
    return float(growth), float(np.pi / spacing)
