"""Finds what a safety guard did in a run, and where the robot could have stopped.

A guard limits the commands of the control law. The robot can then always brake to rest
on floor that is known to be free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams import RunResult
from systems.framework.compiling import njit
from systems.safety.motion_guard import MotionGuard
from systems.safety.predicted_motion import (
    BrakingNumbers,
    braked,
    roll_on,
    rolled_speeds,
)
from systems.safety.sensing_monitor import SENSING_FAULTS

#: Actions of a guard. The index is the number in the table of a run.
GUARD_ACTIONS = ("passed", "slowed", "turned", "braked", "halted")
#: Speed of the wheel rims below which braking ends, m/s. At this speed, the lag of the
#: motors causes practically no further motion.
_REST_M_S = 1e-4


@dataclass(frozen=True)
class GuardedMotion:
    """Actions of a safety guard at the ticks (control periods) of a run."""

    actions: NDArray[np.int64]
    """(n,) action of the guard at each tick, as an index into ``GUARD_ACTIONS``."""
    resting_poses: NDArray[np.float64]
    """(n, 3) poses (x, y, theta) at which the robot would come to rest if it braked
    from each tick on. The poses are in the frame of the odometry, m and rad."""
    half_size_m: tuple[float, float]
    """Half of the length and width of a rectangle around the origin of B, m: the
    outline of the body plus the margin. The guard keeps it in free space."""


def guarded_motion(result: RunResult) -> GuardedMotion | None:
    """Finds what the safety guard did at each tick; None if the robot has no guard.

    The guard limits the commands of the control law at each tick (control period).
    """
    columns, scenario = result.columns, result.scenario
    if scenario.only.own_guard is None or "guard_action" not in columns:
        return None
    guard = MotionGuard(
        parameters=scenario.only.own_guard,
        robot=scenario.only.robot,
        plant=scenario.only.plant,
        tick_s=scenario.tick_s,
    )
    braking = guard.step.numbers.braking
    outline, keep_m = braking.outline, braking.keep_m
    names = "p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"
    poses = np.column_stack([columns[name] for name in names])
    sides = "wheel_speed_left", "wheel_speed_right"
    # Commands of the previous tick. The robot starts at rest.
    commands = np.column_stack([np.r_[0.0, columns[name][:-1]] for name in sides])
    return GuardedMotion(
        np.rint(columns["guard_action"]).astype(np.int64),
        _resting_poses(poses, commands, braking),
        (outline.half_length_m + keep_m, outline.half_width_m + keep_m),
    )


@dataclass(frozen=True)
class Halt:
    """Halts of the robot by its guard because of one fault of one sensor."""

    fault: str
    """Name of the fault, from ``SENSING_FAULTS``."""
    sensor: int
    """Number of the faulty range sensor, from 1 at the left; 0 for the odometry."""
    start_s: float
    """Time at which the guard first found the fault, s."""
    duration_s: float
    """Total time for which the fault was present, s."""

    def __str__(self) -> str:
        who = f"sensor {self.sensor} {self.fault}" if self.sensor else self.fault
        return f"{who} from {self.start_s:.3g} s, for {self.duration_s:.3g} s"


def halts_of(result: RunResult) -> list[Halt]:
    """Lists the sensing faults for which the safety guard halted the robot of a run.

    The list has one entry for each fault of each sensor, even if the fault occurred
    several times. The entries are sorted by start time.
    """
    columns, found = result.columns, []
    if "sensing_fault" not in columns:
        return []
    kinds = np.rint(columns["sensing_fault"]).astype(np.int64)
    sensors = np.rint(columns["faulty_sensor"]).astype(np.int64)
    for kind, sensor in {*zip(kinds.tolist(), sensors.tolist(), strict=True)}:
        if kind > 0:
            ticks = np.flatnonzero((kinds == kind) & (sensors == sensor))
            duration_s = ticks.size * result.scenario.tick_s
            start_s = float(result.time[ticks[0]])
            found.append(Halt(SENSING_FAULTS[kind], sensor, start_s, duration_s))
    return sorted(found, key=lambda halt: halt.start_s)


@njit(cache=True)
def _resting_poses(
    poses: NDArray[np.float64],
    commands: NDArray[np.float64],
    numbers: BrakingNumbers,
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes for each tick the pose at which the robot would rest if it braked.

    The poses (n, 3) are (x, y, theta), m and rad. The (n, 2) commands are the speeds of
    the left and right wheel that the previous tick commanded, rad/s.
    """
    rests = np.empty(poses.shape)
    speeds, kept = (0.0, 0.0), numbers.part.kept**numbers.parts
    for k in range(len(poses)):
        pose = poses[k, 0], poses[k, 1], poses[k, 2]
        command = commands[k, 0], commands[k, 1]
        if k > 0:
            speeds = rolled_speeds(speeds, command, kept)
        now = speeds
        while True:
            command = braked(command, numbers)
            for _ in range(numbers.parts):
                pose, now = roll_on(pose, now, command, numbers)
            fastest = max(abs(now[0]), abs(now[1])) * numbers.wheel_radius_m
            if command[0] == 0.0 and command[1] == 0.0 and fastest < _REST_M_S:
                break
        rests[k, 0], rests[k, 1], rests[k, 2] = pose
    return rests
