"""Rules that go upwind and lean towards the stronger smell; ours."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.search.search_ending import NO_WIND, UNDECIDED


class _Places(NamedTuple):
    """Places in the memory of the rules."""

    best: int
    """Strongest smell."""
    casts: int
    """Casts since the plume was lost."""
    side: int
    """Side of the last lean: 1 right, -1 left."""
    calm: int
    """Stops in a row without wind."""


_AT = _Places(*range(4))
#: Numbers that a rule may remember from stop to stop.
RULE_MEMORY = len(_AT)
#: A reading below this share of the other sensor's is no reading.
_SHADED = 0.1
#: Where one sensor alone is blown at, the wind comes from 45 to 135 deg off.
_ABEAM_DEG = 80.0
#: Least ratio of a gas sensor that counts.
_LEAST = 0.01
#: Stops in a row without any wind, a half turn between them, end the search.
_CALM_STOPS = 3


@register_jitable
def upwind_angle(airflow: Any) -> float:
    """Where the wind comes from, by two sensors 45 deg to either side.

    Args:
        airflow: (F1, F2): left, right.

    Returns:
        Angle to turn upwind, clockwise, deg; exact up to 45 deg off with sensors that
        read the cosine of the angle, beyond that 80.
    """
    left, right = airflow
    larger = max(left, right)
    if min(left, right) < _SHADED * larger:
        return -_ABEAM_DEG if left > right else _ABEAM_DEG
    return math.degrees(math.atan2(right - left, right + left))


@register_jitable
def upwind_gradient_turn(
    gas: Any, airflow: Any, memory: Any, rules: Any
) -> tuple[float, int, int]:
    """Steering angle after a stop.

    Args:
        gas: (R1, R2, R3): right front, rear, left front, Rs/R0.
        airflow: (F1, F2): left, right.
        memory: ``RULE_MEMORY`` numbers, 0 at first; changed.
        rules: ``UpwindGradientParameters``.

    Returns:
        Turn, clockwise, deg; phase: 1 upwind, 2 across; and
        ``NO_WIND`` where there is none to go by, else ``UNDECIDED``.
    """
    if max(airflow[0], airflow[1]) < rules.still_air:
        memory[_AT.calm] += 1.0
        ended = NO_WIND if memory[_AT.calm] >= _CALM_STOPS else UNDECIDED
        return 180.0, 1, ended
    memory[_AT.calm] = 0.0
    upwind = upwind_angle(airflow)
    strongest = 1.0 - min(gas[0], gas[1], gas[2])
    memory[_AT.best] = max(memory[_AT.best], strongest)
    if strongest < rules.lost_share * memory[_AT.best]:
        memory[_AT.casts] += 1.0
        # One step to the side of the last lean, two to the other, three back ...
        leg = math.floor(0.5 * (math.sqrt(8.0 * memory[_AT.casts] - 7.0) - 1.0) + 1e-9)
        side = memory[_AT.side] if leg % 2 == 0 else -memory[_AT.side]
        turn = rules.cast_deg if side >= 0.0 else -rules.cast_deg
        return upwind + turn, 2, UNDECIDED
    memory[_AT.casts] = 0.0
    lean = rules.gain_deg * math.log(max(gas[2], _LEAST) / max(gas[0], _LEAST))
    lean = min(max(lean, -rules.largest_lean_deg), rules.largest_lean_deg)
    memory[_AT.side] = 1.0 if lean >= 0.0 else -1.0
    return upwind + lean, 1, UNDECIDED
