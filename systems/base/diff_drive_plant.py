"""The differential-drive base: motors, wheels, and motion with or without slip."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from pydrake.systems.framework import BasicVector_

from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.tire_grip import GripNumbers, grip_accelerations
from systems.framework.block import Block_, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.finite import check_finite, check_port
from systems.framework.scalar_math import cos, sin
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S


@register_jitable
def body_twist(
    wheel_speeds: Any, robot: RobotParameters, slip: Any = (0.0, 0.0)
) -> Any:
    """Computes the motion of the body from the speeds of its two wheels.

    Args:
        wheel_speeds: Left and right wheel speed, rad/s; floats or AutoDiffXd.
        robot: Radius and separation of the wheels.
        slip: Shares of the left and of the right rim speed that the wheels lose by
            slip, below 1.

    Returns:
        Forward speed, m/s, and yaw rate, rad/s, positive counterclockwise.
    """
    left = robot.wheel_radius_m * (1.0 - slip[0]) * wheel_speeds[0]
    right = robot.wheel_radius_m * (1.0 - slip[1]) * wheel_speeds[1]
    return _rim_twist(left, right, robot.wheel_separation_m)


@register_jitable
def _rim_twist(left, right, separation):
    return (left + right) / 2.0, (right - left) / separation


class PlantNumbers(NamedTuple):
    """Constants of the plant, which compiled functions take as their last arguments."""

    left_rim_m: float
    """Path of the left end of the axle per angle of its wheel, m/rad."""
    right_rim_m: float
    """Path of the right end of the axle per angle of its wheel, m/rad."""
    wheel_separation_m: float
    """Distance between the wheels, m."""
    top_wheel_speed: float
    """Wheel speed at which commands saturate, rad/s."""
    motor_lag_s: float
    """Time constant of the wheel speeds, s."""

    @classmethod
    def of(cls, robot: RobotParameters, plant: PlantParameters) -> PlantNumbers:
        """Computes the constants. Slip reduces ``left_rim_m`` and ``right_rim_m``."""
        left, right = plant.slip
        return cls(
            robot.wheel_radius_m * (1.0 - left),
            robot.wheel_radius_m * (1.0 - right),
            robot.wheel_separation_m,
            robot.top_wheel_speed,
            plant.motor_lag_s,
        )


@njit(cache=True)
def plant_derivatives(
    state: Any,
    commanded: Any,
    left_rim_m: Any,
    right_rim_m: Any,
    wheel_separation_m: Any,
    top_wheel_speed: Any,
    motor_lag_s: Any,
) -> Any:
    """Computes the time derivatives of the state of a robot whose wheels roll.

    ``state`` has seven elements: x and y, m; heading theta, rad; left and right wheel
    angle, rad; left and right wheel speed, rad/s. The result has the derivatives in the
    same order. ``commanded`` has the commanded left and right wheel speeds, rad/s. The
    other arguments are the fields of ``PlantNumbers``.

    The compiled function takes floats. The attribute ``plant_derivatives.py_func`` is
    the same function in Python. It takes floats or AutoDiffXd.
    """
    theta, left, right = state[2], state[5], state[6]
    v, omega = _rim_twist(left_rim_m * left, right_rim_m * right, wheel_separation_m)
    rates = np.empty_like(state)
    rates[0], rates[1], rates[2] = v * np.cos(theta), v * np.sin(theta), omega
    _set_wheel_rates(rates, state, commanded, top_wheel_speed, motor_lag_s)
    return rates


@njit(cache=True)
def slipping_derivatives(
    state: Any,
    commanded: Any,
    left_rim_m: Any,
    right_rim_m: Any,
    wheel_separation_m: Any,
    top_wheel_speed: Any,
    motor_lag_s: Any,
    grip: Any,
) -> Any:
    """Computes the time derivatives of the state of a robot whose tires may slip.

    ``state`` has ten elements: the seven of ``plant_derivatives``; forward and leftward
    speed of the body, m/s; and yaw rate, rad/s. The result has the derivatives in the
    same order. ``commanded`` has the commanded left and right wheel speeds, rad/s.
    ``grip`` limits the tire forces, see ``GripNumbers``. The other arguments are the
    fields of ``PlantNumbers``.
    """
    theta, forward, sideways = state[2], state[7], state[8]
    rates = np.empty_like(state)
    rates[0] = forward * np.cos(theta) - sideways * np.sin(theta)
    rates[1] = forward * np.sin(theta) + sideways * np.cos(theta)
    rates[2] = state[9]
    _set_wheel_rates(rates, state, commanded, top_wheel_speed, motor_lag_s)
    rates[7], rates[8], rates[9] = grip_accelerations(
        (forward, sideways, state[9]),
        (left_rim_m * state[5], right_rim_m * state[6]),
        (left_rim_m * rates[5], right_rim_m * rates[6]),
        wheel_separation_m,
        grip,
    )
    return rates


@register_jitable
def _set_wheel_rates(rates, state, commanded, top_wheel_speed, motor_lag_s):
    left, right = state[5], state[6]
    rates[3], rates[4] = left, right
    rates[5] = (saturated(commanded[0], top_wheel_speed) - left) / motor_lag_s
    rates[6] = (saturated(commanded[1], top_wheel_speed) - right) / motor_lag_s


@njit(cache=True)
def _checked_derivatives(state, commanded, *numbers):  # pragma: no cover  (compiled)
    """Returns ``plant_derivatives``, and whether state and command are finite."""
    rates = plant_derivatives(state, commanded, *numbers)
    return rates, np.isfinite(state.sum() + commanded.sum())


@njit(cache=True)
def _checked_slipping(state, commanded, *numbers):  # pragma: no cover  (compiled)
    """Returns ``slipping_derivatives``, and whether state and command are finite."""
    rates = slipping_derivatives(state, commanded, *numbers)
    return rates, np.isfinite(state.sum() + commanded.sum())


@register_jitable
def saturated(value: Any, limit: Any) -> Any:
    """Limits the magnitude of a value.

    Args:
        value: Float or AutoDiffXd, in any unit.
        limit: Largest magnitude, in the same unit, not negative.

    Returns:
        The value, if its magnitude is at most the limit. Otherwise the limit with the
        sign of the value; its derivatives are zero.
    """
    if value > limit:
        return value * 0.0 + limit
    if value < -limit:
        return value * 0.0 - limit
    return value


@register_jitable
def _velocities(state, numbers):
    """Returns two tuples: the velocity of the body, and slip velocities of the tires.

    The first tuple is the velocity (vx, vy, omega) in the world frame W, m/s and rad/s.
    The second tuple has three velocities relative to the ground, m/s: the forward speed
    of the left rim, that of the right rim, and the leftward speed of the axle.
    """
    left, right = numbers.left_rim_m * state[5], numbers.right_rim_m * state[6]
    v, omega = _rim_twist(left, right, numbers.wheel_separation_m)
    sideways = 0.0 * v
    if len(state) > 7:
        v, sideways, omega = state[7], state[8], state[9]
    c, s = cos(state[2]), sin(state[2])
    turn = omega * numbers.wheel_separation_m / 2.0
    velocity = v * c - sideways * s, v * s + sideways * c, omega
    radius = numbers.wheel_radius_m
    slip = radius * state[5] - (v - turn), radius * state[6] - (v + turn), sideways
    return velocity, slip


#: Table columns of the port ``slip_velocities`` with friction.
_SLIP_COLUMNS = "slip_left", "slip_right", "slip_sideways"

#: Largest factor by which Drake's integrators stretch the last step of an interval.
_STRETCH = 1.01


class PlantStepNumbers(NamedTuple):
    """Constants of the step of ``DiffDrivePlant``."""

    derivatives: Any
    """Function ``derivatives(state, commanded, *of_plant)``."""
    of_plant: tuple[Any, ...]
    """The constants ``PlantNumbers``. With friction, ``GripNumbers`` follows."""
    step_s: float
    """Largest step of the integrator, s."""
    tick_s: float
    left_rim_m: float
    right_rim_m: float
    wheel_radius_m: float
    wheel_separation_m: float


def plant_step(tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any) -> None:
    """Advances the robot by one control period with Runge-Kutta steps of fifth order.

    The state is that of ``plant_derivatives`` without friction, and that of
    ``slipping_derivatives`` with friction.
    """
    (commanded,) = inputs
    derivatives, of_plant = numbers.derivatives, numbers.of_plant
    time, end = tick * numbers.tick_s, (tick + 1) * numbers.tick_s
    # Compute times, steps, and sums in Drake's order, so that rounding is the same.
    while time < end:
        h = end - time
        if h > _STRETCH * numbers.step_s:
            h = (time + numbers.step_s) - time
        advance(state, h, commanded, derivatives, of_plant)
        time += h


#: Weights of the earlier slopes in the stages of Dormand and Prince (1980). The last
#: row has the weights of the result.
_STAGES = (
    (1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0),
    (3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0),
    (44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)


@register_jitable
def advance(
    state: Any, h: Any, commanded: Any, derivatives: Any, of_plant: Any
) -> None:
    """Advances the state by one step of the Dormand-Prince method, as Drake does.

    Args:
        state: (n,) state, which the function overwrites with the new state.
        h: Length of the step, s.
        commanded: (2,) commanded left and right wheel speed, rad/s.
        derivatives: Function ``derivatives(state, commanded, *of_plant)``.
        of_plant: Last arguments of ``derivatives``: the fields of ``PlantNumbers`` and,
            with friction, ``GripNumbers``.
    """
    size = len(state)
    slopes, reached = np.empty((6, size)), np.copy(state)
    for stage in range(6):
        slope = derivatives(reached, commanded, *of_plant)
        for k in range(size):
            slopes[stage, k] = slope[k]
            change = 0.0
            for earlier in range(stage + 1):
                change += slopes[earlier, k] * (_STAGES[stage][earlier] * h)
            reached[k] = state[k] + change
    for k in range(size):
        state[k] = reached[k]


def _publish_plant(state, outputs, numbers):
    """Computes the outputs from the state of ``plant_step``."""
    pose, velocity, angles, slip = outputs
    found = _velocities(state, numbers)
    for k in range(3):
        pose[k], velocity[k], slip[k] = state[k], found[0][k], found[1][k]
    angles[0], angles[1] = state[3], state[4]


@define_for_scalars("DiffDrivePlant_", __name__)
def DiffDrivePlant_(T):
    class Impl(Block_[T]):
        """Simulates a differential-drive robot whose wheels roll or slip.

        The model includes the lag of the motors and the saturation of the wheel speeds.
        The continuous state has x, y, theta, two wheel angles, and two wheel speeds. If
        ``plant.friction`` is set, the state also has the forward speed, the leftward
        speed, and the yaw rate of the body. Without friction, the wheel speeds
        determine these three values. The outputs are functions of the state, without
        feedthrough. The heading is not wrapped to one turn.

        Args:
            robot: Dimensions and top speed.
            plant: Motor lag, slip, and friction.
            initial_pose: (x, y, theta) in the world frame W at time zero, m and rad.
                The robot starts at rest.

        Raises:
            ValueError: The initial pose, a state, or a command is not finite. An
                error-controlled integrator would never finish with such a value.

        Reference: Han 2019, table 6. The motor lag and the friction model are our
        additions.
        """

        part, stage = "plant", "robot"
        inputs = (Port("wheel_speeds", 2, "rad/s, left and right, commanded"),)
        outputs = (
            Port("pose_WB", 3, "m, m, rad", ("p_WB_x", "p_WB_y", "theta_WB")),
            Port("velocity_WB", 3, "m/s, m/s, rad/s", ("v_WB_x", "v_WB_y", "omega_WB")),
            Port("wheel_angles", 2, "rad, left and right"),
            Port(
                "slip_velocities",
                3,
                "m/s, slip of left rim, right rim, and sideways",
            ),
        )
        states = (
            *("x", "y", "theta"),
            *("angle_left", "angle_right", "speed_left", "speed_right"),
        )

        def _construct(
            self,
            *,
            robot: RobotParameters = RobotParameters(),
            plant: PlantParameters = PlantParameters(),
            initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            check_finite("DiffDrivePlant: initial_pose", initial_pose)
            self.set_name("diff_drive_plant")
            of_plant: Any = PlantNumbers.of(robot, plant)
            derivatives, self._checked = plant_derivatives, _checked_derivatives
            if plant.friction is not None:
                of_plant += (GripNumbers.of(robot, plant.friction),)
                derivatives, self._checked = slipping_derivatives, _checked_slipping
                self.states = (*self.states, "forward", "leftward", "yaw_rate")
                slip = self.outputs[-1]._replace(columns=_SLIP_COLUMNS)
                self.outputs = (*self.outputs[:-1], slip)
            self._numbers = PlantStepNumbers(
                derivatives,
                tuple(of_plant),
                TICK_S,
                TICK_S,
                of_plant[0],
                of_plant[1],
                robot.wheel_radius_m,
                robot.wheel_separation_m,
            )
            at_rest = [0.0] * (len(self.states) - 3)
            state = [T(value) for value in (*initial_pose, *at_rest)]
            self.DeclareContinuousState(BasicVector_[T](state))
            (self._wheel_speeds,) = self.declare_ports()
            for name, calc in (
                ("pose_WB", self._pose),
                ("velocity_WB", self._velocity),
                ("wheel_angles", self._angles),
                ("slip_velocities", self._slip),
            ):
                self.declare_output(name, calc, {self.xc_ticket()})

        def DoCalcTimeDerivatives(self, context, derivatives):
            motion = self._state(context), self._wheel_speeds.Eval(context)
            of_plant, finite = self._numbers.of_plant, False
            if T is float:
                rates, finite = self._checked(*motion, *of_plant)
            else:
                rates = self._numbers.derivatives.py_func(*motion, *of_plant)
            if not finite:
                check_port(context, self._wheel_speeds, motion[1])
                check_finite("DiffDrivePlant: state", motion[0])
            derivatives.SetFromVector(rates)

        def step_for(self, run: RunFacts) -> Step:
            """Returns the step with the initial pose and the step length of the run."""
            numbers = self._numbers._replace(step_s=run.step_s, tick_s=run.tick_s)
            at_rest = [0.0] * (len(self.states) - 3)
            state = [*run.initial_pose, *at_rest]
            return Step(plant_step, numbers, state, _publish_plant)

        def _state(self, context):
            return context.get_continuous_state_vector().CopyToVector()

        def _pose(self, context, output):
            output.SetFromVector(self._state(context)[:3])

        def _velocity(self, context, output):
            state = self._state(context).tolist()
            output.SetFromVector(_velocities(state, self._numbers)[0])

        def _angles(self, context, output):
            output.SetFromVector(self._state(context)[3:5])

        def _slip(self, context, output):
            state = self._state(context).tolist()
            output.SetFromVector(_velocities(state, self._numbers)[1])

    return Impl


DiffDrivePlant = DiffDrivePlant_[None]
