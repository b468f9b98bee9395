"""Simulates a point that obeys a law for routes, in compiled code."""

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

#: Contact points with a larger x are ignored, m.
_FAR_M = 1e6


class PointLoop(NamedTuple):
    """A law for routes, and the robot that the law moves."""

    law: AdaptiveTrajectoryParameters
    poles: tuple[float, float] | None = None
    """Natural frequency w_n, rad/s, and damping ratio xi of the reference model. With
    None, they follow from the gains of the law and the virtual mass."""
    robot: RobotParameters = RobotParameters()
    motor_lag_s: float = 0.0
    tick_s: float = TICK_S


class PointRun(NamedTuple):
    """Motion and gains at each control period (tick), before the updates of this tick.

    P is the control point, which carries the virtual mass. Only the sensitivities are
    those after the update of the tick.
    """

    motion: NDArray[np.float64]
    """(ticks, 4) position p of P (x, y), m, and velocity v of the virtual mass (x, y),
    m/s. With motor lag, the velocity of P differs from v."""
    gains: NDArray[np.float64]
    """(ticks, 3) stiffness K, N/m, damping D, N s/m, and contact stiffness K_e, N/m."""
    sensitivities: NDArray[np.float64]
    """(ticks, 12) partial derivatives of p and v with respect to K, D and K_e, in SI
    units. The order is that of the state of ``adaptation_step``."""
    reference: NDArray[np.float64]
    """(ticks, 4) position (x, y) and velocity (x, y) of the reference model, m and
    m/s."""


class _Motors(NamedTuple):
    """Effect of the motor lag on the control point P over a control period."""

    kept: float
    """Share of the old speed that remains after the period."""
    coasting_s: float
    """Distance that P coasts in the period, divided by the old speed, s."""


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

    The simulation includes the virtual mass at the control point P, and the motor lag.
    The simulation has no heading, and no limits of speed and acceleration. The formulas
    in ``analysis.routes.adaptation_stability`` make the same assumptions.

    Each position is (x, y), m, and each velocity is (x, y), m/s:

    - ``targets``: (ticks, 4) position and velocity of the target.
    - ``places``: (ticks, n, 4) or (n, 4) positions and velocities of n points. They
      push P while P is in their security zone. Points with x of 1e6 m or more are
      ignored.
    - ``start``: (4,) initial position and velocity of P; by default those of the first
      target.
    - ``push``: constant force on P, N.
    - ``held``: largest x that P can reach, m; (ticks,), or one value for all ticks.
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
