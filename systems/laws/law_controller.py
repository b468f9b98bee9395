"""The block of a law that is a radial force: one shell for them all."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import LeafSystem_

from systems.framework.scalar_types import define_for_scalars
from systems.laws.impedance import ImpedanceLoop
from systems.laws.law import Law

_DOCUMENTATION = """Follows the target; {about}.

.. pydrake_system::

    name: {name}
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

Discrete state, every tick: the collision vectors of the last round of the sensors,
for s. The outputs are functions of state and present input: no latency.

Args:
    robot: Mass and place of P.
    attraction: ``AttractionParameters``.
    repulsion: ``RepulsionParameters``; uses ``{law}``.
    sensors: ``UltrasonicParameters``: period and order of firing{more}.
    tick_s: Period of the controller, s.

Reference: {reference}.
"""


def define_law_controller(
    name: str, module: str, law: Law, *, about: str, reference: str
) -> Any:
    """The template of a law's block, for floats and for derivatives.

    Args:
        name: Of the block's class; the template's ends in an underscore.
        module: ``__name__`` of the law's module, after which the block is named.
        law: Its record, with a force.
        about: What it does to obstacles, for the docstring.
        reference: Where that comes from.

    Returns:
        The template; ``template[float]`` is the block's class.
    """

    @define_for_scalars(f"{name}_", module)
    def template(T):
        class Impl(LeafSystem_[T], ImpedanceLoop):
            __doc__ = _DOCUMENTATION.format(
                name=name,
                law=law.name,
                about=about,
                more=", least range" if law.least_range else "",
                reference=reference,
            )

            def _construct(self, *, converter=None, **options):
                super().__init__(converter=converter)
                self._declare_loop(T, module.rpartition(".")[2], **options)

            def _construct_copy(self, other, converter=None):
                Impl._construct(self, converter=converter, **other._options)

            def _law(self):
                return law.force, law.arguments(self._repulsion, self._least_range_m)

            def radial_force(self, c, s):
                numbers = self.step.numbers
                return numbers.law(c, s, *numbers.arguments)

        return Impl

    return template
