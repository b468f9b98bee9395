"""The reference motion of the adaptation: a second-order model with the same target."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from scipy.linalg import expm

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)


class ReferenceNumbers(NamedTuple):
    """Matrices of x+ = A x + B u for one axis, with the rows one after the other."""

    a: tuple[float, float, float, float]
    b: tuple[float, float, float, float]


@lru_cache(maxsize=64)
def held_matrices(frequency: float, ratio: float, tick_s: float) -> ReferenceNumbers:
    """Computes the discrete-time model of a second-order system for one axis.

    The continuous model is that of eq. 20 to 26 of Engelbrecht 2021. The discrete model
    is exact if the target is constant during each control period.

    Args:
        frequency: Natural frequency w_n, rad/s.
        ratio: Damping ratio xi.
        tick_s: Control period, s.

    Returns:
        Matrices A and B of x+ = A x + B u. x is the position and velocity of the model.
        u is the position and velocity of the target.
    """
    stiff, damp = frequency**2, 2.0 * ratio * frequency
    whole = np.zeros((4, 4))
    whole[0, 1] = 1.0
    whole[1] = -stiff, -damp, stiff, damp
    moved = expm(tick_s * whole)[:2]
    a, b = moved[:, :2].ravel().tolist(), moved[:, 2:].ravel().tolist()
    return ReferenceNumbers(tuple(a), tuple(b))


def nominal_poles(mass: float, stiffness: float, damping: float) -> tuple[float, float]:
    """Computes the natural frequency and damping ratio of a mass, spring, and damper.

    Engelbrecht 2021 prints neither number.

    Args:
        mass: Virtual mass M, kg.
        stiffness: Stiffness K, N/m, above 0.
        damping: Damping D, N s/m.

    Returns:
        Natural frequency w_n, rad/s, and damping ratio xi.
    """
    return math.sqrt(stiffness / mass), damping / (2.0 * math.sqrt(stiffness * mass))


@register_jitable
def reference_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: ReferenceNumbers
) -> None:
    """Advances the reference by one tick."""
    target, a, b = inputs[0], numbers.a, numbers.b
    if tick == 0:
        for k in range(4):
            state[k] = target[k]
    for k in range(4):
        outputs[0][k] = state[k]
    for axis in range(2):
        p, v = state[axis], state[2 + axis]
        p_d, v_d = target[axis], target[2 + axis]
        state[axis] = a[0] * p + a[1] * v + b[0] * p_d + b[1] * v_d
        state[2 + axis] = a[2] * p + a[3] * v + b[2] * p_d + b[3] * v_d


class ReferenceModel(Block):
    """Computes the motion with which the control point P should follow the target.

    The model is a second-order system that starts at the target. It has no contacts
    with obstacles. Therefore a motion of P away from an obstacle counts as an error.

    The discrete state is the position and velocity of the model. The update is exact if
    the target is constant during the control period. A new target changes the output
    one period later.

    Args:
        parameters: Stiffness K and damping D, ``TrajectoryImpedanceParameters``.
        robot: Virtual mass M. M, K, and D determine the poles of the model.
        tick_s: Control period, s.

    Reference: Engelbrecht, Steyn and Djouani (2021), eq. 19 to 26. In eq. 19, the dots
    that mark derivatives are misplaced; the block uses the corrected equation.
    """

    part = "reference_model"
    inputs = (Port("target_state", 4, "m, m, m/s, m/s"),)
    states = "reference_x", "reference_y", "reference_vx", "reference_vy"
    outputs = (Port("reference_state", 4, "m, m, m/s, m/s", states),)

    def __init__(
        self,
        *,
        parameters: TrajectoryImpedanceParameters = TrajectoryImpedanceParameters(),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("reference_model")
        frequency, ratio = nominal_poles(
            robot.mass_kg, parameters.stiffness_n_m, parameters.damping_n_s_m
        )
        numbers = held_matrices(frequency, ratio, tick_s)
        self.declare(Step(reference_step, numbers, [0.0] * 4), tick_s=tick_s)
