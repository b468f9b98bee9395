"""The rules by which the olfactory robot of Song 2011 chooses its heading."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from systems.search.search_ending import UNDECIDED


@register_jitable
def song2011_turn(
    gas: Any, airflow: Any, memory: Any, rules: Any
) -> tuple[float, int, int]:
    """Computes the turning angle after a stop (Song 2011, 2.3.3 and 4.2).

    Phase 1 lasts until the robot is in the plume for the first time. Afterwards, the
    airflow sensors determine the phase: phase 2 if one sensor has wind, phase 3 if
    neither sensor has wind, and phase 4 if both sensors have wind. Phase 4 compares R1
    with R3, as phase 3 does. For point G, section 4.2 prints "output of R1 was less
    than R2", but the text can only mean R3.

    Args:
        gas: (R1, R2, R3), the ratios Rs/R0 right front, rear and left front.
        airflow: (F1, F2), left and right reading.
        memory: The first number is 1 after the robot was in the plume, else 0. The
            function changes it.
        rules: ``SongRuleParameters``.

    Returns:
        Turning angle, clockwise, deg; phase, 1 to 4; and ``UNDECIDED``.
    """
    right, rear, left = gas
    least = min(right, rear, left)
    # The side of the front sensor with more gas: 1 right, -1 left.
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
