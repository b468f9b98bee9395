"""Avoidance laws."""

from pydrake.math import exp

PUSH_N = 14.0
REACH_M = 0.45


def soft(c, s, laws):
    """Returns the force (N) that pushes the robot away from an obstacle.

    The distance ``c`` is in m and the relative speed ``s`` in m/s. The gains of the
    scenario are in ``laws``.
    """
    return PUSH_N * exp(-c / REACH_M) + laws.conventional.damping_n_s_m * s
