"""Simulates a point that obeys the law of a route, in compiled code."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.laws.trajectory.impedance_adaptation import (
    AdaptationNumbers,
    adaptation_numbers,
    adaptation_step,
)
from systems.laws.trajectory.reference_model import (
    ReferenceNumbers,
    held_matrices,
    nominal_poles,
    reference_step,
)
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_impedance import (
    contact_force,
    contacts_of_objects,
    target_force,
)
from systems.ranging.objects import KNOWN, THERE, VX, VY, X, Y
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

#: Objects with larger x are ignored, m.
_FAR_M = 1e6


class PointLoop(NamedTuple):
    """A law, and the robot that the law moves."""

    law: AdaptiveTrajectoryParameters
    poles: tuple[float, float] | None = None
    """w_n, rad/s, and xi of the reference model; None: those of the law's gains."""
    robot: RobotParameters = RobotParameters()
    motor_lag_s: float = 0.0
    tick_s: float = TICK_S


class PointRun(NamedTuple):
    """States at each control period, before its updates. P is the control point."""

    motion: NDArray[np.float64]
    """(ticks, 4) position p and velocity v of P's virtual mass, x and y, m and m/s."""
    gains: NDArray[np.float64]
    """(ticks, 3) stiffness K, damping D and contact stiffness K_e."""
    sensitivities: NDArray[np.float64]
    """(ticks, 12) sensitivities of p and v to K, D and K_e, after the update."""
    reference: NDArray[np.float64]
    """(ticks, 4) position and velocity of the reference, m and m/s."""


class _Motors(NamedTuple):
    """Effect of the motor lag on the control point P over a control period."""

    kept: float
    """Share of the old speed in the new speed."""
    coasting_s: float
    """Coasting distance per old speed, s."""


@njit(cache=True)
def _run(
    targets: Any,
    places: Any,
    start: Any,
    numbers: AdaptationNumbers,
    model: ReferenceNumbers,
    motors: _Motors,
    push: Any,
    held: Any,
) -> Any:  # pragma: no cover  (compiled)
    ticks, tick_s = len(targets), numbers.tick_s
    rows = np.zeros((ticks, 23))
    state, reference, seen = np.zeros(15), np.zeros(4), np.zeros(4)
    for k in range(3):
        state[k] = numbers.nominal[k]
    pose, v, w = np.zeros(3), np.zeros(2), np.zeros(2)
    impedance = np.zeros(3)
    objects = np.zeros(OBJECT_SLOTS * OBJECT_SIZE)
    pose[0], pose[1] = start[0] - numbers.control_point_m, start[1]
    for axis in range(2):
        v[axis] = w[axis] = start[2 + axis]
    for tick in range(ticks):
        p = pose[0] + numbers.control_point_m, pose[1]
        objects[:] = 0.0
        for k in range(places.shape[1]):
            at, place = k * OBJECT_SIZE, places[tick, k]
            if place[0] < _FAR_M:
                objects[at + THERE], objects[at + KNOWN] = 1.0, 1.0
                objects[at + X], objects[at + Y] = place[0] - p[0], place[1] - p[1]
                objects[at + VX], objects[at + VY] = place[2], place[3]
        reference_step(tick, reference, (targets[tick],), (seen,), model)
        inputs = targets[tick], seen, pose, v, objects
        adaptation_step(tick, state, inputs, (impedance,), numbers)
        rows[tick, 0], rows[tick, 1], rows[tick, 2], rows[tick, 3] = *p, v[0], v[1]
        rows[tick, 4:7], rows[tick, 7:19] = impedance, state[3:]
        rows[tick, 19:] = seen
        ux, uy = target_force(p, v, targets[tick], impedance[0], impedance[1])
        found = contacts_of_objects(objects, v, numbers.contacts)
        fx, fy = contact_force(found, impedance[2], numbers.contact_damping)
        v[0] += tick_s / numbers.mass * (ux + fx + push[0])
        v[1] += tick_s / numbers.mass * (uy + fy + push[1])
        if p[0] + tick_s * v[0] > held[tick]:
            v[0] = 0.0
        for axis in range(2):
            way = motors.coasting_s * w[axis] + (tick_s - motors.coasting_s) * v[axis]
            w[axis] = motors.kept * w[axis] + (1.0 - motors.kept) * v[axis]
            pose[axis] += way
    return rows


def run_point(
    loop: PointLoop,
    targets: ArrayLike,
    places: ArrayLike = (),
    start: ArrayLike | None = None,
    *,
    push: tuple[float, float] = (0.0, 0.0),
    held: ArrayLike = math.inf,
) -> PointRun:
    """Simulates a point robot with reference model, gain adaptation and control law.

    The simulation includes the virtual mass of control point P, and the motor lag. The
    simulation has no heading, and no limits of speed and acceleration. The formulas of
    the analysis make the same assumptions.

    The (ticks, 4) ``targets`` are positions and velocities of the target, m and m/s.
    The (ticks, n, 4) or (n, 4) ``places`` are those of contact points; points with x
    beyond 1e6 m are ignored. The run starts at the (4,) ``start``, or at the first
    target. ``push`` is a constant force on P, N. ``held`` is the largest x that P can
    reach, m, either (ticks,) or one value for all control periods.
    """
    wanted = np.asarray(targets, dtype=float)
    points = np.asarray(places, dtype=float)
    if points.ndim < 3:
        points = np.tile(points.reshape(1, -1, 4), (len(wanted), 1, 1))
    numbers = adaptation_numbers(loop.law, loop.robot, loop.tick_s)
    frequency, ratio = loop.poles or nominal_poles(
        loop.robot.mass_kg, loop.law.stiffness_n_m, loop.law.damping_n_s_m
    )
    model = held_matrices(float(frequency), float(ratio), loop.tick_s)
    kept = math.exp(-loop.tick_s / loop.motor_lag_s) if loop.motor_lag_s else 0.0
    motors = _Motors(kept, loop.motor_lag_s * (1.0 - kept))
    begin = np.asarray(wanted[0] if start is None else start, dtype=float)
    walls = np.broadcast_to(np.asarray(held, dtype=float), len(wanted)).copy()
    rows = _run(wanted, points, begin, numbers, model, motors, push, walls)
    return PointRun(rows[:, :4], rows[:, 4:7], rows[:, 7:19], rows[:, 19:])
