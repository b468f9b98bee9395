"""The conventional virtual-impedance law of 2017."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_types import define_for_scalars
from systems.laws.impedance import ImpedanceLoop
from systems.laws.repulsion import Conventional2017Parameters

__all__ = [
    "ConventionalImpedance2017Controller",
    "ConventionalImpedance2017Controller_",
    "conventional_2017_force",
]


def conventional_2017_force(c, s, gains: Conventional2017Parameters, least_range_m):
    """K_0/c + D_0 s, at any distance (Kim 2017, eq. 20).

    Printed, the push has no bound as c falls to 0. What bounds it is the least
    range of the sensors: nearer than that they tell no difference.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, D_0.
        least_range_m: Least range of the sensors, m, above 0.

    Returns:
        Force away from the obstacle, N: at most K_0/least_range_m at rest. There
        is no end to its reach: it halves when the distance doubles.
    """
    nearest = c if c > least_range_m else least_range_m + 0.0 * c
    return gains.distance_gain_j / nearest + gains.damping_n_s_m * s


@define_for_scalars("ConventionalImpedance2017Controller_", __name__)
def ConventionalImpedance2017Controller_(T):
    class Impl(LeafSystem_[T], ImpedanceLoop):
        """Follows the target; pushes off by inverse distance.

        .. pydrake_system::

            name: ConventionalImpedance2017Controller
            input_ports:
            - p_WS_estimated [m]
            - target_valid [0 or 1]
            - collision_vectors_B [m, three slots of x and y]
            - features [number of what the vector stands on, 0 an empty slot]
            - pose_WB_estimated [m, m, rad]
            - v_WP [m/s, of the virtual mass]
            output_ports:
            - acceleration_W [m/s^2]
            - forces_W [N, attraction then repulsion, x and y each]
            - obstacle_speeds [m/s, s of each slot]

        Discrete state, 25 ms: the collision vectors of the last round of the
        sensors, for s. The outputs are functions of state and present input:
        no latency.

        Args:
            robot: Mass and place of P.
            attraction: ``AttractionParameters``.
            repulsion: ``RepulsionParameters``; uses ``conventional2017``.
            sensors: ``UltrasonicParameters``: order of firing, least range.

        Reference: Kim 2017, eq. 19 (F_m) and 20.
        """

        def _construct(self, *, converter=None, **options):
            super().__init__(converter=converter)
            self._declare_loop(T, "conventional_impedance_2017_controller", **options)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, converter=converter, **other._options)

        def _radial_force(self, c, s):
            gains, least = self._repulsion.conventional2017, self._least_range_m
            return conventional_2017_force(c, s, gains, least)

    return Impl


ConventionalImpedance2017Controller = ConventionalImpedance2017Controller_[None]
