"""Gains of the laws that follow a route."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Acceleration,
    Damping,
    Length,
    NonNegative,
    NonNegativeDamping,
    NonNegativeStiffness,
    Parameters,
    Positive,
    Stiffness,
    Time,
)
from systems.planning.parameters import SafetyFilterParameters

__all__ = [
    "AdaptationParameters",
    "AdaptiveTrajectoryParameters",
    "ConventionalTrajectoryParameters",
    "FilteredTrajectoryParameters",
    "PrintedAdaptationParameters",
    "ReferenceModelParameters",
    "TrajectoryImpedanceParameters",
]


class TrajectoryImpedanceParameters(Parameters):
    """Springs and dampers to the target and to contacts; the defaults are ours."""

    stiffness_n_m: Stiffness = 3.0
    """K to the target, N/m."""
    damping_n_s_m: Damping = 4.0
    """D to the target, N s/m."""
    contact_stiffness_n_m: NonNegativeStiffness = 8.0
    """K_e to robots and obstacles, N/m."""
    contact_damping_n_s_m: NonNegativeDamping = 4.0
    """D_e to robots and obstacles, N s/m."""
    security_zone_m: Length = 0.8
    """S: contacts begin at this distance from P, m (1 m in table 1)."""
    horizon_m: Length = 2.0
    """R, m; counts with ``zone`` envelope or jump alone."""
    zone: Literal["security", "envelope", "jump"] = "security"
    """Three readings of eq. 4, 5 and sec. 6: S - d within S; R - d within R; R - d
    within S."""
    damping_fades: bool = True
    """Whether the damping of a contact grows from 0 at the edge of the zone (ours), or
    is switched on there (the paper)."""
    reading: Literal["restored", "printed_force", "printed_state"] = "restored"
    """Signs that follow from a potential; those of eq. 4 and 5, whose damping drives;
    or those of eq. 10, whose spring pulls to the obstacle."""
    acceleration_limit_m_s2: Acceleration = 2.5
    """Largest acceleration of the virtual mass, m/s^2."""


class AdaptationParameters(Parameters):
    """How K, D and K_e adapt (eq. 42); rates and cures are not printed."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "none"
    """Nothing adapts; eq. 40 to 42 as they are printed, which is a Lyapunov rule; or
    the gradient of eq. 27 by the sensitivities that eq. 34 means."""
    rate: NonNegative = 10.0
    """gamma = eta/T of K and D, (N/m)^2/(m^2 s)."""
    contact_rate: NonNegative = 0.0
    """The same of K_e."""
    velocity_weight_s: Time = 0.5
    """tau_v, s: an error of 1 m/s counts as one of tau_v metres."""
    penalty: NonNegative = 0.0
    """lambda of the hinge on distances below ``penalty_distance_m``."""
    penalty_distance_m: Length = 0.5
    """d_sec, m."""
    normalisation: Positive | None = None
    """m_0: rates are divided by m_0 and the squared sensitivity; none: they are not."""
    projected: bool = False
    """Whether K and D stay in their boxes."""
    stiffness_box_n_m: tuple[Positive, Positive] = Field(
        default=(0.5, 6.0), strict=False
    )
    """Least and greatest K, N/m."""
    damping_box_n_s_m: tuple[Positive, Positive] = Field(
        default=(3.0, 8.0), strict=False
    )
    """Least and greatest D, N s/m."""
    contact_box_n_m: tuple[Positive, Positive] = Field(
        default=(0.5, 24.0), strict=False
    )
    """Least and greatest K_e, N/m."""
    leakage: NonNegative = 0.0
    """sigma, 1/s: at which all returns to its nominal value."""
    freezes: bool = False
    """Whether nothing adapts while there is a contact."""

    @model_validator(mode="after")
    def _check(self) -> AdaptationParameters:
        for name in ("stiffness_box_n_m", "damping_box_n_s_m", "contact_box_n_m"):
            low, high = getattr(self, name)
            if low >= high:
                raise InputError(
                    name, f"begins at {low:g} and ends at {high:g}; give the less first"
                )
        return self


class ReferenceModelParameters(Parameters):
    """Its poles; none: those of the nominal impedance, so that nothing is to adapt."""

    natural_frequency_rad_s: Positive | None = None
    """w_n, rad/s; not printed."""
    damping_ratio: Positive | None = None
    """xi; not printed."""

    def poles(
        self, mass: float, stiffness: float, damping: float
    ) -> tuple[float, float]:
        """w_n, rad/s, and xi, those of M, K and D where they are not given.

        Args:
            mass: M, kg.
            stiffness: K, N/m, above 0.
            damping: D, N s/m.

        Returns:
            Both.
        """
        frequency = self.natural_frequency_rad_s or math.sqrt(stiffness / mass)
        ratio = self.damping_ratio or damping / (2.0 * math.sqrt(stiffness * mass))
        return frequency, ratio


class ConventionalTrajectoryParameters(TrajectoryImpedanceParameters):
    """As in the paper, with the signs restored: K_e = K, S of table 1."""

    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """K_e to robots and obstacles, N/m."""
    security_zone_m: Length = 1.0
    """S, m."""
    damping_fades: bool = False
    """Switched on at the edge of the zone, as it is printed."""


class PrintedAdaptationParameters(AdaptationParameters):
    """How K, D and K_e adapt: as eq. 40 to 42 are printed, unless ``rule`` is set."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "lyapunov"
    """Nothing adapts; eq. 40 to 42 as they are printed, which is a Lyapunov rule; or
    the gradient of eq. 27 by the sensitivities that eq. 34 means."""


class AdaptiveTrajectoryParameters(ConventionalTrajectoryParameters):
    """The same with the adaptation that eq. 40 to 42 print."""

    adaptation: PrintedAdaptationParameters = PrintedAdaptationParameters()
    """How K, D and K_e adapt."""
    reference: ReferenceModelParameters = ReferenceModelParameters()
    """What they adapt to."""
    safety_filter: SafetyFilterParameters | None = None
    """Keeps P off objects, whatever the impedance; null: nothing does."""


class FilteredTrajectoryParameters(TrajectoryImpedanceParameters):
    """Ours: a narrower and stiffer zone, and a filter."""

    safety_filter: SafetyFilterParameters = SafetyFilterParameters()
    """Keeps P off objects, whatever the impedance."""
