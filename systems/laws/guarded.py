"""The record of the guarded law, with its equation."""

from __future__ import annotations

from systems.laws.law import Equation, Law

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
    guarded=True,
)
