"""A monitor of what a guard relies on: range sensors and odometry."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.ranging.parameters import UltrasonicParameters

#: The faults, by their numbers on the port.
SENSING_FAULTS = "none", "odometry lost", "silent", "frozen", "noisy"
_NONE, _LOST, _SILENT, _FROZEN, _NOISY = range(5)

#: Places in the state of each sensor: its last two ranges, m, how many echoes in
#: succession it has read, how many of them were equal, the heading at the first of
#: these, rad, share of late readings that no motion explains, tick until which what
#: was found counts, and what it was.
_LAST, _BEFORE, _HEARD, _EQUAL, _HEADING, _STRANGE, _UNTIL, _FOUND = range(8)
_EACH = 8

#: Places in the state before the sensors': pose, m and rad, and whether it was lost.
_POSE, _IS_LOST, _SENSORS = 0, 3, 4

#: A pose that moves by so many times what the wheels can is lost.
_FASTER = 2.0
#: A sensor that has not fired for so many of its rounds, and so long, s, is silent.
_ROUNDS, _SILENT_S = 3, 0.2
#: With noise, so many equal echoes in succession do not come by chance; without it,
#: while the robot turns by an aperture and so much more, rad, surfaces do not keep
#: their distance.
_MOST_EQUAL, _BESIDE_RAD = 12, 0.1
#: Second differences of a range that motion makes: so much, m, and by acceleration,
#: m/s^2; and the noise's, in standard deviations of it.
_STEP_M, _STEP_M_S2, _SIGMAS = 0.03, 2.0, 15.0
#: Share that a reading has in the mean, and from which on that is too much.
_PART, _MOST_STRANGE = 0.1, 0.5
#: In a faster turn, rad/s, edges of apertures run along surfaces.
_SLOW_RAD_S = 0.3
#: How long after its last sign a fault of a sensor counts, s.
_KEPT_S = 2.0


class MonitorNumbers(NamedTuple):
    """What the step of ``SensingMonitor`` depends on."""

    limits: tuple[float, float]
    """How far the axle, m, and the heading, rad, may come in a tick."""
    ranges: tuple[float, float]
    """Least and greatest range, m, that tell something."""
    silent_s: float
    """Age of a range from which on its sensor is silent."""
    equal: float
    """So many equal echoes are too many; infinite without noise."""
    turn_rad: float
    """In such a turn an echo does not stay equal."""
    step_m: float
    """Second difference of a range that no motion makes."""
    tick_s: float


@register_jitable
def _judged(state, at, range_, heading, slow, numbers):  # type: ignore[no-untyped-def]
    """What an echo tells of its sensor, whose state begins at ``at``."""
    last, before, heard = state[at + _LAST], state[at + _BEFORE], state[at + _HEARD]
    low, high = numbers.ranges
    if heard > 0.5 and range_ == last and low < range_ < high:
        state[at + _EQUAL] += 1.0
    else:
        state[at + _EQUAL], state[at + _HEADING] = 0.0, heading
    if heard > 1.5 and slow:
        strange = 1.0 if abs(range_ - 2.0 * last + before) > numbers.step_m else 0.0
        state[at + _STRANGE] += _PART * (strange - state[at + _STRANGE])
    state[at + _LAST], state[at + _BEFORE] = range_, last
    state[at + _HEARD] = heard + 1.0
    turned = abs(heading - state[at + _HEADING])
    if state[at + _EQUAL] >= numbers.equal or turned > numbers.turn_rad:
        return _FROZEN
    return _NOISY if state[at + _STRANGE] > _MOST_STRANGE else _NONE


def monitor_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """The fault of one tick.

    State: pose, m and rad; whether it was lost; eight numbers of each sensor.
    """
    pose, ranges, echo, ages = inputs
    turned = pose[2] - state[_POSE + 2]
    if tick > 0:
        moved = math.hypot(pose[0] - state[_POSE], pose[1] - state[_POSE + 1])
        if moved > numbers.limits[0] or abs(turned) > numbers.limits[1]:
            state[_IS_LOST] = 1.0
    for i in range(3):
        state[_POSE + i] = pose[i]
    kind, sensor = _NONE, 0
    slow = abs(turned) <= _SLOW_RAD_S * numbers.tick_s
    for k in range(len(ranges)):
        at = _SENSORS + _EACH * k
        found = _NONE
        if ages[k] > numbers.silent_s:
            found = _SILENT
        elif ages[k] < 0.5 * numbers.tick_s:
            if echo[k] > 0.5:
                found = _judged(state, at, ranges[k], pose[2], slow, numbers)
            else:
                state[at + _HEARD], state[at + _EQUAL] = 0.0, 0.0
        if found != _NONE:
            state[at + _FOUND] = found
            state[at + _UNTIL] = tick + _KEPT_S / numbers.tick_s
        if tick < state[at + _UNTIL] and kind == _NONE:
            kind, sensor = state[at + _FOUND], k + 1
    if state[_IS_LOST] > 0.5:
        kind, sensor = _LOST, 0
    outputs[0][0], outputs[0][1] = kind, sensor


class SensingMonitor(Block):
    """Finds range sensors and odometry that cannot be right, so that a guard stops.

    The faults by their numbers, ``SENSING_FAULTS``:

    1. The pose of the odometry has moved farther in a tick than twice what the wheels
       can. This fault stays for the rest of the run.
    2. A sensor has not fired for three rounds and 0.2 s.
    3. The echoes of a sensor stay equal, 12 times although it has noise, or while the
       robot turns by more than its aperture.
    4. While the robot turns slowly, half of the late echoes of a sensor have moved by
       more than bodies and the stated noise can move them.

    Faults 2 to 4 count for 2 s after their last sign.

    The monitor cannot distinguish a sensor that always reports no echo from one that
    points at empty space.

    Discrete state, every tick: pose, whether it was lost, and of each sensor its last
    two ranges, the counts, the fault found, and until when it counts. The output is a
    function of state and inputs: no latency.

    Args:
        sensors: The range sensors.
        robot: How fast its wheels turn.
        tick_s: Period of control, s.

    Reference: ours; docs/guard.md.
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
        round_s = sensors.round_ticks(tick_s) * tick_s
        numbers = MonitorNumbers(
            (way, 2.0 * way / robot.wheel_separation_m),
            (sensors.minimum_range_m, sensors.maximum_range_m),
            max(_ROUNDS * round_s, _SILENT_S),
            _MOST_EQUAL if sensors.noise_m > 0.0 else math.inf,
            2.0 * math.radians(sensors.beam_half_angle_deg) + _BESIDE_RAD,
            _STEP_M + _STEP_M_S2 * round_s**2 + _SIGMAS * sensors.noise_m,
            tick_s,
        )
        state = [0.0] * (_SENSORS + _EACH * sensors.count)
        self.declare(
            Step(monitor_step, numbers, state),
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
        )
