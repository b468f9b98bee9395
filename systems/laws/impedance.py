"""What the impedance laws share: attraction, obstacle speed, sum of forces.

    M p'' = F_m + sum of f(c, s) u,   u = -C/|C|,  c = |C|,  s = |dC/dt|

Han 2019, eq. 17-18 print the repulsion with the wrong sign and with forces
that grow with distance; eq. 19 replaces them. See docs/errata.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import read_lists
from systems.framework.parameters import (
    Duration,
    NonNegativeDamping,
    NonNegativeLength,
    NonNegativeStiffness,
    Parameters,
)
from systems.framework.scalar_math import float_of
from systems.framework.signals import TICK_S
from systems.ranging.collision_vector import SLOTS
from systems.ranging.ultrasonic_array import UltrasonicParameters
from systems.world.geometry import control_point, rotate, safe_norm

__all__ = [
    "AttractionParameters",
    "ImpedanceLoop",
    "SharedRepulsion",
    "VelocityTerm",
    "attraction_force",
    "obstacle_speed",
    "repulsion_force",
]

VelocityTerm = Literal["printed", "closing"]

#: Numbers that are remembered a tick: feature, C_x and C_y of each slot.
_ROW = 3 * SLOTS


class AttractionParameters(Parameters):
    """The spring and damper to the target (Han 2019, eq. 18 and section 5)."""

    stiffness_n_m: NonNegativeStiffness = 2.0
    """K_r, N/m; printed without unit."""
    damping_n_s_m: NonNegativeDamping = 1.0
    """D_r, N s/m; printed without unit. Damping ratio 0.18 with K_r = 2."""
    follow_distance_m: NonNegativeLength = 1.2
    """Distance d_f from the source at which the attraction rests, m; ours.
    0 is as printed: P is pulled onto the source itself."""
    brake_time_s: Duration = 0.5
    """Time constant of the stop when there is no target, s; ours."""


class SharedRepulsion(Parameters):
    """What every law reads beside its own gains."""

    velocity_term: VelocityTerm = "printed"
    """s = |dC/dt| as printed, or ``closing``: the speed of approach alone."""


def attraction_force(p_WP, v_WP, p_WS, valid, attraction, mass):
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


def obstacle_speed(C_now, C_before, velocity_term: VelocityTerm, period):
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
    if velocity_term == "printed":
        return safe_norm(C_now[0] - C_before[0], C_now[1] - C_before[1]) / period
    closing = (safe_norm(*C_before) - safe_norm(*C_now)) / period
    return closing if closing > 0.0 else 0.0 * closing


def repulsion_force(vectors, before, law, velocity_term: VelocityTerm, period):
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
        c = safe_norm(*C_W)
        f = law(c, s)
        Fx, Fy = Fx - f * C_W[0] / c, Fy - f * C_W[1] / c
        speeds.append(s)
    return (Fx, Fy), speeds


class ImpedanceLoop:
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
        self._scalar = scalar
        self._robot = robot or RobotParameters()
        self._attraction = attraction or AttractionParameters()
        self._repulsion = repulsion
        self._velocity_term = (repulsion or SharedRepulsion()).velocity_term
        sensors = sensors or UltrasonicParameters()
        self._round_ticks = sensors.round_ticks(tick_s)
        self._round_s = self._round_ticks * tick_s
        self._least_range_m = sensors.minimum_range_m
        self.FACTS = replace(self.FACTS, states=_slot_names(self._round_ticks))
        # What a copy for another scalar type is made with.
        self._options = {
            "robot": self._robot,
            "attraction": self._attraction,
            "repulsion": repulsion,
            "sensors": sensors,
            "tick_s": tick_s,
        }
        self.set_name(name)
        self._inputs = [
            self.DeclareVectorInputPort(name=port_name, size=size)
            for port_name, size in (
                ("p_WS_estimated", 2),
                ("target_valid", 1),
                ("collision_vectors_B", 2 * SLOTS),
                ("features", SLOTS),
                ("pose_WB_estimated", 3),
                ("v_WP", 2),
            )
        ]
        self.DeclareDiscreteState([scalar(0.0)] * (_ROW * self._round_ticks))
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._remember
        )
        sources = {port.ticket() for port in self._inputs}
        sources.add(self.xd_ticket())
        self._forces = declare_cache(self, "forces", self._sum_forces, sources)
        for port_name, size, calc in (
            ("acceleration_W", 2, self._acceleration),
            ("forces_W", 4, self._forces_W),
            ("obstacle_speeds", SLOTS, self._speeds),
        ):
            self.DeclareVectorOutputPort(
                name=port_name,
                size=size,
                calc=calc,
                prerequisites_of_calc={self._forces.ticket()},
            )

    def _sum_forces(self, context):
        """(F_m, F_b, s of each slot, [(feature, C_x, C_y)] in W)."""
        values = read_lists(context, self._inputs)
        target, valid, vectors, features, pose, v_WP = values
        F_m = attraction_force(
            control_point(pose, self._robot.control_point_m),
            v_WP,
            target,
            valid[0] > 0.5,
            self._attraction,
            self._robot.mass_kg,
        )
        zero = self._scalar(0.0)
        vectors_W = [
            (features[k], *rotate(pose[2], vectors[2 * k], vectors[2 * k + 1]))
            for k in range(SLOTS)
            if features[k] > 0.5
        ]
        if not vectors_W:
            return F_m, [zero] * 2, [zero] * SLOTS, vectors_W
        F_b, speeds = repulsion_force(
            vectors_W,
            self._before(context),
            self.radial_force,
            self._velocity_term,
            self._round_s,
        )
        speeds = [zero + s for s in speeds] + [zero] * (SLOTS - len(speeds))
        return F_m, F_b, speeds, vectors_W

    def _before(self, context):
        """{feature: C_W} of a round ago."""
        state = context.get_discrete_state(0).CopyToVector().tolist()
        oldest = state[-_ROW:]
        return {
            _key(oldest[k]): (oldest[k + 1], oldest[k + 2])
            for k in range(0, _ROW, 3)
            if oldest[k] > 0.5
        }

    def _remember(self, context, discrete_state):
        *_, vectors_W = self._forces.Eval(context)
        rows = [value for row in vectors_W for value in row]
        rows += [self._scalar(0.0)] * (_ROW - len(rows))
        if self._round_ticks > 1:
            rows += context.get_discrete_state(0).CopyToVector().tolist()[:-_ROW]
        discrete_state.set_value(np.array(rows))

    def _acceleration(self, context, output):
        F_m, F_b, *_ = self._forces.Eval(context)
        mass = self._robot.mass_kg
        output.SetFromVector([(F_m[0] + F_b[0]) / mass, (F_m[1] + F_b[1]) / mass])

    def _forces_W(self, context, output):
        F_m, F_b, *_ = self._forces.Eval(context)
        output.SetFromVector([*F_m, *F_b])

    def _speeds(self, context, output):
        output.SetFromVector(self._forces.Eval(context)[2])


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
