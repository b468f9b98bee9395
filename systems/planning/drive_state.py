"""State of the guarded law: its mode, its timers, its route, and tracks of bodies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.hazards import Hazards, make_hazards
from systems.planning.looks import HazardSensors
from systems.planning.passage import Passage, make_passage
from systems.planning.way import Way, make_way

#: Modes of the robot, see ``systems.planning.guarded_drive``.
WAITING, DRIVING, LOOKING, BACKING, GIVING_UP = range(5)


class DriveMemory(NamedTuple):
    """Memory of the guarded law. Arrays have the shape (1,) unless stated otherwise."""

    speed: NDArray[np.float64]
    """Wanted forward speed, m/s."""
    turn: NDArray[np.float64]
    """Wanted yaw rate, rad/s."""
    mode: NDArray[np.float64]
    """Mode of the robot, ``WAITING`` to ``GIVING_UP``."""
    carrot: NDArray[np.float64]
    """(2,) point (x, y) of the route toward which the robot drives, m."""
    way_left_m: NDArray[np.float64]
    """Remaining length of the route, m."""
    planned_s: NDArray[np.float64]
    """Time of the last plan, s."""
    passable_s: NDArray[np.float64]
    """Time of the last route without occupied cells, s."""
    blocked_s: NDArray[np.float64]
    """Last time at which the guard did not block the robot, s."""
    stays_at: NDArray[np.float64]
    """(2,) position of the robot when it last moved on, m."""
    stays_s: NDArray[np.float64]
    """Time when the robot last moved on, s."""
    settled: NDArray[np.float64]
    """1 if the robot rests nearly at the follow distance, else 0."""
    has_looked: NDArray[np.float64]
    """1 after the first look around, else 0."""
    headings: NDArray[np.float64]
    """(2,) headings of the current look, rad."""
    looks_done: NDArray[np.float64]
    """Number of headings of the current look that are done."""
    looks_held: NDArray[np.float64]
    """Number of headings of the current look to which the guard did not let the robot
    turn.
    """
    block: NDArray[np.float64]
    """(2,) position of the cell that blocks the robot, m."""
    backs: NDArray[np.float64]
    """Direction of backing off: -1 back, or 1 ahead."""
    backed_s: NDArray[np.float64]
    """Start of backing off in this direction, s."""
    held: NDArray[np.float64]
    """Speed that the guard last refused, m/s, or 0."""
    held_s: NDArray[np.float64]
    """Time when the guard last refused a speed, s."""


class DriveState(NamedTuple):
    """State of the guarded law between two ticks."""

    memory: DriveMemory
    way: Way
    hazards: Hazards
    passage: Passage


class DriveNumbers(NamedTuple):
    """Constants of the guarded law."""

    follow_distance_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    sensors: HazardSensors
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""
    widths: tuple[float, float]
    """Distances that routes keep from occupied cells, m: half of the width of the body
    plus margins, and the radius of the disc around the body plus the same margins. In
    narrow passages, only the first distance is kept. For a long body, it is one cell of
    the map less.
    """
    cruise_m_s: float
    """Largest wanted speed, m/s."""
    tick_s: float
    creep_m_s: float
    """Speed of the fastest point of a long body in a passage in which it has to be in
    line with the axis, m/s. It is 0 if the body is not long.
    """
    widest_m: float
    """Width of a passage from which on a long body passes it without lining up, m."""


def make_drive_state(cells: int, sensors: int) -> DriveState:
    """Makes the state before the first control period.

    The state has no plan, and its memory contains no earlier position of the robot.
    ``cells`` is the number of cells along a side of the map. ``sensors`` is the number
    of range sensors.
    """
    pairs = "carrot", "stays_at", "headings", "block"
    memory = DriveMemory(
        *(np.zeros(2 if name in pairs else 1) for name in DriveMemory._fields)
    )
    memory.planned_s[:], memory.stays_at[:] = -np.inf, np.inf
    return DriveState(memory, make_way(cells), make_hazards(sensors), make_passage())


@njit(cache=True)
def restart_stay(
    m: DriveMemory, pose: Any, time: float
) -> None:  # pragma: no cover  (compiled)
    """Restarts the timer that measures how long the robot stays in one place."""
    m.stays_at[0], m.stays_at[1], m.stays_s[0] = pose[0], pose[1], time
