"""The rules by which the olfactory robot of Song 2011 chooses its way."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from systems.search.search_ending import UNDECIDED


@register_jitable
def song2011_turn(
    gas: Any, airflow: Any, memory: Any, rules: Any
) -> tuple[float, int, int]:
    """Steering angle after a stop (Song 2011, 2.3.3 and 4.2).

    Phase 4 compares R1 with R3, as phase 3 does: what 4.2 prints of point G, "output
    of R1 was less than R2", can only be R3.

    Args:
        gas: (R1, R2, R3): right front, rear, left front, Rs/R0.
        airflow: (F1, F2): left, right.
        memory: Its first number is 1 once the robot was in the plume; changed.
        rules: ``SongRuleParameters``.

    Returns:
        Turn, clockwise, deg; phase, 1 to 4; and ``UNDECIDED``.
    """
    right, rear, left = gas
    least = min(right, rear, left)
    # To the side of the front sensor that smells more.
    side = 0.0
    if right != left:
        side = 1.0 if right < left else -1.0
    if memory[0] < 0.5 and max(right, rear, left) < rules.initial_threshold:
        memory[0] = 1.0
    left_blown = airflow[0] > rules.airflow_threshold
    right_blown = airflow[1] > rules.airflow_threshold
    if memory[0] < 0.5:
        turn, phase = (180.0 if rear == least else 60.0 * side), 1
    elif left_blown != right_blown:
        turn = rules.upwind_turn_deg if right_blown else -rules.upwind_turn_deg
        phase = 2
    elif left_blown:
        turn, phase = rules.local_turn_deg * side, 4
    elif rear == least and rear < rules.reverse_threshold:
        turn, phase = 180.0, 3
    elif min(right, left) < rules.turning_threshold:
        turn, phase = rules.gradient_turn_deg * side, 3
    else:
        turn, phase = 0.0, 3
    return turn, phase, UNDECIDED
