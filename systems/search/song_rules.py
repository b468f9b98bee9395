"""The rules by which the olfactory robot of Song 2011 chooses its heading."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from systems.search.search_ending import UNDECIDED

# Thresholds and angles of the four phases (Song 2011, 4.2).
#: R_init. The robot is in the plume if all three ratios Rs/R0 are below this value.
_INITIAL_THRESHOLD = 0.95
#: F_thresh, reading above which an airflow sensor has wind, in the unit of the port
#: ``airflow``. The paper prints no unit. ``airflow_sensors.gain_s_m`` therefore defines
#: which wind speed corresponds to this value.
AIRFLOW_THRESHOLD = 1.0
#: R_turning. In phase 3, the robot turns if R1 or R3 is below this value.
_TURNING_THRESHOLD = 0.75
#: R_reverse. In phase 3, the robot turns back if R2 is the smallest ratio and is below
#: this value. The value is our choice, because the paper prints none.
_REVERSE_THRESHOLD = 0.9
#: Turning angles in the phases 1 (toward a front sensor), 2, 3 and 4, deg.
_INITIAL_TURN_DEG, _UPWIND_TURN_DEG = 60.0, 45.0
_GRADIENT_TURN_DEG, _LOCAL_TURN_DEG = 60.0, 30.0


@register_jitable
def song2011_turn(gas: Any, airflow: Any, memory: Any) -> tuple[float, int, int]:
    """Computes the turning angle after a stop (Song 2011, 2.3.3 and 4.2).

    Phase 1 lasts until the robot is in the plume for the first time. Afterwards, the
    phase depends on the airflow sensors:

    - phase 2 if one sensor detects wind
    - phase 3 if no sensor detects wind
    - phase 4 if both sensors detect wind

    Phases 3 and 4 both compare R1 with R3. For point G, section 4.2 of the paper prints
    "output of R1 was less than R2", which can only mean R3.

    Args:
        gas: (R1, R2, R3), ratios Rs/R0 of the gas sensors at the right front, the rear
            and the left front. A ratio is 1 in clean air, and smaller in gas.
        airflow: (F1, F2), readings of the left and the right airflow sensor.
        memory: Array that the function changes. Its first number is 1 once the robot
            has been in the plume, and 0 before.

    Returns:
        Turning angle, clockwise, deg; phase, 1 to 4; and ``UNDECIDED``, because the
        rules never end the search.
    """
    right, rear, left = gas
    least = min(right, rear, left)
    # The side of the front sensor with more gas: 1 right, -1 left.
    side = 0.0
    if right != left:
        side = 1.0 if right < left else -1.0
    if memory[0] < 0.5 and max(right, rear, left) < _INITIAL_THRESHOLD:
        memory[0] = 1.0
    left_blown = airflow[0] > AIRFLOW_THRESHOLD
    right_blown = airflow[1] > AIRFLOW_THRESHOLD
    if memory[0] < 0.5:
        turn, phase = (180.0 if rear == least else _INITIAL_TURN_DEG * side), 1
    elif left_blown != right_blown:
        turn = _UPWIND_TURN_DEG if right_blown else -_UPWIND_TURN_DEG
        phase = 2
    elif left_blown:
        turn, phase = _LOCAL_TURN_DEG * side, 4
    elif rear == least and rear < _REVERSE_THRESHOLD:
        turn, phase = 180.0, 3
    elif min(right, left) < _TURNING_THRESHOLD:
        turn, phase = _GRADIENT_TURN_DEG * side, 3
    else:
        turn, phase = 0.0, 3
    return turn, phase, UNDECIDED
