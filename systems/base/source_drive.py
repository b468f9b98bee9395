"""Wheels of the robot that carries the loudspeaker, and its motion within a tick."""

from __future__ import annotations

from typing import Any

from systems.framework.signals import TICK_S

#: Radius of the driven wheels, m, then distance between them, m (Han 2019, table 5).
WHEEL_RADIUS_M, WHEEL_SEPARATION_M = 0.06, 0.29

#: Limit of the rim speed of each wheel, m/s.
TOP_SPEED_M_S = 1.0

#: Mass, kg (Han 2019, table 5), then largest force of each motor at the rim of its
#: wheel, N (our choice).
_MASS_KG, _WHEEL_FORCE_N = 5.3, 5.3

#: Limit of the acceleration of the rim of each wheel, m/s^2. Straight ahead, both
#: wheels accelerate by 2 F/m, where F is the force of one motor and m is the mass. In a
#: turn, the limit is about the same. The reason is that the moment of inertia of the
#: body is about that of two point masses m/2 at the wheels.
WHEEL_ACCELERATION_M_S2 = 2.0 * _WHEEL_FORCE_N / _MASS_KG


def value_weights(s: Any) -> tuple[Any, Any, Any]:
    """Computes the weights p, q, and r of a cubic Hermite polynomial over 25 ms.

    The polynomial has the value a and the slope a' at the start, and the value b and
    the slope b' at the end. Its value in between is a + p (b - a) + q a' + r b'.

    Args:
        s: Elapsed share of the interval, from 0 to 1.

    Returns:
        (p, q, r). The weight p has no unit. The weights q and r are in s.
    """
    rest = TICK_S * s * (1.0 - s)
    return s * s * (3.0 - 2.0 * s), rest * (1.0 - s), -rest * s
