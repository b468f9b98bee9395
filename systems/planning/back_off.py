"""Backing off, after the robot has stayed in one place or if it cannot turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.framework.compiling import njit
from systems.planning.drive_state import BACKING, DRIVING, DriveMemory, restart_stay
from systems.planning.following import BACK_SPEED_M_S
from systems.planning.turning import TURN_FIRST_RAD, turn_rate
from systems.safety.braking import BRAKED, TURNED

#: Time for which the guard holds the robot before the robot tries something else, s.
PATIENCE_S = 0.3
#: Duration of backing off, s.
_BACKING_S = 2.0


@njit(cache=True)
def begin_backing(m: DriveMemory, time: float) -> None:  # pragma: no cover  (compiled)
    """Begins to back off. The robot plans a new route."""
    m.mode[0], m.backs[0] = BACKING, -1.0
    m.backed_s[0], m.planned_s[0] = time, -np.inf


@njit(cache=True)
def back_off(
    m: DriveMemory, time: float, pose: Any, error: float, report: Any
) -> None:  # pragma: no cover  (compiled)
    """Drives back for ``_BACKING_S``, or ahead if the guard does not let it drive back.

    A robot that can neither turn nor drive back gets room for the turn ahead. With a
    large heading error, it turns as soon as the guard permits the turn.
    """
    since = time - m.backed_s[0]
    if abs(error) > TURN_FIRST_RAD:
        m.turn[0] = turn_rate(error)
    held = report[0] >= BRAKED if m.turn[0] != 0.0 else report[0] >= TURNED
    held = held and since > PATIENCE_S
    if held and m.backs[0] < 0.0:
        m.backs[0], m.backed_s[0] = 1.0, time
    elif held or since > _BACKING_S:
        m.mode[0], m.blocked_s[0] = DRIVING, time
        restart_stay(m, pose, time)
    m.speed[0] = m.backs[0] * BACK_SPEED_M_S
