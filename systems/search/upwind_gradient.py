"""Our rules for the search by smell: upwind, and toward the side with more gas."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.search.search_ending import NO_WIND, UNDECIDED


class _Places(NamedTuple):
    """Indices in the memory of the rules."""

    best: int
    """Largest value of 1 - Rs/R0 so far."""
    casts: int
    """Number of steps since the robot lost the plume."""
    side: int
    """Side with more gas at the last stop in the plume: 1 right, -1 left."""
    calm: int
    """Number of consecutive stops without wind."""


_AT = _Places(*range(4))
#: Number of values that the rules store from stop to stop.
RULE_MEMORY = len(_AT)
#: Gain of the angle between the upwind direction and the heading, deg. The angle is
#: this gain times the natural logarithm of R3/R1, the quotient of the ratios Rs/R0 of
#: the two front sensors. It points toward the front sensor with more gas.
_GAIN_DEG = 20.0
#: Largest angle from upwind toward the side with more gas, deg.
_LARGEST_LEAN_DEG = 45.0
#: The robot has lost the plume if 1 - Rs/R0 of all sensors is below this share of the
#: largest value so far.
_LOST_SHARE = 0.35
#: Angle from upwind at which the robot searches for a lost plume, deg. The robot goes
#: to the left and to the right alternately, and each time one step farther.
_CAST_DEG = 110.0
#: There is no wind if both airflow sensors read less than this, in their unit.
_STILL_AIR = 0.05
#: An airflow reading below this share of the other reading counts as no wind.
_SHADED = 0.1
#: Angle of the wind if only one sensor has wind, deg. The true angle is between 45 and
#: 135 deg.
_ABEAM_DEG = 80.0
#: Lower limit of the gas ratios in the logarithm.
_LEAST = 0.01
#: Number of consecutive stops without wind after which the search ends. The robot turns
#: by 180 deg between these stops.
_CALM_STOPS = 3


@register_jitable
def upwind_angle(airflow: Any) -> float:
    """Computes the upwind direction from two sensors at 45 deg to the left and right.

    The method assumes that each reading is proportional to the cosine of the angle
    between the wind and the sensor. The result is exact if the upwind direction is
    within 39 deg of the heading. Otherwise, it is 80 deg to the side from which the
    wind comes.

    ``airflow`` has the left and the right reading. The result is the turning angle to
    the upwind direction, clockwise, deg.
    """
    left, right = airflow
    larger = max(left, right)
    if min(left, right) < _SHADED * larger:
        return -_ABEAM_DEG if left > right else _ABEAM_DEG
    return math.degrees(math.atan2(right - left, right + left))


@register_jitable
def upwind_gradient_turn(gas: Any, airflow: Any, memory: Any) -> tuple[float, int, int]:
    """Computes the turning angle of a robot after a stop, from gas and wind.

    There are three cases:

    - In the plume, the robot goes upwind, and turns a little toward the side with more
      gas.
    - After the robot has lost the plume, it crosses the wind to find the plume again.
      It makes one step to the side of its last turn toward the gas, then two steps to
      the other side, then three steps to the first side, and so on.
    - Without wind, the robot turns by 180 deg. The search ends after ``_CALM_STOPS``
      consecutive stops without wind.

    Args:
        gas: (R1, R2, R3), ratios Rs/R0 of the gas sensors at the right front, the rear
            and the left front. A ratio is 1 in clean air, and smaller in gas.
        airflow: (F1, F2), readings of the left and the right airflow sensor.
        memory: ``RULE_MEMORY`` numbers, initially 0. The function changes them.

    Returns:
        Turning angle, clockwise, deg; phase, 1 upwind or 2 across; and ``NO_WIND`` if
        the search ends, else ``UNDECIDED``.
    """
    if max(airflow[0], airflow[1]) < _STILL_AIR:
        memory[_AT.calm] += 1.0
        ended = NO_WIND if memory[_AT.calm] >= _CALM_STOPS else UNDECIDED
        return 180.0, 1, ended
    memory[_AT.calm] = 0.0
    upwind = upwind_angle(airflow)
    strongest = 1.0 - min(gas[0], gas[1], gas[2])
    memory[_AT.best] = max(memory[_AT.best], strongest)
    if strongest < _LOST_SHARE * memory[_AT.best]:
        memory[_AT.casts] += 1.0
        # Leg k, from 0, has k + 1 steps. Even legs go to the side of the last angle.
        leg = math.floor(0.5 * (math.sqrt(8.0 * memory[_AT.casts] - 7.0) - 1.0) + 1e-9)
        side = memory[_AT.side] if leg % 2 == 0 else -memory[_AT.side]
        turn = _CAST_DEG if side >= 0.0 else -_CAST_DEG
        return upwind + turn, 2, UNDECIDED
    memory[_AT.casts] = 0.0
    lean = _GAIN_DEG * math.log(max(gas[2], _LEAST) / max(gas[0], _LEAST))
    lean = min(max(lean, -_LARGEST_LEAN_DEG), _LARGEST_LEAN_DEG)
    memory[_AT.side] = 1.0 if lean >= 0.0 else -1.0
    return upwind + lean, 1, UNDECIDED
