"""The record of the guarded law, with its equation."""

from __future__ import annotations

from systems.framework.parameters import NonNegativeSpeed, Parameters
from systems.laws.law import Equation, Law


class GuardedGains(Parameters):
    """What the guarded law assumes about obstacles."""

    obstacle_speed_m_s: NonNegativeSpeed = 0.6
    """Speed that the law's guard assumes for obstacles in view, m/s, if
    ``guard.obstacle_speed_m_s`` is null. In a world at rest, set 0."""


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
    gains=GuardedGains,
    controller_name="GuardedController",
    guarded=True,
)
