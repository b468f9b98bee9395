"""Controllers of all laws that compute a force, and functions that compute forces.

A virtual mass M is at the control point P, which is ahead of the axle. The mass moves
according to::

    M p'' = F_m + sum of f(c, s) u,   u = -C/|C|,  c = |C|,  s = |dC/dt|

p is the position of P, and F_m is the attraction to the target. C is the collision
vector, which points from P to an obstacle. f is the push of the law. The sum has one
term per obstacle.

In eq. 17 and 18 of Han 2019, the signs of the repulsion contradict each other, and the
repulsion grows with the distance. Eq. 19 replaces both equations (docs/errata.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import turned_off_back
from systems.framework.block import Block_, Port, Step
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.laws.active import ACTIVE
from systems.laws.active_2017 import ACTIVE_2017
from systems.laws.conventional import CONVENTIONAL
from systems.laws.conventional_2017 import CONVENTIONAL_2017
from systems.laws.law import FORCE_COLUMNS, Law
from systems.laws.no_avoidance import NONE
from systems.laws.parameters import AttractionParameters, VelocityTerm
from systems.ranging.collision_vector import SLOTS
from systems.ranging.parameters import UltrasonicParameters
from systems.world.geometry import control_point, rotate, safe_norm

#: Number of state variables per tick: the feature, C_x, and C_y of each slot.
_ROW = 3 * SLOTS

#: If a target is straight behind P by more than this distance, m, the pull turns aside.
_BEHIND_M = 0.3
#: Time constant of the stop when there is no target, s (our choice).
BRAKE_TIME_S = 0.5


@register_jitable
def attraction_force(
    p_WP: Any, v_WP: Any, p_WS: Any, valid: Any, attraction: Any, mass: Any
) -> Any:
    """Computes the force that pulls the virtual mass toward the follow distance.

    The target is at p_S. The mass is at p and has the velocity v. The force is::

        K_r (p_S - p) (1 - d_f/|p_S - p|) - D_r v

    Without a target, the force only brakes the mass.

    Args:
        p_WP: Position (x, y) of the control point P in the world frame W, m; floats or
            AutoDiffXd.
        v_WP: Velocity (vx, vy) of the virtual mass in W, m/s.
        p_WS: Position (x, y) of the target in W, m.
        valid: Whether there is a target.
        attraction: ``AttractionParameters``: stiffness K_r, damping D_r, and follow
            distance d_f.
        mass: Virtual mass, kg.

    Returns:
        Force (Fx, Fy) in W, N.
    """
    if not valid:
        brake = mass / BRAKE_TIME_S
        return -brake * v_WP[0], -brake * v_WP[1]
    dx, dy = p_WS[0] - p_WP[0], p_WS[1] - p_WP[1]
    pull = attraction.stiffness_n_m
    if attraction.follow_distance_m > 0.0:
        pull = pull * (1.0 - attraction.follow_distance_m / safe_norm(dx, dy))
    damping = attraction.damping_n_s_m
    return pull * dx - damping * v_WP[0], pull * dy - damping * v_WP[1]


@register_jitable
def obstacle_speed(C_now: Any, C_before: Any, closing: Any, period_s: Any) -> Any:
    """Computes the speed s of an obstacle from two of its collision vectors.

    A collision vector C points from the control point P to the obstacle.

    Args:
        C_now: Present collision vector (x, y) in the world frame W, m; floats or
            AutoDiffXd.
        C_before: Collision vector (x, y) of the same obstacle ``period_s`` ago in W, m.
        closing: Definition of s: max(0, -d|C|/dt) if true, |dC/dt| if false.
        period_s: Time between both vectors, s.

    Returns:
        Speed s, m/s, at least 0, with the scalar type of ``C_now``.
    """
    if not closing:
        return safe_norm(C_now[0] - C_before[0], C_now[1] - C_before[1]) / period_s
    speed = (
        safe_norm(C_before[0], C_before[1]) - safe_norm(C_now[0], C_now[1])
    ) / period_s
    return speed if speed > 0.0 else 0.0 * speed


@register_jitable
def repulsion_force(C_W: Any, s: Any, force: Any, arguments: Any = ()) -> Any:
    """Computes the force that pushes the virtual mass away from one obstacle.

    Args:
        C_W: Collision vector (x, y) from the control point P to the obstacle in the
            world frame W, m; floats or AutoDiffXd.
        s: Speed of the obstacle, m/s.
        force: Function ``force(c, s, *arguments)`` that returns the push in N at the
            distance c in m.
        arguments: Arguments of ``force`` after c and s.

    Returns:
        Force (Fx, Fy) in W, N.
    """
    c = safe_norm(C_W[0], C_W[1])
    f = force(c, s, *arguments)
    return -f * C_W[0] / c, -f * C_W[1] / c


class ImpedanceNumbers(NamedTuple):
    """Constants of the step of ``ImpedanceController``."""

    force: Callable[..., Any]
    """Function ``force(c, s, *arguments)`` that returns the force in N."""
    arguments: tuple[Any, ...]
    """Gains of the law; for some laws also the least range of the sensors, m."""
    attraction: AttractionParameters
    mass_kg: float
    """Virtual mass, kg."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    closing: bool
    """Whether s counts only the speed of approach."""
    round_s: float
    """Time in which every sensor fires once, s."""


def impedance_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Computes the acceleration of the virtual mass, and the forces that cause it.

    The step also computes the speed s of each obstacle. The state stores the collision
    vectors of one sensor round, which is the time in which every sensor fires once. A
    collision vector C points from the control point P to an obstacle, in the world
    frame W, m. The state has one row per control period, most recent first. A row has
    three numbers for each slot of the input port: the feature, C_x, and C_y. The
    feature is a number that identifies the sensors or the body from which C comes.

    The step has three stages:

    1. Search the oldest row for the feature of each occupied slot. If it is there,
       compute s from the old and the present vector. Otherwise s is 0.
    2. Add the attraction and the pushes of all occupied slots, and divide the sum by
       the virtual mass.
    3. Shift the rows by one period, and write the present vectors to the first row.
    """
    p_WS, valid, C_B, features, pose, v_WP = inputs
    # Attraction, computed relative to P.
    acceleration, forces, speeds = outputs
    x, y = control_point(pose, numbers.control_point_m)
    dx, dy = turned_off_back(p_WS[0] - x, p_WS[1] - y, pose[2], _BEHIND_M)
    F_m = attraction_force(
        (0.0 * dx, 0.0 * dy),
        v_WP,
        (dx, dy),
        valid[0] > 0.5,
        numbers.attraction,
        numbers.mass_kg,
    )
    # Push of each slot.
    Fx = Fy = 0.0 * valid[0]
    oldest, seen = len(state) - _ROW, 0
    now = [0.0 * valid[0]] * _ROW
    for k in range(SLOTS):
        if features[k] > 0.5:
            C_W = rotate(pose[2], C_B[2 * k], C_B[2 * k + 1])
            s = 0.0 * C_W[0]
            for j in range(oldest, oldest + _ROW, 3):
                if _same_feature(state[j], features[k]):
                    before = state[j + 1], state[j + 2]
                    s = obstacle_speed(C_W, before, numbers.closing, numbers.round_s)
            fx, fy = repulsion_force(C_W, s, numbers.force, numbers.arguments)
            Fx, Fy = Fx + fx, Fy + fy
            speeds[seen] = s
            now[3 * seen] = features[k]
            now[3 * seen + 1], now[3 * seen + 2] = C_W[0], C_W[1]
            seen += 1
    # Sum of all forces.
    acceleration[0] = (F_m[0] + Fx) / numbers.mass_kg
    acceleration[1] = (F_m[1] + Fy) / numbers.mass_kg
    forces[0], forces[1], forces[2], forces[3] = F_m[0], F_m[1], Fx, Fy
    # Shift the rows, and write the new first row.
    for k in range(len(state) - 1, _ROW - 1, -1):
        state[k] = state[k - _ROW]
    for k in range(_ROW):
        state[k] = now[k]


@register_jitable
def _same_feature(before, now):
    """Returns whether two features are equal. Features count from 1; 0: empty slot."""
    return before > 0.5 and abs(float_of(before) - float_of(now)) < 0.5


_INPUTS = (
    Port("p_WS_estimated", 2, "m"),
    Port("target_valid", 1, "0 or 1"),
    Port("collision_vectors_B", 2 * SLOTS, "m, three slots of x and y"),
    Port("features", SLOTS, "number of what the vector stands on, 0 an empty slot"),
    Port("pose_WB_estimated", 3, "m, m, rad"),
    Port("v_WP", 2, "m/s, of the virtual mass"),
)
_OUTPUTS = (
    Port("acceleration_W", 2, "m/s^2"),
    Port("forces_W", 4, "N, attraction then repulsion, x and y each", FORCE_COLUMNS),
    Port("obstacle_speeds", SLOTS, "m/s, s of each slot", "obstacle_speed_{}"),
)
#: Table columns of the ports of a law. Blocks of users have the same columns.
LAW_COLUMNS: Mapping[str, tuple[str, ...]] = {
    port.name: port.column_names({}) for port in _OUTPUTS if port.columns
}


@define_for_scalars("ImpedanceController_", __name__)
def ImpedanceController_(T):
    class Impl(Block_[T]):
        """Pulls the robot to the target and pushes it away from obstacles.

        A collision vector points from the control point P to an obstacle. The push of
        the law depends on the length c of this vector and on a speed s. Each vector has
        a feature: a number that identifies the sensors or the body from which the
        vector comes.

        The block computes s from two vectors of the same feature: the present vector
        and the vector of one sensor round ago. If the feature was absent then, s is 0.
        A sensor round is the time in which every sensor fires once. If three sensors
        fire in turn, for example, a round lasts three control periods.

        In one round, every sensor measures its range anew. Therefore s is exact at
        constant velocities, even if a vector comes from two sensors. If the velocities
        change, s is the mean over one round. A range in the present vector can be up to
        one round minus one period old.

        The discrete state contains the collision vectors of the last sensor round. The
        outputs depend on the state and the present input. There is no latency.

        Args:
            law: A law of ``systems.laws.catalog`` that has a force, or a function
                ``law(c, s, ...)``. The function returns the force away from the
                obstacle in N for a distance c in m and a speed s in m/s. With
                pydrake.math, Drake can differentiate it.
            gains: Gains of the law. If None, a law of the catalog uses its default
                gains.
            arguments: Arguments of a function after c and s; None means ``(gains,)``.
            velocity_term: Definition of s: ``printed`` for the rate of change of the
                collision vector, ``closing`` for the speed of approach.
            robot: Virtual mass, and position of the control point P.
            attraction: ``AttractionParameters``.
            sensors: ``UltrasonicParameters``. The block uses the firing period, the
                firing order, and the least range.
            tick_s: Control period, s.
        """

        inputs, outputs = _INPUTS, _OUTPUTS

        def _construct(
            self,
            *,
            law: Law | Callable[..., Any] = NONE,
            gains: Any = None,
            arguments: tuple[Any, ...] | None = None,
            velocity_term: VelocityTerm = "printed",
            robot: RobotParameters = RobotParameters(),
            attraction: AttractionParameters = AttractionParameters(),
            sensors: UltrasonicParameters = UltrasonicParameters(),
            tick_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("impedance_controller")
            force: Any = law
            if arguments is None:
                arguments = (gains,)
            if isinstance(law, Law):
                assert law.force is not None, f"{law.name} has no force"
                force = law.force
                arguments = law.arguments(gains, sensors.minimum_range_m)
            round_ticks = sensors.round_ticks(tick_s)
            self.states = _slot_names(round_ticks)
            numbers = ImpedanceNumbers(
                force,
                arguments,
                attraction,
                robot.mass_kg,
                robot.control_point_m,
                velocity_term == "closing",
                round_ticks * tick_s,
            )
            step = Step(impedance_step, numbers, [0.0] * (_ROW * round_ticks))
            self.declare(step, tick_s=tick_s)

        def radial_force(self, c: Any, s: Any) -> Any:
            """Returns the force away from an obstacle, N, for c in m and s in m/s."""
            numbers = self.step.numbers
            return numbers.force(c, s, *numbers.arguments)

    return Impl


def _slot_names(round_ticks: int) -> tuple[str, ...]:
    """Returns the names of the state variables, most recent tick first."""
    return tuple(
        f"{name}_{slot}{after}"
        for after in ("", *(f"_{k}_ticks_ago" for k in range(2, round_ticks + 1)))
        for slot in range(1, SLOTS + 1)
        for name in ("feature", "C_x", "C_y")
    )


def _define(name: str, block_name: str, documentation: str, **fixed: Any) -> Any:
    """Defines a variant of ``ImpedanceController_`` that sets some arguments."""

    @define_for_scalars(f"{name}_", __name__)
    def template(T):
        class Impl(ImpedanceController_[T]):
            __qualname__ = f"{name}_.<locals>.Impl"
            __doc__ = documentation
            inputs, outputs = _INPUTS, _OUTPUTS

            def _construct(self, *, converter: Any = None, **options: Any) -> None:
                super()._construct(converter=converter, **fixed, **options)
                self.set_name(block_name)

        return Impl

    return template


def _define_for(law: Law, block_name: str) -> Any:
    """Defines the template of the controller of one law of the package."""
    equations = ", ".join(f"``{equation.text}``" for equation in law.equations)
    documentation = f"""Follows the target; pushes off obstacles by one law.

    {law.equations[0].title}: {equations}.

    The block is ``ImpedanceController`` with this law. It takes the same arguments,
    except ``law``. Its gains are ``{law.gains.__name__ if law.gains else None}``."""
    return _define(law.controller_name, block_name, documentation, law=law)


ActiveImpedanceController_ = _define_for(ACTIVE, "active_impedance_controller")
ActiveImpedance2017Controller_ = _define_for(
    ACTIVE_2017, "active_impedance_2017_controller"
)
ConventionalImpedanceController_ = _define_for(
    CONVENTIONAL, "conventional_impedance_controller"
)
ConventionalImpedance2017Controller_ = _define_for(
    CONVENTIONAL_2017, "conventional_impedance_2017_controller"
)
RadialLawController_ = _define(
    "RadialLawController",
    "radial_law_controller",
    """Follows the target; pushes off by any function of c and s.

    It is ``ImpedanceController``, with the block name of a user's own law.""",
)

ImpedanceController = ImpedanceController_[None]
ActiveImpedanceController = ActiveImpedanceController_[None]
ActiveImpedance2017Controller = ActiveImpedance2017Controller_[None]
ConventionalImpedanceController = ConventionalImpedanceController_[None]
ConventionalImpedance2017Controller = ConventionalImpedance2017Controller_[None]
RadialLawController = RadialLawController_[None]
