"""A user's own law in the place of the papers' laws."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_types import define_for_scalars
from systems.laws.impedance import ImpedanceLoop
from systems.laws.no_avoidance import no_force
from systems.laws.repulsion import RepulsionParameters


@define_for_scalars("RadialLawController_", __name__)
def RadialLawController_(T):
    class Impl(LeafSystem_[T], ImpedanceLoop):
        """Follows the target; pushes off by any function of c and s.

        .. pydrake_system::

            name: RadialLawController
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

        Discrete state, every tick: the collision vectors of the last round of the
        sensors, for s. The outputs are functions of state and present input:
        no latency.

        Args:
            robot: Mass and place of P.
            attraction: ``AttractionParameters``.
            repulsion: ``RepulsionParameters``, handed to the law.
            sensors: ``UltrasonicParameters``: period and order of firing.
            tick_s: Period of the controller, s.
            law: ``law(c, s, repulsion)``: force away from the obstacle in N at
                distance c in m and speed s in m/s. Use pydrake.math, so that
                it can be differentiated.
            arguments: What the law takes after c and s in the place of repulsion.
        """

        def _construct(
            self,
            *,
            law=no_force,
            arguments=None,
            repulsion=None,
            converter=None,
            **options,
        ):
            super().__init__(converter=converter)
            repulsion = repulsion or RepulsionParameters()
            self._function = law
            self._arguments = (repulsion,) if arguments is None else arguments
            name = "radial_law_controller"
            self._declare_loop(T, name, repulsion=repulsion, **options)

        def _construct_copy(self, other, converter=None):
            law = {"law": other._function, "arguments": other._arguments}
            Impl._construct(self, converter=converter, **law, **other._options)

        def _law(self):
            return self._function, self._arguments

        def radial_force(self, c, s):
            return self._function(c, s, *self._arguments)

    return Impl


RadialLawController = RadialLawController_[None]
