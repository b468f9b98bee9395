"""Motion of the base while its wheels approach a held command with the motors' lag."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.framework.scalar_math import cos, sin

#: Nodes of Gauss and Legendre's quadrature on each panel.
_NODES = 4
#: No panel is longer, s: it bounds the turn within a panel.
_LONGEST_PANEL_S = 0.1


class LaggedMotion(NamedTuple):
    """How wheels turn in a period during which their command is held.

    With the lag tau each wheel's speed is c + (w - c) exp(-t/tau): c its command, w its
    speed at the start. Its angle is then the sum of a *steady* part that grows in
    proportion to time, c t, and of a *lagged* part that grows as 1 - exp(-t/tau).
    """

    duration_s: float
    lag_s: float
    """tau, s."""
    kept: float
    """exp(-duration/tau): share of w - c that is left at the end."""
    lagged_s: float
    """tau (1 - kept): angle of the lagged part for each rad/s of w - c, s."""
    least_share: float
    """Where pulses are counted, a tick's steady part counts with this share at least,
    whatever the net way: see docs/guard.md, "Encoders"."""
    nodes: tuple[tuple[float, float, float, float], ...]
    """Of the quadrature: shares of the steady and of the lagged part that are behind
    the robot at the node, and the weights of the node for both."""


def lagged_motion(duration_s: float, lag_s: float) -> LaggedMotion:
    """The numbers of ``LaggedMotion``.

    Args:
        duration_s: Of the period, s.
        lag_s: Time constant of the wheels' speeds, s.

    Returns:
        The numbers. Panels of the quadrature are no longer than the lag, so that its
        error is below 1e-10 of the way.
    """
    panels = math.ceil(max(duration_s / lag_s, duration_s / _LONGEST_PANEL_S) - 1e-9)
    at, weight = np.polynomial.legendre.leggauss(_NODES)
    starts = np.arange(panels)[:, None]
    share = np.ravel(starts + 0.5 * (1.0 + at)) / panels
    steady = np.tile(0.5 * weight, panels) / panels
    decay = np.exp(-share * duration_s / lag_s)
    kept = math.exp(-duration_s / lag_s)
    # Weights add up to 1, so that a straight way is exact.
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
def advance_pose(pose: Any, travelled: Any, steady: Any, motion: LaggedMotion) -> Any:
    """Pose after a period in which the command was held.

    Args:
        pose: (x, y, theta) at the start, m and rad; floats or AutoDiffXd.
        travelled: Way, m, and turn, rad, of the body in the period.
        steady: What they would have been, had the wheels run at their commanded speeds
            from the start.
        motion: ``LaggedMotion`` of the period.

    Returns:
        (x, y, theta): the integral of (cos theta, sin theta) along the way.
    """
    lagged_way, lagged_turn = travelled[0] - steady[0], travelled[1] - steady[1]
    x, y, theta = pose[0], pose[1], pose[2]
    for steady_share, lagged_share, steady_weight, lagged_weight in motion.nodes:
        heading = theta + steady[1] * steady_share + lagged_turn * lagged_share
        step = steady[0] * steady_weight + lagged_way * lagged_weight
        x = x + step * cos(heading)
        y = y + step * sin(heading)
    return x, y, theta + travelled[1]
