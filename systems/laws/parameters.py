"""Attraction, and what all laws read besides their own gains."""

from __future__ import annotations

from typing import Literal

from systems.framework.parameters import (
    Duration,
    NonNegativeDamping,
    NonNegativeLength,
    NonNegativeStiffness,
    Parameters,
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


class MapParameters(Parameters):
    """Of baselines that look at a map of echoes."""

    clearance_m: NonNegativeLength = 0.05
    """Distance kept from places of echoes, m."""
    source_clearance_m: NonNegativeLength = 0.5
    """Echoes within this distance of the target count as echoes of the target, m."""
