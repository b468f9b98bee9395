"""Stability margins of the heading loop of a robot that searches for a source.

Such a robot turns toward a desired heading with a PID controller while it drives. The
heading deviation is the difference between desired and true heading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import loop_margins
from systems.base.robot import RobotParameters
from systems.framework.signals import TICK_S
from systems.heading.heading_controller import (
    DIFFERENTIAL_S,
    INTEGRAL_1_S,
    PROPORTIONAL,
)
from systems.heading.parameters import MotorDriverParameters


@dataclass(frozen=True)
class HeadingLoopMargins:
    """Margins of the heading loop, which is cut at the heading deviation.

    All values except ``continuous_phase_margin_deg`` are those of the sampled loop.
    """

    tick_s: float
    crossover_rad_s: float
    phase_margin_deg: float
    delay_margin_s: float
    """Phase margin, rad, divided by crossover frequency, rad/s, in s."""
    delay_margin_ticks: float
    """Delay margin in control periods."""
    gain_margin_db: float
    """Increase of the gain at which the loop becomes unstable, dB."""
    continuous_phase_margin_deg: float
    """Phase margin of the loop without sampling, deg."""

    @property
    def phase_lost_deg(self) -> float:
        """Loss of phase margin by sampling, deg."""
        return self.continuous_phase_margin_deg - self.phase_margin_deg


def heading_loop(
    motors: MotorDriverParameters,
    robot: RobotParameters,
    lag_s: float,
    tick_s: float | None = TICK_S,
) -> LinearModel:
    """Returns the open loop from heading deviation to heading of a driving robot.

    The loop has these parts:

    - PID controller with the output e (Song 2011, table 1)
    - duty cycles v +- 0.01 e of the two motors, where v is common to both (table 2,
      corrected)
    - motors with a first-order lag of ``lag_s``
    - heading as the integral of the yaw rate, which is proportional to the difference
      of the wheel speeds

    As long as no limit is reached, the loop is linear in the deviation and does not
    depend on v. Input and output are in deg. The sign is that for negative feedback. If
    ``tick_s`` is None, the loop is continuous.
    """
    full = min(motors.full_speed_m_s, robot.top_speed_m_s)
    turn = math.degrees(2.0 * 0.01 * full / robot.wheel_separation_m)
    # The matrices are written by hand, because transfer functions are ill-conditioned
    # for such a short period.
    parts = _sampled if tick_s else _continuous
    A, B, C, D = parts(turn, lag_s, tick_s or 0.0)
    return LinearModel(
        name="L of the heading",
        A=A,
        B=B,
        C=C,
        D=D,
        state_names=tuple(f"x{k}" for k in range(len(A))),
        input_names=("deviation",),
        output_names=("heading",),
        period_s=tick_s,
    )


_Matrices = tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]


def _continuous(turn: float, lag_s: float, _: float) -> _Matrices:
    """Matrices with the states: integral of the deviation, heading, and heading rate.

    Without motor lag, the heading rate is no state. The derivative term of the PID
    controller feeds the deviation directly to the heading. With motor lag, it feeds the
    deviation directly to the heading rate.
    """
    kp, ki, kd = PROPORTIONAL, INTEGRAL_1_S, DIFFERENTIAL_S
    one = np.ones((1, 1))
    if lag_s == 0.0:
        A = np.array([[0.0, 0.0], [turn * ki, 0.0]])
        B = np.array([[1.0], [turn * kp]])
        return A, B, np.array([[0.0, 1.0]]), turn * kd * one
    A = np.array(
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [turn * ki / lag_s, 0.0, -1 / lag_s]]
    )
    jump = turn * kd / lag_s
    B = np.array([[1.0], [jump], [(turn * kp - jump) / lag_s]])
    return A, B, np.array([[0.0, 1.0, 0.0]]), 0.0 * one


def _sampled(turn: float, lag_s: float, tick_s: float) -> _Matrices:
    """Matrices with the states: integral term, last deviation, heading, heading rate.

    The integral term is that of the PID controller.
    """
    kp, ki, kd = PROPORTIONAL, INTEGRAL_1_S, DIFFERENTIAL_S
    keep = math.exp(-tick_s / lag_s) if lag_s > 0.0 else 0.0
    # After one period, the changes of heading and heading rate are proportional to the
    # initial heading rate (``coast``, ``keep``) and to the command (``moved``).
    coast = lag_s * (1.0 - keep)
    moved = turn * np.array([[tick_s - coast], [1.0 - keep]])
    pid = np.array([[1.0, -kd / tick_s]])
    direct = kp + ki * tick_s + kd / tick_s
    A = np.zeros((4, 4))
    A[0, 0] = 1.0
    A[2:, :2] = moved @ pid
    A[2:, 2:] = [[1.0, coast], [0.0, keep]]
    B = np.concatenate(([[ki * tick_s], [1.0]], moved * direct))
    return A, B, np.array([[0.0, 0.0, 1.0, 0.0]]), np.zeros((1, 1))


def heading_loop_margins(
    motors: MotorDriverParameters,
    robot: RobotParameters,
    lag_s: float,
    tick_s: float = TICK_S,
) -> HeadingLoopMargins:
    """Returns the stability margins of the heading loop; see ``heading_loop``."""
    parts = motors, robot, lag_s
    found = loop_margins(heading_loop(*parts, tick_s))
    free = loop_margins(heading_loop(*parts, None))
    return HeadingLoopMargins(
        tick_s,
        found.crossover_rad_s,
        found.phase_margin_deg,
        found.delay_margin_s,
        found.delay_margin_s / tick_s,
        found.gain_increase_margin_db,
        free.phase_margin_deg,
    )
