"""A block between any law and the wheels that keeps the robot in free space."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.lagged_motion import lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters, body_radius
from systems.base.wheel_speed_command import (
    COMMANDS,
    hand_position_twist,
    hand_position_velocity,
    limited_wheel_speeds,
)
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import read_lists
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.safety.braking import (
    HALTED,
    PASSED,
    BrakingNumbers,
    chosen,
    danger_of,
    rolled_speeds,
)
from systems.safety.free_space import FreeSpace, make_free_space
from systems.safety.parameters import FreeSpaceParameters, GuardParameters
from systems.safety.views import stopping_way, tick_parts

# Groups of the discrete state.
_V_WP, _WHEEL_SPEEDS, _REPORT, _MODEL = range(4)
_SIZES = 2, 2, 4, 2


class GuardNumbers(NamedTuple):
    """What the step of ``MotionGuard`` depends on."""

    velocity: Callable[..., Any]
    """As of ``CommandNumbers``."""
    robot: RobotParameters
    braking: BrakingNumbers
    kept: float
    """Share of a change of wheel speed that the lag leaves after a tick."""
    reach: tuple[float, float]
    """How far from the axle cells are looked at, m, and for what rolled way they have
    to stay free, m."""
    space: FreeSpace


def guard_step(tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any) -> None:
    """Wheel speeds of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: Velocity of P, m/s, x and y; wheel speeds, rad/s, left and right; what
            was done; modelled wheel speeds, rad/s.
        inputs: What the law commands, the pose by the odometry, and what is wrong with
            the sensing.
        outputs: Left as they are: they are state.
        numbers: ``GuardNumbers``.
    """
    command, pose = inputs[0], inputs[1]
    robot, braking, space = numbers.robot, numbers.braking, numbers.space
    theta, tick_s = pose[2], braking.tick_s
    before = state[0], state[1]
    v_WP = numbers.velocity(before, command, theta, robot, tick_s)
    v, omega = hand_position_twist(v_WP, theta, robot.control_point_m)
    trusted = inputs[2][0] < 0.5
    wish = limited_wheel_speeds(v, omega, robot) if trusted else (0.0, 0.0)
    here = pose[0], pose[1], pose[2]
    speeds = state[8], state[9]
    danger = danger_of(space, tick * tick_s, here, numbers.reach, braking)
    done, wheels = chosen(here, speeds, wish, (state[2], state[3]), danger, braking)
    if not trusted:
        done = HALTED
    if done != PASSED:
        radius, separation = robot.wheel_radius_m, robot.wheel_separation_m
        v = 0.5 * radius * (wheels[0] + wheels[1])
        omega = radius * (wheels[1] - wheels[0]) / separation
        v_WP = hand_position_velocity((v, omega), theta, robot.control_point_m)
    after = rolled_speeds(speeds, wheels, numbers.kept)
    fastest = max(abs(wheels[0]), abs(wheels[1])) * robot.wheel_radius_m
    state[0], state[1], state[2], state[3] = v_WP[0], v_WP[1], wheels[0], wheels[1]
    # Nothing near is as far as was looked.
    seen = min(danger.distance_m, numbers.reach[0])
    viewed = min(danger.view_distance_m, numbers.reach[0])
    state[4], state[5] = done, seen - braking.keep_m
    state[6] = fastest * fastest / (2.0 * braking.braking_m_s2)
    state[6] += fastest * (braking.motor_lag_s + tick_s)
    state[7] = viewed - braking.keep_m
    state[8], state[9] = after[0], after[1]


def _publish_guard(state, outputs, numbers):  # type: ignore[no-untyped-def]
    """The outputs of ``guard_step``'s state."""
    wheel_speeds, v_WP, report = outputs
    for k in range(2):
        v_WP[k], wheel_speeds[k] = state[k], state[2 + k]
    for k in range(4):
        report[k] = state[4 + k]


class MotionGuard(LeafSystem):
    """Obeys a law as far as the robot can be braked to rest in free space.

    .. pydrake_system::

        name: MotionGuard
        input_ports:
        - acceleration_W [m/s^2]
        - pose_WB_estimated [m, m, rad]
        - sensing_fault [number of what is wrong, and of the sensor, from 1]
        - free_space [FreeSpace]
        output_ports:
        - wheel_speeds [rad/s, left and right]
        - v_WP [m/s, of the virtual mass]
        - guard_report [number of what was done, m, m, m]

    It stands in the place of ``WheelSpeedCommand``, ``VelocityWheelCommand`` or
    ``TwistWheelCommand``, whose input it has, and does their work. Then it passes what
    comes of it if the robot, after a tick of it, can brake to rest so that the disc
    about the axle that holds the body stays ``margin_m`` off what was never seen free;
    else less of it along the same curve, or the turn alone, or it brakes. What it
    changed, the virtual mass moves by.

    With ``obstacle_speed_m_s`` the same holds of what is in the sensors' view now and
    may come nearer at that speed, unless the robot withdraws from it.

    While something is wrong with the sensing, it brakes to rest, whatever the law
    commands.

    ``guard_report``: what was done, 0 passed, 1 slowed, 2 turned, 3 braked, 4 halted
    for a fault of the sensing; by how much the disc is farther from what is not free
    than it has to be; the way in which the robot can stop; and the first of these for
    what is in view.

    Discrete state, every tick: velocity of P, wheel speeds, report, and the wheel
    speeds that follow by the motors' lag, a group each. Rate and latency are those of
    ``WheelSpeedCommand``.

    Args:
        parameters: ``GuardParameters``.
        known: Grid of the map, and how far off a cell's place may be.
        robot: Dimensions and top speed.
        plant: Lag of the motors.
        command: Name of the law's port: ``acceleration_W``, ``velocity_W`` or
            ``twist_B``.
        tick_s: Period of the command, s.

    Reference: ours; docs/guard.md has theorem and proof. Passive safety is that of
    Bouraine, Fraichard and Salhi (2012), passive orientation safety that of Mitsch,
    Ghorbal, Vogelbacher and Platzer (2017).
    """

    FACTS = BlockFacts(
        "command",
        "control",
        columns={
            "wheel_speeds": ("wheel_speed_left", "wheel_speed_right"),
            "v_WP": ("v_WP_x", "v_WP_y"),
            "guard_report": (
                "guard_action",
                "guard_distance",
                "guard_stopping_distance",
                "guard_view_distance",
            ),
        },
    )

    def __init__(
        self,
        *,
        parameters: GuardParameters | None = None,
        known: FreeSpaceParameters | None = None,
        robot: RobotParameters | None = None,
        plant: PlantParameters | None = None,
        command: str = "acceleration_W",
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self._tick_s = tick_s
        self.set_name("motion_guard")
        self.step = Step(
            guard_step,
            _numbers(
                parameters or GuardParameters(),
                known or FreeSpaceParameters(),
                robot or RobotParameters(),
                plant or PlantParameters(),
                COMMANDS[command],
                tick_s,
            ),
            [0.0] * sum(_SIZES),
            _publish_guard,
        )
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in (
                (command, 2),
                ("pose_WB_estimated", 3),
                ("sensing_fault", 2),
            )
        ]
        self._free_space = self.DeclareAbstractInputPort(
            name="free_space", model_value=Value(object())
        )
        groups = [self.DeclareDiscreteState(size) for size in _SIZES]
        self.DeclareStateOutputPort("wheel_speeds", groups[_WHEEL_SPEEDS])
        self.DeclareStateOutputPort("v_WP", groups[_V_WP])
        self.DeclareStateOutputPort("guard_report", groups[_REPORT])
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._update
        )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        space = run.carried["free_space"](0)
        return self.step._replace(numbers=self.step.numbers._replace(space=space))

    def _update(self, context: Any, discrete_state: Any) -> None:
        inputs, state = read_lists(context, self._inputs), []
        space: Any = self._free_space.Eval(context)
        for group in range(len(_SIZES)):
            state += context.get_discrete_state(group).CopyToVector().tolist()
        tick = round(context.get_time() / self._tick_s)
        numbers = self.step.numbers._replace(space=space)
        guard_step(tick, state, inputs, (), numbers)
        begin = 0
        for group, size in enumerate(_SIZES):
            values = np.array(state[begin : begin + size])
            discrete_state.set_value(group, values)
            begin += size


def _numbers(
    own: GuardParameters,
    known: FreeSpaceParameters,
    robot: RobotParameters,
    plant: PlantParameters,
    velocity: Callable[..., Any],
    tick_s: float,
) -> GuardNumbers:
    radius = body_radius(robot) + known.place_error_m
    keep = radius + own.margin_m
    parts = tick_parts(tick_s)
    braking = BrakingNumbers(
        robot.wheel_radius_m,
        robot.wheel_separation_m,
        plant.motor_lag_s,
        own.braking_m_s2,
        tick_s,
        parts,
        lagged_motion(tick_s / parts, plant.motor_lag_s),
        robot.top_wheel_speed,
        keep,
        radius + own.least_margin_m,
        own.obstacle_speed_m_s,
        own.slow_turn_rad_s,
    )
    stopping = stopping_way(own, robot, plant, tick_s)
    reach = keep + stopping + 2.0 * known.cell_m, stopping
    blank = make_free_space(1, known.cell_m, 1, 2)
    kept = math.exp(-tick_s / plant.motor_lag_s)
    return GuardNumbers(velocity, robot, braking, kept, reach, blank)
