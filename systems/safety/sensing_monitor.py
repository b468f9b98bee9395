"""A block that detects faults of the range sensors and the odometry for the guard."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.ranging.parameters import UltrasonicParameters

#: Names of the faults; the index is the number on the port.
SENSING_FAULTS = "none", "odometry lost", "silent", "frozen", "noisy"
_NONE, _LOST, _SILENT, _FROZEN, _NOISY = range(5)

#: The odometry is lost if the pose changes too much in one tick. The limit is this
#: multiple of the largest motion that the wheels can cause.
_FASTER = 2.0
# A sensor is silent if it has not fired for both of these times.
# ``_ROUNDS``: number of rounds. In a round, every sensor fires once.
# ``_SILENT_S``: time, s.
_ROUNDS, _SILENT_S = 3, 0.2
# ``_MOST_EQUAL``: number of consecutive equal echoes after which a sensor with noise is
#   frozen.
# ``_BESIDE_RAD``: any sensor is frozen if its echoes stay equal while the robot turns
#   by the aperture of the sensor plus this angle, rad.
_MOST_EQUAL, _BESIDE_RAD = 12, 0.1
# A spike is a range that differs from the range before it and from the range after it,
# in the same direction. A surface that enters or leaves a beam causes a step, which is
# no spike. Motion and noise can cause a spike up to the sum of three terms.
# ``_SPIKE_M``: first term, m.
# ``_SPIKE_M_S2``: acceleration in the second term, m/s^2. The factor is the squared
#   time of a round.
# ``_SIGMAS``: third term as a number of standard deviations of the noise.
_SPIKE_M, _SPIKE_M_S2, _SIGMAS = 0.015, 1.0, 7.5
# ``_PART``: weight of one reading in the mean share of larger spikes.
# ``_MOST_SPIKES``: mean share above which a sensor is noisy. In independent readings, a
#   third is higher than both neighbors, and a third is lower.
_PART, _MOST_SPIKES = 0.1, 0.3
#: Largest yaw rate at which ranges are checked for noise, rad/s. In a faster turn, the
#: edges of apertures move along surfaces, so that the ranges change quickly.
_SLOW_RAD_S = 0.3
#: Time for which a fault of a sensor still counts after its last detection, s.
_KEPT_S = 2.0


class MonitorNumbers(NamedTuple):
    """Constants of the step of ``SensingMonitor``."""

    limits: tuple[float, float]
    """Largest motion of the axle, m, and of the heading, rad, in one tick."""
    ranges: NDArray[np.float64]
    """(n, 2) least and greatest range of each sensor, m. The block compares echoes only
    if the range is between these limits.
    """
    silent_s: float
    """A sensor is silent if its range is older than this, s."""
    equal: NDArray[np.float64]
    """(n,) number of equal echoes after which a sensor counts as frozen; infinite for a
    sensor without noise.
    """
    turn_rad: NDArray[np.float64]
    """(n,) largest turn during which echoes may stay equal, rad."""
    spike_m: NDArray[np.float64]
    """(n,) largest spike of a range that motion and noise can cause, m."""
    tick_s: float


class MonitorState(NamedTuple):
    """State of ``SensingMonitor``. The step changes all arrays.

    Arrays have one entry per sensor, unless stated otherwise.
    """

    pose: NDArray[np.float64]
    """(3,) pose in the last tick, m and rad."""
    is_lost: NDArray[np.float64]
    """(1,) 1 if the odometry was lost, else 0."""
    last: NDArray[np.float64]
    """Last range, m."""
    before: NDArray[np.float64]
    """Range before the last one, m."""
    heard: NDArray[np.float64]
    """Number of consecutive echoes."""
    equal: NDArray[np.float64]
    """Number of consecutive equal echoes."""
    heading: NDArray[np.float64]
    """Heading at the first equal echo, rad."""
    spikes: NDArray[np.float64]
    """Mean share of spikes that no motion explains in the recent readings."""
    found: NDArray[np.float64]
    """Number of the last fault."""
    until: NDArray[np.float64]
    """Tick until which the last fault counts."""


@register_jitable
def _judged(state, k, range_, heading, slow, numbers):  # type: ignore[no-untyped-def]
    """Checks a new echo of sensor ``k`` for the faults frozen and noisy.

    A sensor is frozen after too many equal echoes, or if the echoes stay equal while
    the robot turns far. A sensor is noisy if too many recent readings are large spikes.
    The check for spikes pauses while the robot turns fast.

    Returns:
        Number of the fault, 0 if there is none.
    """
    last, heard, (low, high) = state.last[k], state.heard[k], numbers.ranges[k]
    if heard > 0.5 and range_ == last and low < range_ < high:
        state.equal[k] += 1.0
    else:
        state.equal[k], state.heading[k] = 0.0, heading
    if heard > 1.5 and slow:
        there, back = last - state.before[k], last - range_
        is_spike = (
            there * back > 0.0 and min(abs(there), abs(back)) > numbers.spike_m[k]
        )
        state.spikes[k] += _PART * ((1.0 if is_spike else 0.0) - state.spikes[k])
    state.last[k], state.before[k], state.heard[k] = range_, last, heard + 1.0
    turned = abs(heading - state.heading[k])
    if state.equal[k] >= numbers.equal[k] or turned > numbers.turn_rad[k]:
        return _FROZEN
    return _NOISY if state.spikes[k] > _MOST_SPIKES else _NONE


@register_jitable
def monitor_step(
    tick: int, state: MonitorState, inputs: Any, outputs: Any, numbers: MonitorNumbers
) -> None:
    """Detects faults in one control period; see ``systems.framework.block.Step``."""
    pose, ranges, echo, ages = inputs
    turned = pose[2] - state.pose[2]
    if tick > 0:
        moved = math.hypot(pose[0] - state.pose[0], pose[1] - state.pose[1])
        if moved > numbers.limits[0] or abs(turned) > numbers.limits[1]:
            state.is_lost[0] = 1.0
    for i in range(3):
        state.pose[i] = pose[i]
    kind, sensor = float(_NONE), 0
    # Judge each sensor; the first one with a fault is reported.
    slow = abs(turned) <= _SLOW_RAD_S * numbers.tick_s
    for k in range(len(ranges)):
        found = _NONE
        if ages[k] > numbers.silent_s:
            found = _SILENT
        elif ages[k] < 0.5 * numbers.tick_s:
            if echo[k] > 0.5:
                found = _judged(state, k, ranges[k], pose[2], slow, numbers)
            else:
                state.heard[k], state.equal[k] = 0.0, 0.0
        if found != _NONE:
            state.found[k], state.until[k] = found, tick + _KEPT_S / numbers.tick_s
        if tick < state.until[k] and kind == _NONE:
            kind, sensor = state.found[k], k + 1
    if state.is_lost[0] > 0.5:
        kind, sensor = float(_LOST), 0
    outputs[0][0], outputs[0][1] = kind, sensor


class SensingMonitor(Block):
    """Detects faults of range sensors and odometry, so that the guard stops the robot.

    The faults have these numbers (``SENSING_FAULTS``):

    1. The odometry is lost: in one control period, the pose has changed by more than
       twice the largest motion that the wheels can cause. This fault remains for the
       rest of the run.
    2. A sensor is silent: it has not fired for three rounds, and for at least 0.2 s. A
       round is the time in which every sensor fires once.
    3. A sensor is frozen: its echoes stay equal. For a sensor with noise, 12 equal
       echoes are a fault. For any sensor, equal echoes are a fault if the robot has
       meanwhile turned by the sensor's aperture plus 0.1 rad.
    4. A sensor is noisy: in more than 30 % of its recent readings, the range has
       jumped there and back by more than motion and the specified noise can cause. The
       block makes this check only while the robot turns slowly.

    Faults 2 to 4 still count for 2 s after their last detection.

    The block cannot distinguish a sensor that never reports an echo because of a fault
    from a sensor that points at empty space.

    The abstract state is ``MonitorState``. The output depends on the state and the
    present inputs. There is no latency.

    Args:
        sensors: Parameters of the range sensors.
        robot: Parameters of the robot, for the top speed of the wheels.
        tick_s: Control period, s.

    Reference: our own work; docs/guard.md.
    """

    part, stage = "sensing_monitor", "obstacle sensing"
    inputs = (
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("ranges", "sensors", "m"),
        Port("echo", "sensors", "0 or 1"),
        Port("range_ages", "sensors", "s, since each sensor fired"),
    )
    outputs = (
        Port(
            "sensing_fault",
            2,
            "number of the fault, and of the sensor, from 1",
            ("sensing_fault", "faulty_sensor"),
        ),
    )

    def __init__(
        self,
        *,
        sensors: UltrasonicParameters = UltrasonicParameters(),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("sensing_monitor")
        way = _FASTER * robot.top_wheel_speed * robot.wheel_radius_m * tick_s
        round_s, noise_m = sensors.round_ticks(tick_s) * tick_s, sensors.each("noise_m")
        numbers = MonitorNumbers(
            (way, 2.0 * way / robot.wheel_separation_m),
            np.column_stack(
                [sensors.each("minimum_range_m"), sensors.each("maximum_range_m")]
            ),
            max(_ROUNDS * round_s, _SILENT_S),
            np.where(noise_m > 0.0, float(_MOST_EQUAL), math.inf),
            2.0 * np.array(sensors.half_angles) + _BESIDE_RAD,
            _SPIKE_M + _SPIKE_M_S2 * round_s**2 + _SIGMAS * noise_m,
            tick_s,
        )
        sizes = [3, 1] + [sensors.count] * (len(MonitorState._fields) - 2)
        state = MonitorState(*map(np.zeros, sizes))
        self.declare(
            Step(monitor_step, numbers, state),
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
        )
