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


class TrajectoryImpedanceParameters(Parameters):
    """Springs and dampers to the target and to contacts.

    K, D and R are those of tables 1 and 2 of Engelbrecht, Steyn and Djouani (2021),
    which print one K and one D; the other defaults are ours.
    """

    stiffness_n_m: Stiffness = 3.0
    """K to the target, N/m (tables 1 and 2)."""
    damping_n_s_m: Damping = 4.0
    """D to the target, N s/m (tables 1 and 2)."""
    contact_stiffness_n_m: NonNegativeStiffness = 8.0
    """K_e to robots and obstacles, N/m."""
    contact_damping_n_s_m: NonNegativeDamping = 4.0
    """D_e to robots and obstacles, N s/m."""
    security_zone_m: Length = 0.8
    """S: contacts begin at this distance from P, m (1 m in tables 1 and 2)."""
    horizon_m: Length = 2.0
    """R, m (tables 1 and 2); it has an effect only with ``zone`` envelope or jump."""
    zone: Literal["security", "envelope", "jump"] = "security"
    """Three readings of eq. 4, 5 and sec. 6: S - d within S; R - d within R; R - d
    within S."""
    damping_fades: bool = True
    """Whether the damping of a contact grows from 0 at the edge of the zone (our
    choice), or is switched on there (the paper)."""
    reading: Literal["restored", "printed_force", "printed_state"] = "restored"
    """Signs that follow from a potential; signs of eq. 4 and 5, with which damping
    drives the motion; or signs of eq. 10, with which the spring pulls toward the
    obstacle."""
    acceleration_limit_m_s2: Acceleration = 2.5
    """Largest acceleration of the virtual mass, m/s^2."""
    block_distance_m: Length | None = None
    """L_block of eq. 6, m: P stops before a step that would end nearer to an object
    than this and does not lead away from it. null: eq. 6 is off. The paper prints no
    value; 0.2 m is enough for ``turtlebot3_burger``, whose corners are 0.174 m from
    P."""


class AdaptationParameters(Parameters):
    """How K, D and K_e adapt (eq. 42); rates and cures are not printed."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "none"
    """No adaptation; eq. 40 to 42 as printed, which is a Lyapunov rule; or the gradient
    of eq. 27 with the sensitivities that eq. 34 intends."""
    rate: NonNegative = 10.0
    """gamma = eta/T of K and D, (N/m)^2/(m^2 s)."""
    contact_rate: NonNegative = 0.0
    """gamma of K_e, (N/m)^2/(m^2 s); 0: K_e is fixed."""
    velocity_weight_s: Time = 0.5
    """tau_v, s: an error of 1 m/s counts as an error of tau_v meters."""
    penalty: NonNegative = 0.0
    """lambda, the weight of the safety term of eq. 27; 0: the term is off. Eq. 27
    prints lambda/2 (d_sec^2 - d^2) for each object; here it is lambda/2 max(0, d_sec -
    d)^2, so that lambda has no unit and its gradient is -lambda (d_sec - d) n. It has
    an effect only with ``rule`` sensitivity. Without it the robot collides more often
    than with fixed gains."""
    penalty_distance_m: Length = 0.5
    """d_sec of the safety term, m. Objects count only within the zone of contacts, so
    that values above ``security_zone_m`` have no further effect."""
    normalisation: Positive | None = None
    """m_0: rates are divided by m_0 and the squared sensitivity; none: no division."""
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
    """sigma, 1/s: rate at which all gains return to their nominal values."""
    freezes: bool = False
    """Whether adaptation stops while there is a contact."""

    @model_validator(mode="after")
    def _check(self) -> AdaptationParameters:
        for name in ("stiffness_box_n_m", "damping_box_n_s_m", "contact_box_n_m"):
            low, high = getattr(self, name)
            if low >= high:
                raise InputError(
                    name,
                    f"begins at {low:g} and ends at {high:g}; give the lower end first",
                )
        return self


class ReferenceModelParameters(Parameters):
    """Poles of the reference model; none: poles of the nominal impedance."""

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
    """As in the paper, with the signs restored: K_e = K, D_e = D, S of table 1."""

    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """K_e to robots and obstacles, N/m."""
    security_zone_m: Length = 1.0
    """S, m."""
    damping_fades: bool = False
    """Whether damping grows from 0 at the edge of the zone; off: it is switched on
    there, as printed."""


class PrintedAdaptationParameters(AdaptationParameters):
    """How K, D and K_e adapt: as eq. 40 to 42 are printed, unless ``rule`` is set."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "lyapunov"
    """No adaptation; eq. 40 to 42 as printed, which is a Lyapunov rule; or the gradient
    of eq. 27 with the sensitivities that eq. 34 intends."""


class AdaptiveTrajectoryParameters(ConventionalTrajectoryParameters):
    """The conventional law with the adaptation that eq. 40 to 42 print."""

    adaptation: PrintedAdaptationParameters = PrintedAdaptationParameters()
    """How K, D and K_e adapt."""
    reference: ReferenceModelParameters = ReferenceModelParameters()
    """Reference model of the adaptation."""
    safety_filter: SafetyFilterParameters | None = None
    """Keeps P off objects, with any impedance; null: no filter."""


class FilteredTrajectoryParameters(TrajectoryImpedanceParameters):
    """This project's variant: a narrower and stiffer zone, and a filter."""

    safety_filter: SafetyFilterParameters = SafetyFilterParameters()
    """Keeps P off objects, with any impedance."""
