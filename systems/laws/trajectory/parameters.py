"""Gains of the laws for robots on a route."""

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

    K, D, and R are those of tables 1 and 2 of Engelbrecht, Steyn and Djouani (2021).
    The tables print one K and one D. The other defaults are ours.
    """

    stiffness_n_m: Stiffness = 3.0
    """Stiffness K to the target, N/m (tables 1 and 2)."""
    damping_n_s_m: Damping = 4.0
    """Damping D to the target, N s/m (tables 1 and 2)."""
    contact_stiffness_n_m: NonNegativeStiffness = 8.0
    """Stiffness K_e to robots and obstacles, N/m."""
    contact_damping_n_s_m: NonNegativeDamping = 4.0
    """Damping D_e to robots and obstacles, N s/m."""
    security_zone_m: Length = 0.8
    """Distance S from P at which contacts begin, m (1 m in tables 1 and 2)."""
    horizon_m: Length = 2.0
    """Distance R, m (tables 1 and 2). It has an effect only with ``zone`` envelope or
    jump."""
    zone: Literal["security", "envelope", "jump"] = "security"
    """Compression of the spring of a contact at the distance d. ``security``: S - d if
    d < S. ``envelope``: R - d if d < R. ``jump``: R - d if d < S. These are three
    readings of eq. 4, eq. 5, and section 6."""
    damping_fades: bool = True
    """Whether the damping of a contact is 0 at the edge of the zone and grows toward
    the object (our choice). If false, the full damping acts in the whole zone (as in
    the paper)."""
    reading: Literal["restored", "printed_force", "printed_state"] = "restored"
    """Signs of the contact forces. ``restored``: signs that follow from a potential.
    ``printed_force``: signs of eq. 4 and 5, with which the damping drives the motion.
    ``printed_state``: signs of eq. 10, with which the spring pulls toward the
    obstacle."""
    acceleration_limit_m_s2: Acceleration = 2.5
    """Largest acceleration of the virtual mass, m/s^2."""
    block_distance_m: Length | None = None
    """Distance L_block of eq. 6, m. P stops if its next step would end within this
    distance of an object and would not lead away from the object. null: eq. 6 is off.
    The paper prints no value. 0.2 m is enough for ``turtlebot3_burger``, whose rear
    corners are 0.174 m from P."""


class AdaptationParameters(Parameters):
    """How K, D, and K_e adapt (eq. 42). The paper prints no rates and no limits."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "none"
    """Rule of the adaptation. ``none``: no adaptation. ``lyapunov``: eq. 40 to 42 as
    printed, which are a Lyapunov rule. ``sensitivity``: gradient of eq. 27 with the
    sensitivities that eq. 34 intends."""
    rate: NonNegative = 10.0
    """Rate gamma = eta/T of K and D, (N/m)^2/(m^2 s)."""
    contact_rate: NonNegative = 0.0
    """Rate gamma of K_e, (N/m)^2/(m^2 s). With 0, K_e is fixed."""
    velocity_weight_s: Time = 0.5
    """Weight tau_v of velocity errors, s. An error of 1 m/s counts as an error of tau_v
    meters."""
    penalty: NonNegative = 0.0
    """Weight lambda of the safety term of eq. 27. With 0 the term is off. Eq. 27 prints
    lambda/2 (d_sec^2 - d^2) for each object. Here the term is lambda/2 max(0, d_sec -
    d)^2, so lambda has no unit, and the gradient is -lambda (d_sec - d) n. The term has
    an effect only with ``rule: sensitivity``. Without the term, a robot that adapts its
    gains collides more often than a robot with fixed gains."""
    penalty_distance_m: Length = 0.5
    """Distance d_sec of the safety term, m. Objects count only within the zone of
    contacts. Therefore values above ``security_zone_m`` have no further effect."""
    normalisation: Positive | None = None
    """Constant m_0 of the normalization. The rate of each gain is divided by the sum of
    m_0 and the squared sensitivity. none: no division."""
    projected: bool = False
    """Whether K, D, and K_e stay between their least and greatest values."""
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
    """Rate sigma at which all gains return to their nominal values, 1/s."""
    freezes: bool = False
    """Whether the adaptation stops during a contact. The return to the nominal gains by
    ``leakage`` continues."""

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
    """Poles of the reference model. none: the value from the nominal impedance."""

    natural_frequency_rad_s: Positive | None = None
    """Natural frequency w_n, rad/s (not printed)."""
    damping_ratio: Positive | None = None
    """Damping ratio xi (not printed)."""

    def poles(
        self, mass: float, stiffness: float, damping: float
    ) -> tuple[float, float]:
        """Returns w_n and xi. Fields that are None follow from M, K, and D.

        Args:
            mass: Virtual mass M, kg.
            stiffness: Stiffness K, N/m, above 0.
            damping: Damping D, N s/m.

        Returns:
            w_n, rad/s, and xi.
        """
        frequency = self.natural_frequency_rad_s or math.sqrt(stiffness / mass)
        ratio = self.damping_ratio or damping / (2.0 * math.sqrt(stiffness * mass))
        return frequency, ratio


class ConventionalTrajectoryParameters(TrajectoryImpedanceParameters):
    """The law of the paper with restored signs: K_e = K, D_e = D, and S of table 1."""

    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """Stiffness K_e to robots and obstacles, N/m."""
    security_zone_m: Length = 1.0
    """Distance S from P at which contacts begin, m."""
    damping_fades: bool = False
    """Whether the damping of a contact is 0 at the edge of the zone and grows toward
    the object. If false, the full damping acts in the whole zone, as printed."""


class PrintedAdaptationParameters(AdaptationParameters):
    """How K, D, and K_e adapt. The default is the rule that eq. 40 to 42 print."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "lyapunov"
    """Rule of the adaptation. ``none``: no adaptation. ``lyapunov``: eq. 40 to 42 as
    printed, which are a Lyapunov rule. ``sensitivity``: gradient of eq. 27 with the
    sensitivities that eq. 34 intends."""


class AdaptiveTrajectoryParameters(ConventionalTrajectoryParameters):
    """The conventional law with the adaptation that eq. 40 to 42 print."""

    adaptation: PrintedAdaptationParameters = PrintedAdaptationParameters()
    """How K, D, and K_e adapt."""
    reference: ReferenceModelParameters = ReferenceModelParameters()
    """Reference model of the adaptation."""
    safety_filter: SafetyFilterParameters | None = None
    """Filter that keeps P away from objects, whatever the gains. null: no filter."""


class FilteredTrajectoryParameters(TrajectoryImpedanceParameters):
    """This project's variant: a narrower and stiffer zone, and a safety filter."""

    safety_filter: SafetyFilterParameters = SafetyFilterParameters()
    """Filter that keeps P away from objects, whatever the gains."""
