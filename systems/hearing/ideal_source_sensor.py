"""Simulates ideal hearing, which replaces loudspeaker, microphones and estimator."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from pydrake.math import atan2

from systems.base.robot import RobotParameters
from systems.framework.block import Block_, Port, RunFacts, Step
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.sound.parameters import SoundParameters
from systems.world.geometry import control_point, rotate, safe_norm


@register_jitable
def relative_position(pose_WB: Any, pose_WS: Any, control_point_m: Any) -> Any:
    """Computes the position of the source relative to the control point P of the robot.

    Args:
        pose_WB: x, y, theta of the body frame B in the world frame W, m and rad; floats
            or AutoDiffXd.
        pose_WS: x, y, theta of the source in W, m and rad. The angle theta has no
            effect.
        control_point_m: Distance of P ahead of the origin of B, m.

    Returns:
        (x, y) of the source relative to P, in the axes of B, m.
    """
    x_P, y_P = control_point(pose_WB, control_point_m)
    return rotate(-pose_WB[2], pose_WS[0] - x_P, pose_WS[1] - y_P)


class _PerFrame:
    """Table with one row per measurement. Each row is computed when it is read.

    Args:
        row: Function that returns a row, given the number of the measurement.
    """

    def __init__(self, row: Callable[[int], Any]) -> None:
        self._row = row

    def __getitem__(self, frame: int) -> Any:
        """Returns the row of a measurement."""
        return self._row(frame)


class IdealSourceNumbers(NamedTuple):
    """Data of the step of ``IdealSourceSensor``."""

    control_point_m: float
    """Distance of P ahead of the axle, m."""
    frame_ticks: int
    """Ticks between two measurements."""
    sounds: Any
    """One Boolean value per measurement, true if there is sound: ``_PerFrame`` or (n,)
    array."""


def ideal_source_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Measures the position of the source in one control period.

    The state has three numbers: x and y of the source relative to the control point P,
    m; and whether anything is heard, 0 or 1.
    """
    if tick % numbers.frame_ticks != 0:
        return
    frame = tick // numbers.frame_ticks
    pose_WB, pose_WS = inputs
    x, y = relative_position(pose_WB, pose_WS, numbers.control_point_m)
    # Sums, because AutoDiffXd elements accept no float.
    nothing = 0.0 * state[2]
    state[0], state[1], state[2] = nothing, nothing, nothing
    if numbers.sounds[frame]:
        state[0], state[1], state[2] = x, y, nothing + 1.0


def _publish_ideal_source(state, outputs, numbers):
    """Computes the outputs from the state of ``ideal_source_step``."""
    bearing, distance, p_PS_B, covariance, detected, range_valid, status = outputs
    x, y = state[0], state[1]
    bearing[0], distance[0] = atan2(y, x), safe_norm(x, y)
    p_PS_B[0], p_PS_B[1] = x, y
    for k in range(4):
        covariance[k] = 0.0 * state[2]
    # Every sound has a range: NOTHING_HEARD is 0, and RANGED is 1.
    detected[0] = range_valid[0] = status[0] = state[2]


@define_for_scalars("IdealSourceSensor_", __name__)
def IdealSourceSensor_(T):
    class Impl(Block_[T]):
        """Measures exactly where the source is.

        The block replaces ``SoundEmitter``, ``MicArray`` and ``TDOAEstimator``. It has
        the outputs of ``TDOAEstimator``. Its discrete state has the position of the
        source relative to the control point P, and ``detected``. The block updates the
        state every audio frame. Its latency is one control period, like that of the
        estimator, so that the control loop is the same with either block. The block
        detects the source at any distance. Unlike the estimator with a row of
        microphones, the block distinguishes front from back.

        Args:
            robot: Distance of P ahead of the axle.
            sound: Schedule of the sound, which defines when there is sound.
            always: Whether the sensor hears in every measurement, even if there is no
                sound.
            frame_s: Period of the measurements, s.
        """

        part, stage = "hearing", "hearing"
        inputs = (Port("pose_WB", 3, "m, m, rad"), Port("pose_WS", 3, "m, m, rad"))
        outputs = (
            Port("source_bearing", 1, "rad"),
            Port("source_range", 1, "m"),
            Port("p_PS_B", 2, "m", ("p_PS_B_x", "p_PS_B_y")),
            Port("covariance", 4, "m^2, of p_PS_B, row by row"),
            Port("detected", 1, "0 or 1", "detected"),
            Port("range_valid", 1, "0 or 1", "range_valid"),
            Port("range_status", 1, "number, 0 nothing heard", "range_status"),
        )
        states = ("p_PS_B_x", "p_PS_B_y", "detected")

        def _construct(
            self,
            *,
            robot: RobotParameters = RobotParameters(),
            sound: SoundParameters = SoundParameters(),
            always: bool = False,
            frame_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("ideal_source_sensor")
            self._sound, self._always, self._frame_s = sound, always, frame_s
            numbers = IdealSourceNumbers(
                robot.control_point_m, 1, _PerFrame(self._sounds)
            )
            state = [0.0] * len(self.states)
            step = Step(ideal_source_step, numbers, state, _publish_ideal_source)
            self.declare(step, tick_s=frame_s)

        def _sounds(self, frame: Any) -> Any:
            """Returns whether there is sound in the middle of a measurement's frame.

            The frame ends at the time of the measurement. ``frame`` is the number of
            the measurement, or an array of numbers.
            """
            sounds = self._sound.sounds((frame - 0.5) * self._frame_s)
            return sounds | self._always

        def step_for(self, run: RunFacts) -> Step:
            """Returns the step with tables for all measurements of the run."""
            step, frame_s = self.step, self._frame_s
            frames = np.arange(math.ceil((run.ticks + 1) * run.tick_s / frame_s) + 1)
            numbers = step.numbers._replace(
                frame_ticks=round(frame_s / run.tick_s), sounds=self._sounds(frames)
            )
            return step._replace(numbers=numbers)

    return Impl


IdealSourceSensor = IdealSourceSensor_[None]
