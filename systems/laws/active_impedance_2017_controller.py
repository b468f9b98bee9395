"""The active virtual-impedance law of 2017."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_types import define_for_scalars
from systems.laws.impedance import ImpedanceLoop
from systems.laws.repulsion import Active2017Parameters

__all__ = [
    "ActiveImpedance2017Controller",
    "ActiveImpedance2017Controller_",
    "active_2017_force",
]


def active_2017_force(c, s, gains: Active2017Parameters):
    """K_a(c)/c + D_a(s) s: inverse distance, both terms saturating.

    Kim 2017 gives eq. 21 and, in words, K_a and D_a (figure 6): the push must
    saturate below rho_1, the speed term above mu_1. Our reading: K_a is K_0
    from rho_1 on and K_0 c/rho_1 below; D_a is D_0 up to mu_1 and D_0 mu_1/s
    above. The text says that K *increases* down to rho_1: so does the push.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, rho_1, D_0, mu_1.

    Returns:
        Force away from the obstacle, N: K_0/max(c, rho_1) + D_0 min(s, mu_1).
        At contact, at rest, it is K_0/rho_1. There is no end to its reach: it
        halves when the distance doubles.
    """
    near, fast = gains.saturation_distance_m, gains.saturation_speed_m_s
    spring = gains.distance_gain_j / (c if c > near else near + 0.0 * c)
    return spring + gains.damping_n_s_m * (s if s < fast else fast + 0.0 * s)


@define_for_scalars("ActiveImpedance2017Controller_", __name__)
def ActiveImpedance2017Controller_(T):
    class Impl(LeafSystem_[T], ImpedanceLoop):
        """Follows the target; pushes off by inverse distance, up to a limit.

        .. pydrake_system::

            name: ActiveImpedance2017Controller
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
            repulsion: ``RepulsionParameters``; uses ``active2017``.
            sensors: ``UltrasonicParameters``: order of firing.

        Reference: Kim 2017, eq. 19 (F_m), 21 and figure 6 in words.
        """

        def _construct(self, *, converter=None, **options):
            super().__init__(converter=converter)
            self._declare_loop(T, "active_impedance_2017_controller", **options)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, converter=converter, **other._options)

        def _radial_force(self, c, s):
            return active_2017_force(c, s, self._repulsion.active2017)

    return Impl


ActiveImpedance2017Controller = ActiveImpedance2017Controller_[None]
