"""The differential-drive base: motors, wheels, motion."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable
from pydantic import Field, Strict
from pydrake.systems.framework import BasicVector_, LeafSystem_

from systems.parameters import Parameters, Positive
from systems.robot import RobotParameters
from systems.scalar_math import cos, sin
from systems.scalar_types import define_for_scalars

__all__ = [
    "DiffDrivePlant",
    "DiffDrivePlant_",
    "PlantNumbers",
    "PlantParameters",
    "body_twist",
    "plant_derivatives",
]

_Slip = Annotated[float, Field(gt=-1.0, lt=1.0)]


class PlantParameters(Parameters):
    """Motors and contact of the wheels."""

    motor_lag_s: Positive = 0.05
    """Time constant of each wheel's speed loop, s; not printed, ours."""
    slip: Annotated[tuple[_Slip, _Slip], Strict(False)] = (0.0, 0.0)
    """Part of the left and right rim speed that is lost, unseen by the encoders;
    negative: the wheel is larger than ``wheel_radius_m`` by this share."""


def body_twist(wheel_speeds, robot: RobotParameters, slip=(0.0, 0.0)):
    """Forward speed, m/s, and yaw rate, rad/s, from wheel speeds in rad/s."""
    left = robot.wheel_radius_m * (1.0 - slip[0]) * wheel_speeds[0]
    right = robot.wheel_radius_m * (1.0 - slip[1]) * wheel_speeds[1]
    return _rim_twist(left, right, robot.wheel_separation_m)


@register_jitable
def _rim_twist(left, right, separation):
    return (left + right) / 2.0, (right - left) / separation


class PlantNumbers(NamedTuple):
    """What the plant's motion hangs on, the last arguments of compiled code."""

    left_rim_m: float
    """Way of the left end of the axle for an angle of its wheel, m/rad."""
    right_rim_m: float
    """The same of the right end, m/rad."""
    wheel_separation_m: float
    """Distance between the wheels, m."""
    top_wheel_speed: float
    """Commands saturate here, rad/s."""
    motor_lag_s: float
    """Time constant of the wheels' speeds, s."""

    @classmethod
    def of(cls, robot: RobotParameters, plant: PlantParameters) -> PlantNumbers:
        """From the parameters."""
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
    state,
    commanded,
    left_rim_m,
    right_rim_m,
    wheel_separation_m,
    top_wheel_speed,
    motor_lag_s,
):
    """Time derivatives of the plant; ``.py_func`` takes AutoDiffXd.

    Args:
        state: (7,) x, y, theta, left and right wheel angle, left and right wheel
            speed; m, rad, rad/s.
        commanded: (2,) left and right wheel speed, rad/s.
        left_rim_m: See ``PlantNumbers``, also for the others.
        right_rim_m: m/rad.
        wheel_separation_m: m.
        top_wheel_speed: rad/s.
        motor_lag_s: s.

    Returns:
        (7,) derivatives in the order of the state.
    """
    theta, left, right = state[2], state[5], state[6]
    v, omega = _rim_twist(left_rim_m * left, right_rim_m * right, wheel_separation_m)
    rates = np.empty_like(state)
    rates[0], rates[1], rates[2] = v * np.cos(theta), v * np.sin(theta), omega
    rates[3], rates[4] = left, right
    rates[5] = (_saturate(commanded[0], top_wheel_speed) - left) / motor_lag_s
    rates[6] = (_saturate(commanded[1], top_wheel_speed) - right) / motor_lag_s
    return rates


@njit(cache=True)
def _checked_derivatives(state, commanded, *numbers):  # pragma: no cover  (compiled)
    """``plant_derivatives``, and whether all that they rest on is finite."""
    rates = plant_derivatives(state, commanded, *numbers)
    return rates, np.isfinite(state.sum() + commanded.sum())


def _not_finite(state, commanded) -> ValueError:
    return ValueError(
        f"DiffDrivePlant: state {state} or wheel_speeds {commanded} is not finite; "
        "look for the block upstream that made it so"
    )


@register_jitable
def _saturate(value, limit):
    if value > limit:
        return value * 0.0 + limit
    if value < -limit:
        return value * 0.0 - limit
    return value


@define_for_scalars("DiffDrivePlant_", __name__)
def DiffDrivePlant_(T):
    class Impl(LeafSystem_[T]):
        """Moves the robot: motor lag, saturation, rolling wheels.

        .. pydrake_system::

            name: DiffDrivePlant
            input_ports:
            - wheel_speeds [rad/s, left and right, commanded]
            output_ports:
            - pose_WB [m, m, rad]
            - velocity_WB [m/s, m/s, rad/s]
            - wheel_angles [rad, left and right]

        Continuous state: x, y, theta, two wheel angles, two wheel speeds.
        The outputs are functions of the state; no feedthrough. The heading
        is not wrapped.

        Args:
            robot: Dimensions and top speed.
            plant: ``PlantParameters``.
            initial_pose: (x, y, theta) at time zero, at rest.

        Raises:
            ValueError: A state or command is not finite, which an
                error-controlled integrator would meet with endless steps.

        Reference: Han 2019, table 6; the motor lag is ours.
        """

        def _construct(
            self,
            *,
            robot=None,
            plant=None,
            initial_pose=(0.0, 0.0, 0.0),
            converter=None,
        ):
            super().__init__(converter=converter)
            self._robot = robot or RobotParameters()
            self._plant = plant or PlantParameters()
            self._numbers = PlantNumbers.of(self._robot, self._plant)
            self._initial_pose = tuple(initial_pose)
            self.set_name("diff_drive_plant")
            self._wheel_speeds = self.DeclareVectorInputPort(
                name="wheel_speeds", size=2
            )
            initial_state = [T(value) for value in (*self._initial_pose, 0, 0, 0, 0)]
            self.DeclareContinuousState(BasicVector_[T](initial_state))
            ticket = {self.xc_ticket()}
            for name, size, calc in (
                ("pose_WB", 3, self._pose),
                ("velocity_WB", 3, self._velocity),
                ("wheel_angles", 2, self._angles),
            ):
                self.DeclareVectorOutputPort(
                    name=name, size=size, calc=calc, prerequisites_of_calc=ticket
                )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self,
                robot=other._robot,
                plant=other._plant,
                initial_pose=other._initial_pose,
                converter=converter,
            )

        def DoCalcTimeDerivatives(self, context, derivatives):
            motion = self._state(context), self._wheel_speeds.Eval(context)
            if T is float:
                rates, finite = _checked_derivatives(*motion, *self._numbers)
                if not finite:
                    raise _not_finite(*motion)
            else:
                rates = plant_derivatives.py_func(*motion, *self._numbers)
            derivatives.SetFromVector(rates)

        def _state(self, context):
            return context.get_continuous_state_vector().CopyToVector()

        def _pose(self, context, output):
            output.SetFromVector(self._state(context)[:3])

        def _velocity(self, context, output):
            state = self._state(context).tolist()
            v, omega = body_twist(state[5:], self._robot, self._plant.slip)
            theta = state[2]
            output.SetFromVector([v * cos(theta), v * sin(theta), omega])

        def _angles(self, context, output):
            output.SetFromVector(self._state(context)[3:5])

    return Impl


DiffDrivePlant = DiffDrivePlant_[None]
