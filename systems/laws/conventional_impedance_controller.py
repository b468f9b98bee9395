"""The conventional virtual-impedance law."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_types import define_for_scalars
from systems.laws.impedance import ImpedanceLoop
from systems.laws.repulsion import ConventionalParameters

__all__ = [
    "ConventionalImpedanceController",
    "ConventionalImpedanceController_",
    "conventional_force",
]


def conventional_force(c, s, gains: ConventionalParameters):
    """K_0 (rho_0 - c) + D_0 s below rho_0, else 0 (Han 2019, eq. 19-a).

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, D_0, rho_0.

    Returns:
        Force away from the obstacle, N. It steps by D_0 s at rho_0.
    """
    if c < gains.reach_m:
        return gains.stiffness_n_m * (gains.reach_m - c) + gains.damping_n_s_m * s
    return 0.0 * c


@define_for_scalars("ConventionalImpedanceController_", __name__)
def ConventionalImpedanceController_(T):
    class Impl(LeafSystem_[T], ImpedanceLoop):
        """Follows the target; pushes off linearly within rho_0.

        .. pydrake_system::

            name: ConventionalImpedanceController
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
            repulsion: ``RepulsionParameters``; uses ``conventional``.
            sensors: ``UltrasonicParameters``: order of firing.

        Reference: Han 2019, eq. 18 (F_m) and 19-a.
        """

        def _construct(self, *, converter=None, **options):
            super().__init__(converter=converter)
            self._declare_loop(T, "conventional_impedance_controller", **options)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, converter=converter, **other._options)

        def _radial_force(self, c, s):
            return conventional_force(c, s, self._repulsion.conventional)

    return Impl


ConventionalImpedanceController = ConventionalImpedanceController_[None]
