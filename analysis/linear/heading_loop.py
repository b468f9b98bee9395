"""Margins of the loop that turns a searching robot to its heading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import control
import numpy as np

from systems.base.robot import RobotParameters
from systems.framework.signals import TICK_S
from systems.heading.parameters import HeadingControlParameters, MotorDriverParameters

__all__ = ["HeadingLoopMargins", "heading_loop", "heading_loop_margins"]


@dataclass(frozen=True)
class HeadingLoopMargins:
    """Of the sampled loop, cut at the deviation; and of the same without sampling."""

    tick_s: float
    crossover_rad_s: float
    phase_margin_deg: float
    delay_margin_s: float
    """Time that the loop may be late besides, s."""
    delay_margin_ticks: float
    gain_margin_db: float
    continuous_phase_margin_deg: float

    @property
    def phase_lost_deg(self) -> float:
        """What sampling costs, deg."""
        return self.continuous_phase_margin_deg - self.phase_margin_deg


def heading_loop(
    heading: HeadingControlParameters,
    motors: MotorDriverParameters,
    robot: RobotParameters,
    lag_s: float,
    tick_s: float | None = TICK_S,
) -> control.TransferFunction:
    """The open loop from the deviation to the heading, while it drives ahead.

    PID (Song 2011, table 1), duties v +- 0.01 e (table 2, mended), motors with a lag,
    and the heading that comes of the wheels' difference. Within L and all limits it is
    linear in the deviation: what the wheels have in common does not turn.

    Args:
        heading: Gains.
        motors: Speed at full duty.
        robot: Track of the wheels.
        lag_s: Of the motors, s.
        tick_s: Period of controller and motors, which hold their output, s; None:
            without sampling.

    Returns:
        deg to deg.
    """
    full = min(motors.full_speed_m_s, robot.top_speed_m_s)
    turn = math.degrees(2.0 * 0.01 * full / robot.wheel_separation_m)
    s = control.tf([1.0, 0.0], [1.0])
    plant = turn / (s * (lag_s * s + 1.0))
    kp, ki, kd = heading.proportional, heading.integral, heading.differential
    if tick_s is None:
        return plant * (kp + ki / s + kd * s)
    z = control.tf([1.0, 0.0], [1.0], tick_s)
    pid = kp + ki * tick_s * z / (z - 1.0) + kd * (z - 1.0) / (tick_s * z)
    return control.c2d(plant, tick_s, method="zoh") * pid


def _margins(
    loop: control.TransferFunction, top_rad_s: float
) -> tuple[float, float, float]:
    """Gain margin, phase margin, deg, and crossover, rad/s."""
    omega = np.geomspace(1e-3, 0.999 * top_rad_s, 4000)
    response = control.frd(loop, omega, smooth=True)
    gain, phase, _, _, crossover, _ = control.stability_margins(response)
    return gain, phase, crossover


def heading_loop_margins(
    heading: HeadingControlParameters,
    motors: MotorDriverParameters,
    robot: RobotParameters,
    lag_s: float,
    tick_s: float = TICK_S,
) -> HeadingLoopMargins:
    """Margins of ``heading_loop``.

    Args:
        heading: Gains.
        motors: Speed at full duty.
        robot: Track of the wheels.
        lag_s: Of the motors, s.
        tick_s: Period of controller and motors, s.

    Returns:
        The margins; the gain margin is infinite where no gain is too much.
    """
    parts = heading, motors, robot, lag_s
    # Of the frequency response: polynomials of so short a tick are ill-conditioned.
    gain, phase, crossover = _margins(heading_loop(*parts, tick_s), math.pi / tick_s)
    _, free, _ = _margins(heading_loop(*parts, None), math.pi / tick_s)
    delay = float(math.radians(phase) / crossover)
    return HeadingLoopMargins(
        tick_s,
        float(crossover),
        float(phase),
        delay,
        delay / tick_s,
        float(20.0 * np.log10(gain)),
        float(free),
    )
