"""The controller of a robot on a route: impedance to the target and to near objects."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import (
    clamped_velocity,
    integrate_velocity,
    turned_off_back,
)
from systems.framework.block import Block_, Port, Step
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.laws.law import FORCE_COLUMNS
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.laws.trajectory.trajectory_impedance import (
    ContactNumbers,
    contact_force,
    contact_numbers,
    contacts_of_objects,
    step_is_blocked,
    target_force,
)
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import control_point

#: Largest acceleration of the virtual mass, m/s^2 (our choice).
ACCELERATION_LIMIT_M_S2 = 2.5
#: If a target moves straight back faster than this speed, m/s, the law turns the
#: velocity of the target aside.
_BACK_M_S = 0.05


class TrajectoryNumbers(NamedTuple):
    """Constants of the step of ``TrajectoryImpedanceController``."""

    impedance: tuple[float, float, float]
    """Gains without adaptation: K in N/m, D in N s/m, and K_e in N/m."""
    contact_damping: float
    """Contact damping D_e, N s/m."""
    contacts: ContactNumbers
    mass: float
    """Virtual mass M, kg."""
    control_point_m: float
    block_m: float
    """Distance L_block, m; 0: eq. 6 is off."""
    top_speed: float
    """Top speed of P, m/s."""
    tick_s: float


def trajectory_numbers(
    own: TrajectoryImpedanceParameters, robot: RobotParameters, tick_s: float
) -> TrajectoryNumbers:
    """Computes the constants of the step from the parameters.

    ``own`` has the parameters of the law. ``robot`` has the virtual mass, the top
    speed, and the position of the control point P. ``tick_s`` is the control period, s.
    """
    return TrajectoryNumbers(
        (own.stiffness_n_m, own.damping_n_s_m, own.contact_stiffness_n_m),
        own.contact_damping_n_s_m,
        contact_numbers(own),
        robot.mass_kg,
        robot.control_point_m,
        own.block_distance_m or 0.0,
        robot.top_speed_m_s,
        tick_s,
    )


@register_jitable
def _command(
    inputs: Any,
    impedance: Any,
    contacts: ContactNumbers,
    outputs: Any,
    numbers: TrajectoryNumbers,
) -> None:
    target, objects, pose, v_WP = inputs[0], inputs[1], inputs[2], inputs[3]
    p_WP = control_point(pose, numbers.control_point_m)
    vx, vy = turned_off_back(target[2], target[3], pose[2], _BACK_M_S)
    moving = target[0], target[1], vx, vy
    ux, uy = target_force(p_WP, v_WP, moving, impedance[0], impedance[1])
    found = contacts_of_objects(objects, v_WP, contacts)
    fx, fy = contact_force(found, impedance[2], numbers.contact_damping)
    ax, ay = (ux + fx) / numbers.mass, (uy + fy) / numbers.mass
    ax, ay = clamped_velocity(ax, ay, ACCELERATION_LIMIT_M_S2)
    if numbers.block_m > 0.0:
        T = numbers.tick_s
        vx, vy = integrate_velocity(v_WP, (ax, ay), T, numbers.top_speed)
        if step_is_blocked(objects, (T * vx, T * vy), numbers.block_m):
            # The wheel command integrates this acceleration to a velocity of zero. The
            # acceleration may exceed its limit, because P has to stop at once. The lag
            # of the motors still smooths the motion.
            ax, ay = -v_WP[0] / T, -v_WP[1] / T
    outputs[0][0], outputs[0][1] = ax, ay
    outputs[1][0], outputs[1][1] = ux, uy
    outputs[1][2], outputs[1][3] = fx, fy


@register_jitable
def trajectory_impedance_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: TrajectoryNumbers
) -> None:
    """Computes acceleration and forces with K, D, and K_e of the parameters."""
    _command(inputs, numbers.impedance, numbers.contacts, outputs, numbers)


@register_jitable
def narrowed_impedance_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: TrajectoryNumbers
) -> None:
    """Computes acceleration and forces with the zone limited by ``route_clearance``."""
    begins_m, rest_m, fades, _ = numbers.contacts
    contacts = ContactNumbers(begins_m, rest_m, fades, inputs[4][0])
    _command(inputs, numbers.impedance, contacts, outputs, numbers)


@register_jitable
def adapted_impedance_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: TrajectoryNumbers
) -> None:
    """Computes acceleration and forces with K, D, and K_e of the port ``impedance``."""
    _command(inputs, inputs[4], numbers.contacts, outputs, numbers)


@define_for_scalars("TrajectoryImpedanceController_", __name__)
def TrajectoryImpedanceController_(T):
    class Impl(Block_[T]):
        """Pulls P to a moving target and pushes it away from robots and obstacles.

        P is the control point of the robot. The law is::

            M p'' = -K (p - p_d) - D (v - v_d) + V

        p and v are the position and velocity of P. p_d and v_d are those of the target.
        M is the virtual mass. K and D are the stiffness and damping toward the target.
        V is the force of all contacts.

        A contact is an object j whose distance d from P is below S, the width of the
        security zone. The force V is the sum over all contacts of::

            K_e (S - d) n - D_e (v - v_j)

        K_e and D_e are the stiffness and damping of contacts. n is the unit vector from
        object j to P, and v_j is the velocity of the object.

        If ``block_distance_m`` is set, the block also obeys eq. 6: a step must not end
        within this distance of an object, except if it leads away from the object.
        Before such a step, the acceleration is -v/T, which stops the virtual mass
        within one control period T.

        If ``adapts`` is true, the block reads K, D, and K_e from the input port
        ``impedance`` instead of the parameters. The outputs depend only on the present
        input. There is no state and no latency.

        If ``narrows`` is true, S is at most the value of the input port
        ``route_clearance`` for objects at rest: the distance of the route near P from
        the obstacles that the planner knows. These obstacles do not push a robot on its
        route.

        At most eight objects count. The sampled loop is unstable if the sum of D_e over
        all contacts exceeds 2M/T (80 N s/m for 1 kg). Therefore another block first
        reduces the points of a scan to a few objects.

        Args:
            parameters: ``TrajectoryImpedanceParameters``.
            robot: Virtual mass, top speed, and position of P.
            adapts: Whether there is an input port ``impedance``.
            narrows: Whether there is an input port ``route_clearance``, without
                ``adapts``.
            tick_s: Control period, s.

        Reference: Engelbrecht, Steyn and Djouani (2021), eq. 1 to 6, with the signs
        that the text of the paper requires. docs/errata.md lists the differences.
        """

        inputs = (
            Port("target_state", 4, "m, m, m/s, m/s"),
            Port(
                "objects_W",
                OBJECT_SLOTS * OBJECT_SIZE,
                "number, m and m/s in eight slots, see systems.ranging.objects",
            ),
            Port("pose_WB_estimated", 3, "m, m, rad"),
            Port("v_WP", 2, "m/s, of the virtual mass"),
        )
        outputs = (
            Port("acceleration_W", 2, "m/s^2"),
            Port(
                "forces_W",
                4,
                "N, of the target then of contacts, x and y each",
                FORCE_COLUMNS,
            ),
        )

        def _construct(
            self,
            *,
            parameters: TrajectoryImpedanceParameters = TrajectoryImpedanceParameters(),
            robot: RobotParameters = RobotParameters(),
            adapts: bool = False,
            narrows: bool = False,
            tick_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("trajectory_impedance_controller")
            numbers = trajectory_numbers(parameters, robot, tick_s)
            step = trajectory_impedance_step
            if adapts:
                step = adapted_impedance_step
                impedance = Port("impedance", 3, "number, K, D and K_e")
                self.inputs = (*self.inputs, impedance)
            elif narrows:
                step = narrowed_impedance_step
                self.inputs = (*self.inputs, Port("route_clearance", 1, "m"))
            self.declare(Step(step, numbers), tick_s=tick_s)

    return Impl


TrajectoryImpedanceController = TrajectoryImpedanceController_[None]
