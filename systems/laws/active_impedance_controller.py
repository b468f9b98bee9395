"""The active virtual-impedance law of 2019."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_math import exp
from systems.framework.scalar_types import define_for_scalars
from systems.laws.impedance import ImpedanceLoop
from systems.laws.repulsion import ActiveParameters

__all__ = [
    "ActiveImpedanceController",
    "ActiveImpedanceController_",
    "active_force",
]


def active_force(c, s, gains: ActiveParameters):
    """k_ref exp(-c/alpha) c + d_ref exp(s/beta) (mu_0 - s) (Han 2019, eq. 20).

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s; from mu_0 on the second term is 0 (table 4).
        gains: k_ref, d_ref, mu_0, and K_0, D_0, rho_0 through alpha, beta.

    Returns:
        Force away from the obstacle, N. The first term is bounded, largest at
        c = alpha, and zero at contact; the second is d_ref mu_0 at rest, at
        any distance. Eq. 19-b multiplies K_0(c) by (rho_0 - c) once more; eq.
        20 and table 4 are the consistent reading.
    """
    spring = gains.reference_stiffness_n_m * exp(-c / gains.alpha_m) * c
    if s >= gains.speed_limit_m_s:
        return spring
    damper = gains.reference_damping_n_s_m * exp(s / gains.beta_m_s)
    return spring + damper * (gains.speed_limit_m_s - s)


@define_for_scalars("ActiveImpedanceController_", __name__)
def ActiveImpedanceController_(T):
    class Impl(LeafSystem_[T], ImpedanceLoop):
        """Follows the target; pushes off by distance and speed at any distance.

        .. pydrake_system::

            name: ActiveImpedanceController
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
            repulsion: ``RepulsionParameters``; uses ``active``.
            sensors: ``UltrasonicParameters``: order of firing.

        Reference: Han 2019, eq. 18 (F_m), 20-22 and table 4.
        """

        def _construct(self, *, converter=None, **options):
            super().__init__(converter=converter)
            self._declare_loop(T, "active_impedance_controller", **options)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, converter=converter, **other._options)

        def _radial_force(self, c, s):
            return active_force(c, s, self._repulsion.active)

    return Impl


ActiveImpedanceController = ActiveImpedanceController_[None]
