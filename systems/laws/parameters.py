"""Attraction, and the gains of the laws that follow a sound, one set a law."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Literal

from pydantic import Field, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Damping,
    Duration,
    Fraction,
    Length,
    NonNegative,
    NonNegativeDamping,
    NonNegativeLength,
    NonNegativeStiffness,
    Parameters,
    Positive,
    Speed,
    Stiffness,
)

VelocityTerm = Literal["printed", "closing"]


class AttractionParameters(Parameters):
    """The spring and damper to the target (Han 2019, eq. 18 and section 5)."""

    stiffness_n_m: NonNegativeStiffness = 2.0
    """K_r, N/m; printed without unit."""
    damping_n_s_m: NonNegativeDamping = 1.0
    """D_r, N s/m; printed without unit. Damping ratio 0.18 with K_r = 2."""
    follow_distance_m: NonNegativeLength = 1.2
    """Distance d_f from the source at which the attraction is at rest, m; our choice. 0
    is as printed: P is pulled onto the source itself."""
    brake_time_s: Duration = 0.5
    """Time constant of the stop when there is no target, s; our choice."""


class SharedRepulsion(Parameters):
    """What every law reads beside its own gains."""

    velocity_term: VelocityTerm = "printed"
    """s = |dC/dt| as printed, or ``closing``: the speed of approach only."""


class ConventionalParameters(Parameters):
    """Spring and damper within a reach (Han 2019, eq. 19-a)."""

    stiffness_n_m: Stiffness = 12.3
    """K_0, N/m."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""
    reach_m: Length = 0.8
    """rho_0: the law acts below this distance, m (Han 2019, 5.2)."""


def matched_decay(limit: float, ratio: float) -> float:
    """Decay length or speed with which two laws are equal at half a limit.

    Args:
        limit: The limit, m or m/s.
        ratio: Of the two gains, above 1.

    Returns:
        limit / (2 ln ratio), as the limit.
    """
    return limit / (2.0 * math.log(ratio))


class ActiveParameters(Parameters):
    """Spring and damper that vary with distance and speed (Han 2019, eq. 20-22).

    alpha and beta make the law equal to a conventional one with ``matched``
    gains at half the reach and at half the speed limit.
    """

    reference_stiffness_n_m: Stiffness = 84.5
    """k_ref, N/m, above K_0."""
    matched_stiffness_n_m: Stiffness = 17.1
    """K_0, N/m: the push at rho_0/2 is K_0 rho_0/2."""
    reach_m: Length = 0.8
    """rho_0, m (Han 2019, 5.2); the law itself has no limit of reach."""
    reference_damping_n_s_m: Damping = 0.0811
    """d_ref, N s/m, below D_0."""
    matched_damping_n_s_m: Damping = 0.839
    """D_0, N s/m: the velocity term at mu_0/2 is D_0 mu_0/2."""
    speed_limit_m_s: Speed = 0.72
    """mu_0: the velocity term acts below this speed, m/s (5.3)."""

    @model_validator(mode="after")
    def _check(self) -> ActiveParameters:
        if self.reference_stiffness_n_m <= self.matched_stiffness_n_m:
            raise InputError(
                "reference_stiffness_n_m",
                f"{self.reference_stiffness_n_m} (k_ref) is "
                f"not above matched_stiffness_n_m {self.matched_stiffness_n_m} (K_0), "
                "and alpha = rho_0 / (2 ln(k_ref/K_0)) must be positive; raise it",
            )
        if self.reference_damping_n_s_m >= self.matched_damping_n_s_m:
            raise InputError(
                "reference_damping_n_s_m",
                f"{self.reference_damping_n_s_m} (d_ref) is "
                f"not below matched_damping_n_s_m {self.matched_damping_n_s_m} (D_0), "
                "and beta = mu_0 / (2 ln(D_0/d_ref)) must be positive; lower it",
            )
        return self

    @cached_property
    def alpha_m(self) -> float:
        """Decay length of the spring, m (Han 2019, eq. 21)."""
        ratio = self.reference_stiffness_n_m / self.matched_stiffness_n_m
        return matched_decay(self.reach_m, ratio)

    @cached_property
    def beta_m_s(self) -> float:
        """Growth speed of the damper, m/s (eq. 22, misprinted)."""
        ratio = self.matched_damping_n_s_m / self.reference_damping_n_s_m
        return matched_decay(self.speed_limit_m_s, ratio)


class Conventional2017Parameters(Parameters):
    """Push that grows with nearness without a bound (Kim 2017, eq. 20).

    Kim 2017 prints neither gain.
    """

    distance_gain_j: Positive = 0.917
    """K_0, J: the push is K_0/c. Not the K_0 of Han's laws."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""


class Active2017Parameters(Parameters):
    """Push that grows with nearness and saturates (Kim 2017, eq. 21, fig. 6).

    Kim 2017 prints neither gain.
    """

    distance_gain_j: Positive = 1.22
    """K_0, J: the push is K_0/c. Not the K_0 of Han's laws."""
    saturation_distance_m: Length = 0.1
    """rho_1: nearer than this the push stays at K_0/rho_1, m (Kim 2017, 5)."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""
    saturation_speed_m_s: Speed = 0.72
    """mu_1: faster than this the velocity term stays at D_0 mu_1, m/s. Kim 2017, 5
    chooses it by trial so that the robot stays below 720 mm/s, and prints no value; the
    default is that speed."""


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
