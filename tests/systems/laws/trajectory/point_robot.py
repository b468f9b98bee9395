"""A point that obeys the law, tick by tick, in compiled code: what tests simulate."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.laws.trajectory.impedance_adaptation import (
    AdaptationParameters,
    adaptation_numbers,
    adaptation_step,
)
from systems.laws.trajectory.reference_model import held_matrices, reference_step
from systems.laws.trajectory.trajectory_impedance import (
    TrajectoryImpedanceParameters,
    contact_force,
    contacts_of_objects,
    target_force,
)
from systems.ranging.objects import KNOWN, THERE, VX, VY, X, Y

TICK_S = 0.025
ROBOT = RobotParameters(mass_kg=1.0, control_point_m=0.08)

_adapt, _refer = njit(adaptation_step), njit(reference_step)


@njit
def _run(targets, places, start, numbers, model, push, held):
    """Rows of p, v, K, D, K_e and the twelve sensitivities, (ticks, 19)."""
    ticks = len(targets)
    rows = np.zeros((ticks, 19))
    state, reference, seen = np.zeros(15), np.zeros(4), np.zeros(4)
    for k in range(3):
        state[k] = numbers.nominal[k]
    pose, v = np.zeros(3), np.zeros(2)
    impedance, active, objects = np.zeros(3), np.zeros(1), np.zeros(64)
    pose[0], pose[1] = start[0] - numbers.control_point_m, start[1]
    v[0], v[1] = start[2], start[3]
    for tick in range(ticks):
        x, y = pose[0] + numbers.control_point_m, pose[1]
        objects[:] = 0.0
        for k in range(places.shape[1]):
            at, place = k * 8, places[tick, k]
            if place[0] < 1e6:
                objects[at + THERE], objects[at + KNOWN] = 1.0, 1.0
                objects[at + X], objects[at + Y] = place[0] - x, place[1] - y
                objects[at + VX], objects[at + VY] = place[2], place[3]
        _refer(tick, reference, (targets[tick],), (seen,), model)
        inputs = targets[tick], seen, pose, v, objects
        _adapt(tick, state, inputs, (impedance, active), numbers)
        rows[tick, 0], rows[tick, 1], rows[tick, 2], rows[tick, 3] = x, y, v[0], v[1]
        for k in range(15):
            rows[tick, 4 + k] = state[k]
        for k in range(3):
            rows[tick, 4 + k] = impedance[k]
        p = x, y
        ux, uy = target_force(p, v, targets[tick], impedance[0], impedance[1])
        found = contacts_of_objects(objects, v, numbers.contacts)
        fx, fy = contact_force(
            found, impedance[2], numbers.contact_damping, numbers.contacts
        )
        v[0] += numbers.tick_s / numbers.mass * (ux + fx + push[0])
        v[1] += numbers.tick_s / numbers.mass * (uy + fy + push[1])
        if held > 0.0 and x + numbers.tick_s * v[0] > held:
            v[0] = 0.0
        pose[0] += numbers.tick_s * v[0]
        pose[1] += numbers.tick_s * v[1]
    return rows


def run(
    targets: Any,
    places: Any = (),
    start: Any = None,
    *,
    law: TrajectoryImpedanceParameters,
    adaptation: AdaptationParameters | None = None,
    poles: tuple[float, float] | None = None,
    push: tuple[float, float] = (0.0, 0.0),
    held: float = 0.0,
) -> NDArray[np.float64]:
    """(ticks, 19) p, v, K, D, K_e, sensitivities of a run.

    Args:
        targets: (ticks, 4) p_d and v_d.
        places: (ticks, n, 4) or (n, 4) points and their velocities.
        start: p and v; none: the first target.
        law: Its parameters.
        adaptation: What adapts; none: nothing.
        poles: w_n and xi of the reference; none: those of the law.
        push: A constant force on P, N.
        held: P cannot pass this x, m; 0: it can.
    """
    targets = np.asarray(targets, dtype=float)
    places = np.asarray(places, dtype=float)
    if places.ndim < 3:
        places = np.tile(places.reshape(1, -1, 4), (len(targets), 1, 1))
    numbers = adaptation_numbers(
        adaptation or AdaptationParameters(), law, ROBOT, TICK_S
    )
    k, d = law.stiffness_n_m, law.damping_n_s_m
    poles = poles or (np.sqrt(k), d / (2.0 * np.sqrt(k)))
    begin = np.asarray(targets[0] if start is None else start, dtype=float)
    model = held_matrices(float(poles[0]), float(poles[1]), TICK_S)
    return np.asarray(_run(targets, places, begin, numbers, model, push, held))


def along(speed: float, duration: float, y: float = 0.0) -> NDArray[np.float64]:
    """(ticks, 4) targets that move along x from the origin on."""
    time = np.arange(0.0, duration, TICK_S)
    rest = np.zeros_like(time)
    return np.stack([speed * time, rest + y, rest + speed, rest], axis=1)
