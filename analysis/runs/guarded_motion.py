"""What a guard did in a run, and where the robot could have come to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams import RunResult
from systems.framework.compiling import njit
from systems.safety.braking import BrakingNumbers, braked, roll_on, rolled_speeds
from systems.safety.motion_guard import MotionGuard
from systems.safety.sensing_monitor import SENSING_FAULTS

#: What a guard does with a command, by its number in a run's table.
GUARD_ACTIONS = ("passed", "slowed", "turned", "braked", "halted")
#: Braking ends once the rims are so slow, m/s; the motors' lag leaves no way then.
_REST_M_S = 1e-4


@dataclass(frozen=True)
class GuardedMotion:
    """What a guard did at the ticks of a run."""

    actions: NDArray[np.int64]
    """(n,) places in ``GUARD_ACTIONS``."""
    resting_poses: NDArray[np.float64]
    """(n, 3) x, y, theta at which the robot would rest if it braked from then on, in
    the frame of the odometry, m and rad."""
    keep_m: float
    """Radius of the disc about the axle that the guard keeps in free space, m."""


def guarded_motion(result: RunResult) -> GuardedMotion | None:
    """What a guard did in a run.

    Args:
        result: The run of one robot.

    Returns:
        What it did; None without a guard.
    """
    columns, scenario = result.columns, result.scenario
    if scenario.own_guard is None or "guard_action" not in columns:
        return None
    guard = MotionGuard(
        parameters=scenario.own_guard,
        robot=scenario.robot,
        plant=scenario.plant,
        tick_s=scenario.tick_s,
    )
    braking = guard.step.numbers.braking
    names = "p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"
    poses = np.column_stack([columns[name] for name in names])
    sides = "wheel_speed_left", "wheel_speed_right"
    # Of the tick before each, from rest.
    commands = np.column_stack([np.r_[0.0, columns[name][:-1]] for name in sides])
    return GuardedMotion(
        np.rint(columns["guard_action"]).astype(np.int64),
        _resting_poses(poses, commands, braking),
        braking.keep_m,
    )


@dataclass(frozen=True)
class Halt:
    """Why and when a guard has halted a robot whose sensing it could not trust."""

    fault: str
    """One of ``SENSING_FAULTS``."""
    sensor: int
    """Its number, from the left, from 1; 0: the odometry."""
    start_s: float
    """When it was first found."""
    duration_s: float
    """For how long in all."""

    def __str__(self) -> str:
        who = f"sensor {self.sensor} {self.fault}" if self.sensor else self.fault
        return f"{who} from {self.start_s:.3g} s, for {self.duration_s:.3g} s"


def halts_of(result: RunResult) -> list[Halt]:
    """What was wrong with a guarded robot's sensing, by its beginning.

    Args:
        result: The run of one robot.

    Returns:
        One for each fault of each sensor; none where nothing was found.
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
    """Where braking ends, as the guard reckons it.

    Args:
        poses: (n, 3) at the ticks, m and rad.
        commands: (n, 2) of the tick before each, left and right wheel, rad/s.
        numbers: How the robot brakes.
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
