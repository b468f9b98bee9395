"""A point that obeys the law, tick by tick: what tests simulate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.routes.point_run import PointLoop, run_point
from systems.base.robot import RobotParameters
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters

TICK_S = 0.025
ROBOT = RobotParameters(mass_kg=1.0, control_point_m=0.08)


def run(
    targets: Any,
    places: Any = (),
    start: Any = None,
    *,
    law: AdaptiveTrajectoryParameters,
    poles: tuple[float, float] | None = None,
    push: tuple[float, float] = (0.0, 0.0),
    held: float = math.inf,
) -> NDArray[np.float64]:
    """(ticks, 19) p, v, K, D, K_e, sensitivities of a run without motor lag.

    Args:
        targets: (ticks, 4) p_d and v_d.
        places: (ticks, n, 4) or (n, 4) points and their velocities.
        start: p and v; none: the first target.
        law: Its parameters.
        poles: w_n and xi of the reference; none: those of the law.
        push: A constant force on P, N.
        held: P cannot pass this x, m.
    """
    loop = PointLoop(law, poles, ROBOT)
    found = run_point(loop, targets, places, start, push=push, held=held)
    return np.hstack([found.motion, found.gains, found.sensitivities])


def along(speed: float, duration: float, y: float = 0.0) -> NDArray[np.float64]:
    """(ticks, 4) targets that move along x from the origin on."""
    time = np.arange(0.0, duration, TICK_S)
    rest = np.zeros_like(time)
    return np.stack([speed * time, rest + y, rest + speed, rest], axis=1)
