"""Our variant of the route law: a narrower and stiffer zone, and a safety filter."""

from __future__ import annotations

from systems.framework.parameters import Length, NonNegativeStiffness
from systems.laws.law import Equation
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
    trajectory_law,
)


class FilteredTrajectoryParameters(TrajectoryImpedanceParameters):
    """Springs and dampers of the law whose velocities pass through ``SafetyFilter``."""

    contact_stiffness_n_m: NonNegativeStiffness = 8.0
    """Stiffness K_e to robots and obstacles, N/m (our choice)."""
    security_zone_m: Length = 0.8
    """Distance S from the control point P at which contacts begin, m (our choice).
    Tables 1 and 2 of the paper have 1 m. For objects at rest, the
    clearance of the route near P limits the distance."""

    @property
    def damping_fades(self) -> bool:
        """Whether contact damping is 0 at the edge of the zone (our choice)."""
        return True

    @property
    def zone_narrows(self) -> bool:
        """Whether the zone is at most the clearance of the route (our choice)."""
        return True


TRAJECTORY_FILTERED = trajectory_law(
    "trajectory_filtered",
    "Filtered trajectory impedance",
    "trajectory, filtered",
    FilteredTrajectoryParameters,
    Equation(
        "Safety filter",
        r"v=\mathrm{argmin}\,|v-v^*|\quad\mathrm{with}\quad n_j\cdot v\geq b_j",
        "v = argmin |v - v*| with n_j . v >= b_j",
    ),
)
