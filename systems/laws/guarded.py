"""The guarded law: gains, equation and record."""

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
    """How the guarded law drives, looks and plans."""

    look_ahead_m: Length = 1.5
    """Greatest distance of the points of its path that it heads for, m."""
    weave_rad: float = Field(default=0.3, ge=0.0, le=1.5)
    """Amplitude of weaving to both sides, with which its sensors sweep, rad."""
    weave_period_s: Duration = 2.4
    """Period of weaving, s."""
    search_rad: float = Field(default=1.0, ge=0.0, le=1.5)
    """Amplitude of weaving where the target or another body moves, rad."""
    search_period_s: Duration = 3.4
    """Period of weaving where something moves, s."""
    search_less: Fraction = 0.3
    """Share by which it weaves less where it lags behind the target."""
    hazard_speed_m_s: Speed = 0.6
    """Greatest speed of the bodies that it tracks, m/s."""
    risk_gain: NonNegative = 8.0
    """Cost of a predicted contact with a body, as loss of wanted speed, m/s."""
    watch_gain: NonNegative = 0.7
    """Cost of a threat that is 1 rad out of view, as loss of wanted speed, m/s."""
    replan_s: Duration = 0.5
    """Time from one plan to the next, s."""
    patience_s: Duration = 0.3
    """After being blocked by the guard for this time it looks at the obstacle, s."""
    give_up_s: Duration = 5.5
    """Longest time that it stays there before it marks the obstacle ahead and backs
    off, s."""
    search_way_s: Duration = 20.0
    """Time that it seeks a path where all paths lead through echoes, s."""
    mark_s: Duration = 10.0
    """Time that it seeks paths away from the obstacle that blocked it, s."""
    clearance_m: NonNegativeLength = 0.02
    """Distance that paths keep between the disc around the body and echoes, m."""
    source_clearance_m: NonNegativeLength = 0.85
    """Echoes within this distance of the target do not block paths, m."""
    source_radius_m: Length = 0.35
    """Echoes within this distance of the target count as echoes of the target: no other
    body is there, m."""


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
    plans=True,
    guarded=True,
)
