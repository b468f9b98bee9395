"""What the impedance laws share: attraction, obstacle speed, sum of forces.

    M p'' = F_m + sum of f(c, s) u,   u = -C/|C|,  c = |C|,  s = |dC/dt|

Han 2019, eq. 17-18 print the repulsion with the wrong sign and with forces
that grow with distance; eq. 19 replaces them. See docs/errata.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import turned_off_back
from systems.framework.block_facts import BlockFacts
from systems.framework.scalar_math import float_of
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step, StepBlock
from systems.laws.parameters import AttractionParameters, SharedRepulsion, VelocityTerm
from systems.ranging.collision_vector import SLOTS
from systems.ranging.parameters import UltrasonicParameters
from systems.world.geometry import control_point, rotate, safe_norm

#: Numbers that are remembered a tick: feature, C_x and C_y of each slot.
_ROW = 3 * SLOTS

#: A target that is farther than this straight behind P pulls a little aside, m.
_BEHIND_M = 0.3


@register_jitable
def attraction_force(
    p_WP: Any, v_WP: Any, p_WS: Any, valid: Any, attraction: Any, mass: Any
) -> Any:
    """Force on the virtual mass towards the follow point, N.

    Args:
        p_WP: Control point, m; floats or AutoDiffXd.
        v_WP: Velocity of the virtual mass, m/s.
        p_WS: Target, m.
        valid: Whether there is a target; without one the mass is braked.
        attraction: ``AttractionParameters``.
        mass: kg.

    Returns:
        (Fx, Fy) in W: K_r (p_S - p) (1 - d_f/|p_S - p|) - D_r v.
    """
    if not valid:
        brake = mass / attraction.brake_time_s
        return -brake * v_WP[0], -brake * v_WP[1]
    dx, dy = p_WS[0] - p_WP[0], p_WS[1] - p_WP[1]
    pull = attraction.stiffness_n_m
    if attraction.follow_distance_m > 0.0:
        pull = pull * (1.0 - attraction.follow_distance_m / safe_norm(dx, dy))
    damping = attraction.damping_n_s_m
    return pull * dx - damping * v_WP[0], pull * dy - damping * v_WP[1]


def obstacle_speed(
    C_now: Any, C_before: Any, velocity_term: VelocityTerm, period: Any
) -> Any:
    """s in m/s: how fast the collision vector changes.

    Args:
        C_now: (x, y) in W, m; floats or AutoDiffXd.
        C_before: The same feature a period ago, or None: 0 then.
        velocity_term: ``printed`` |dC/dt|, or ``closing`` max(0, -d|C|/dt).
        period: s.

    Returns:
        s, m/s, not negative; its type is that of ``C_now``.
    """
    if C_before is None:
        return 0.0 * C_now[0]
    return _changing(C_now, C_before, velocity_term == "closing", period)


@register_jitable
def _changing(C_now, C_before, closing, period):
    if not closing:
        return safe_norm(C_now[0] - C_before[0], C_now[1] - C_before[1]) / period
    speed = (
        safe_norm(C_before[0], C_before[1]) - safe_norm(C_now[0], C_now[1])
    ) / period
    return speed if speed > 0.0 else 0.0 * speed


@register_jitable
def _push(C_W, s, law, arguments):
    """Force on the virtual mass off one obstacle, N in W."""
    c = safe_norm(C_W[0], C_W[1])
    f = law(c, s, *arguments)
    return -f * C_W[0] / c, -f * C_W[1] / c


def repulsion_force(
    vectors: Any, before: Any, law: Any, velocity_term: VelocityTerm, period: Any
) -> Any:
    """Sum of the forces away from the obstacles.

    Args:
        vectors: [(feature, C_x, C_y)] in W, m; floats or AutoDiffXd.
        before: {feature: (C_x, C_y)} a period ago.
        law: ``law(c, s)``, N.
        velocity_term: See ``obstacle_speed``.
        period: s.

    Returns:
        (Fx, Fy) in W, N, and the list of s, m/s.
    """
    Fx = Fy = 0.0
    speeds = []
    for feature, *C_W in vectors:
        s = obstacle_speed(C_W, before.get(_key(feature)), velocity_term, period)
        fx, fy = _push(C_W, s, law, ())
        Fx, Fy = Fx + fx, Fy + fy
        speeds.append(s)
    return (Fx, Fy), speeds


class ImpedanceNumbers(NamedTuple):
    """What the step of an impedance controller depends on."""

    law: Callable[..., Any]
    """``law(c, s, *arguments)``, N."""
    arguments: tuple[Any, ...]
    """Gains."""
    attraction: AttractionParameters
    mass_kg: float
    """Of the virtual mass, kg."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    closing: bool
    """Whether s is the speed of approach alone."""
    round_s: float
    """Time of a round of the sensors, s."""


def impedance_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """The forces of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: Rows of ``SLOTS`` times feature, C_x and C_y in W, m: those of the last
            tick first, as many as a round has ticks.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``ImpedanceNumbers``.
    """
    p_WS, valid, C_B, features, pose, v_WP = inputs
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
                    s = _changing(C_W, before, numbers.closing, numbers.round_s)
            fx, fy = _push(C_W, s, numbers.law, numbers.arguments)
            Fx, Fy = Fx + fx, Fy + fy
            speeds[seen] = s
            now[3 * seen] = features[k]
            now[3 * seen + 1], now[3 * seen + 2] = C_W[0], C_W[1]
            seen += 1
    acceleration[0] = (F_m[0] + Fx) / numbers.mass_kg
    acceleration[1] = (F_m[1] + Fy) / numbers.mass_kg
    forces[0], forces[1], forces[2], forces[3] = F_m[0], F_m[1], Fx, Fy
    for k in range(len(state) - 1, _ROW - 1, -1):
        state[k] = state[k - _ROW]
    for k in range(_ROW):
        state[k] = now[k]


@register_jitable
def _same_feature(before, now):
    """Features are whole numbers from 1 on, whatever their scalar type."""
    return before > 0.5 and abs(float_of(before) - float_of(now)) < 0.5


class ImpedanceLoop(StepBlock):
    """Ports, state and sum of forces of every impedance controller.

    A mix-in beside ``LeafSystem_[T]``: the controller's file adds its law as
    ``radial_force(c, s)`` in N. Each collision vector's s is the change of the
    same feature over one round of the sensors, over the time of that round; 0
    where the feature was not there a round ago. A round is a tick where all sensors
    fire at every tick, and three where three fire one after the other: every sensor has
    then fired once since, and a held range is held in both vectors. At constant
    velocities s is exact, at every tick, of a pair of sensors as of one; else
    it is the mean over the round, which is up to a round less a tick old itself.
    """

    FACTS = BlockFacts(
        "controller",
        "control",
        columns={
            "forces_W": (
                *("attraction_x", "attraction_y"),
                *("repulsion_x", "repulsion_y"),
            ),
            "obstacle_speeds": tuple(f"obstacle_speed_{k + 1}" for k in range(SLOTS)),
        },
    )

    def _declare_loop(
        self,
        scalar,
        name,
        *,
        robot=None,
        attraction=None,
        repulsion=None,
        sensors=None,
        tick_s=TICK_S,
    ):
        self._robot = robot or RobotParameters()
        self._attraction = attraction or AttractionParameters()
        self._repulsion = repulsion
        self._velocity_term = (repulsion or SharedRepulsion()).velocity_term
        sensors = sensors or UltrasonicParameters()
        round_ticks = sensors.round_ticks(tick_s)
        self._least_range_m = sensors.minimum_range_m
        self.FACTS = replace(self.FACTS, states=_slot_names(round_ticks))
        # What a copy for another scalar type is made with.
        self._options = {
            "robot": self._robot,
            "attraction": self._attraction,
            "repulsion": repulsion,
            "sensors": sensors,
            "tick_s": tick_s,
        }
        self.set_name(name)
        self.declare_step(
            scalar,
            Step(
                impedance_step,
                ImpedanceNumbers(
                    *self._law(),
                    self._attraction,
                    self._robot.mass_kg,
                    self._robot.control_point_m,
                    self._velocity_term == "closing",
                    round_ticks * tick_s,
                ),
                [0.0] * (_ROW * round_ticks),
            ),
            _INPUTS,
            _OUTPUTS,
            tick_s,
        )

    def _law(self):
        """The law and its arguments after c and s."""
        return self.radial_force, ()


_INPUTS = (
    ("p_WS_estimated", 2),
    ("target_valid", 1),
    ("collision_vectors_B", 2 * SLOTS),
    ("features", SLOTS),
    ("pose_WB_estimated", 3),
    ("v_WP", 2),
)
_OUTPUTS = ("acceleration_W", 2), ("forces_W", 4), ("obstacle_speeds", SLOTS)


def _slot_names(round_ticks: int) -> tuple[str, ...]:
    """Names of what is remembered, the last tick first."""
    return tuple(
        f"{name}_{slot}{after}"
        for after in ("", *(f"_{k}_ticks_ago" for k in range(2, round_ticks + 1)))
        for slot in range(1, SLOTS + 1)
        for name in ("feature", "C_x", "C_y")
    )


def _key(feature) -> int:
    """Number of a feature, whatever its scalar type."""
    return round(float_of(feature))
