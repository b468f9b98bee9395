"""The guarded law: gains, equation, and record."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import (
    Duration,
    Fraction,
    Length,
    NonNegative,
    NonNegativeLength,
    Parameters,
    Speed,
)
from systems.laws.law import Equation, Law


class GuardedParameters(Parameters):
    """How the guarded law drives, looks, and plans."""

    look_ahead_m: Length = 1.5
    """Greatest distance to the point of the route for which the robot heads, m."""
    weave_rad: float = Field(default=0.3, ge=0.0, le=1.5)
    """Amplitude of weaving to both sides, rad. Weaving sweeps the sensor cones."""
    weave_period_s: Duration = 2.4
    """Period of weaving, s."""
    search_rad: float = Field(default=1.0, ge=0.0, le=1.5)
    """Amplitude of weaving while the target or another body moves, rad."""
    search_period_s: Duration = 3.4
    """Period of weaving while the target or another body moves, s."""
    search_less: Fraction = 0.3
    """Share by which ``search_rad`` shrinks when the robot lags far behind the
    target."""
    hazard_speed_m_s: Speed = 0.6
    """Greatest speed of the bodies that the robot tracks, m/s."""
    risk_gain: NonNegative = 8.0
    """Cost of a predicted contact with a body, as a loss of wanted speed, m/s."""
    watch_gain: NonNegative = 0.7
    """Cost of a threat that is 1 rad out of view, as a loss of wanted speed, m/s."""
    replan_s: Duration = 0.5
    """Time from one plan to the next, s."""
    patience_s: Duration = 0.3
    """Time for which the guard blocks the robot before the robot looks around, s."""
    give_up_s: Duration = 5.5
    """Longest time that the robot stays at one place, s. After this time it marks the
    place ahead as blocked and backs off."""
    search_way_s: Duration = 20.0
    """Time that the robot searches while all routes cross cells with echoes, s. After
    this time it reports that it gives up."""
    mark_s: Duration = 10.0
    """Time for which routes avoid a place that was marked as blocked, s."""
    clearance_m: NonNegativeLength = 0.02
    """Distance that routes keep between the disc around the body and echoes, m."""
    source_clearance_m: NonNegativeLength = 0.85
    """Distance from the target within which echoes do not block routes, m."""
    source_radius_m: Length = 0.35
    """Distance from the target within which echoes count as echoes of the target, m.
    The robot expects no other body there."""


GUARDED = Law(
    name="guarded",
    title="Guarded law",
    label="guarded",
    equations=(
        Equation(
            "Guarded law: wanted speed and yaw rate",
            r"v=k_v\,(\ell-d_f)+k_s\,\dot{\ell}_S,"
            r"\quad\omega=k_\omega\,(\varphi_c-\theta+A\sin\frac{2\pi t}{T_w})",
            "v = k_v (l - d_f) + k_s v_S, w = k_w (phi_c - theta + A sin(2 pi t/T_w))",
        ),
    ),
    controller_name="GuardedController",
    gains=GuardedParameters,
    guarded=True,
)
