"""Motion of the base while the wheels approach a held command with motor lag."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.framework.scalar_math import cos, sin

#: Number of Gauss-Legendre nodes in each panel of the quadrature.
_NODES = 4
#: Longest panel, s. It limits the turn within a panel.
_LONGEST_PANEL_S = 0.1


class LaggedMotion(NamedTuple):
    """Constants of the wheel motion during a period in which the command is held.

    Each wheel has the speed c + (w - c) exp(-t/tau). Here t is the time since the start
    of the period, tau is the motor lag, c is the commanded speed, and w is the speed at
    the start. The wheel angle is the sum of two parts:

    - The *steady* part c t grows in proportion to time.
    - The *lagged* part grows as 1 - exp(-t/tau).
    """

    duration_s: float
    """Duration of the period, s."""
    lag_s: float
    """Lag tau, s."""
    kept: float
    """Share of w - c that is left at the end, exp(-duration/tau)."""
    lagged_s: float
    """Angle of the lagged part at the end, divided by w - c. It equals tau (1 - kept),
    s."""
    least_share: float
    """Factor kappa in the error bound of the encoders. If a wheel reverses within a
    control period, its path is longer than the encoder shows. Therefore the bound uses
    a path of at least kappa times the steady part. See docs/results_guard.md,
    "Encoders"."""
    nodes: tuple[tuple[float, float, float, float], ...]
    """Nodes of the quadrature, four numbers per node. The first two numbers are the
    shares of the steady part and of the lagged part that are complete at the node. The
    last two numbers are the weights of the node for both parts."""


def lagged_motion(duration_s: float, lag_s: float) -> LaggedMotion:
    """Computes the constants of ``LaggedMotion`` for a duration and a motor lag in s.

    The constants include the nodes of the quadrature in ``advance_pose``. The
    quadrature divides the period into panels that are no longer than the motor lag. Its
    error is therefore below 1e-10 of the path length.
    """
    panels = math.ceil(max(duration_s / lag_s, duration_s / _LONGEST_PANEL_S) - 1e-9)
    at, weight = np.polynomial.legendre.leggauss(_NODES)
    starts = np.arange(panels)[:, None]
    share = np.ravel(starts + 0.5 * (1.0 + at)) / panels
    steady = np.tile(0.5 * weight, panels) / panels
    decay = np.exp(-share * duration_s / lag_s)
    kept = math.exp(-duration_s / lag_s)
    # The weights add up to 1, so a straight path is exact.
    lagged = steady * decay / (steady @ decay)
    nodes = zip(
        share.tolist(),
        ((1.0 - decay) / (1.0 - kept)).tolist(),
        steady.tolist(),
        lagged.tolist(),
        strict=True,
    )
    least_share = 2.0 * (1.0 / (1.0 - kept) - lag_s / duration_s) - 1.0
    lagged_s = lag_s * (1.0 - kept)
    return LaggedMotion(duration_s, lag_s, kept, lagged_s, least_share, tuple(nodes))


@register_jitable
def advance_pose(pose: Any, traveled: Any, steady: Any, motion: LaggedMotion) -> Any:
    """Computes the pose after a period in which the wheel command was held.

    The path and the turn of the body each have a steady part and a lagged part, see
    ``LaggedMotion``. The function integrates (cos theta, sin theta) along the path by a
    quadrature over the nodes of ``motion``.

    Args:
        pose: (x, y, theta) at the start in the world frame W, m and rad; floats or
            AutoDiffXd.
        traveled: (length, turn): actual path length and turn of the body in the
            period, m and rad.
        steady: (length, turn) that would result if the wheels ran at their commanded
            speeds from the start, m and rad.
        motion: Constants of the period.

    Returns:
        (x, y, theta) at the end in W, m and rad.
    """
    lagged_way, lagged_turn = traveled[0] - steady[0], traveled[1] - steady[1]
    x, y, theta = pose[0], pose[1], pose[2]
    for steady_share, lagged_share, steady_weight, lagged_weight in motion.nodes:
        heading = theta + steady[1] * steady_share + lagged_turn * lagged_share
        step = steady[0] * steady_weight + lagged_way * lagged_weight
        x = x + step * cos(heading)
        y = y + step * sin(heading)
    return x, y, theta + traveled[1]
