"""Reconstructs a robot's map of the floor from the log of a run.

Only robots with a safety guard have such a map. The guard keeps a robot on floor that
the map shows as free.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from diagrams import RunResult, Scenario
from diagrams.scenario.own_code import import_own
from systems.framework.block import RunFacts
from systems.safety.free_space import FreeSpace
from systems.safety.free_space_map import FreeSpaceMap

#: Columns of the pose by odometry, which the reconstruction of the map needs.
_POSE = ("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated")
#: Columns of the wheel speeds, which the reconstruction also needs.
_WHEELS = ("wheel_speed_left", "wheel_speed_right")
#: Parts of the robot that must be blocks of this project. For a block of a user's own,
#: the ages of readings or the rules of the map are unknown.
_OURS = ("ultrasonic", "free_space")


@dataclass(frozen=True)
class KnownSpace:
    """Map of the floor that a robot with a safety guard knew at several times.

    The map consists of square cells. All positions are in the frame of the odometry. At
    the start, this frame equals the world frame W. During the run, it drifts away from
    W.
    """

    times: NDArray[np.float64]
    """(n,) ascending times of ticks (control periods), s."""
    corner_m: tuple[float, float]
    """Least x and y of cell (0, 0), m."""
    cell_m: float
    """Side of a cell, m."""
    free: NDArray[np.bool_]
    """(n, i, j) whether each cell counted as free at each time; i is along x, and j is
    along y."""
    hits: NDArray[np.float64]
    """(n, i, j) weighted number of echoes from each cell since the cell was last seen
    free. The number is 0 if the cell counts as free."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least x, greatest x, least y and greatest y of all cells, m."""
        _, wide, deep = self.free.shape
        x, y = self.corner_m
        return x, x + wide * self.cell_m, y, y + deep * self.cell_m

    def middles(self, cells: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Returns the (k, 2) centers of the k cells where a mask (i, j) is true, m."""
        counted = np.argwhere(cells).astype(np.float64)
        return np.array(self.corner_m) + (counted + 0.5) * np.float64(self.cell_m)


def has_known_space(result: RunResult) -> bool:
    """Returns whether the log of a run is sufficient to reconstruct the robot's map.

    These conditions must hold:

    - The result is that of one robot, not the joint result of several robots.
    - The robot has a safety guard, which uses a map of free floor.
    - The blocks of the range sensors and of the map are not a user's own blocks.
    - The log contains the poses, the wheel speeds and the sensor readings.
    """
    scenario = result.scenario
    if result.several or scenario.only.own_guard is None:
        return False
    own = {import_own(name, "blocks").part for name in scenario.only.blocks}
    columns = {
        *_POSE,
        *_WHEELS,
        *_numbered("range", scenario),
        *_numbered("echo", scenario),
    }
    return own.isdisjoint(_OURS) and columns <= result.columns.keys()


def remembered_space(result: RunResult) -> Iterator[FreeSpace]:
    """Reconstructs the map of free floor at each tick (control period) of a run.

    The function runs the step of the block ``FreeSpaceMap`` on the logged readings. It
    yields the same object at every tick and changes this object at the next tick. Copy
    all values that you need later.
    """
    scenario, tick_s = result.scenario, result.scenario.tick_s
    sensors = scenario.sensing.ultrasonic
    block = FreeSpaceMap(
        parameters=scenario.follower.own_map,
        sensors=sensors,
        robot=scenario.only.robot,
        plant=scenario.only.plant,
        tick_s=tick_s,
    )
    run = RunFacts(
        len(result.time),
        tick_s,
        scenario.only.start.pose,
        scenario.integration_step_s,
        lambda _: 0,
        {},
    )
    step = block.step_for(run)
    ticks = np.rint(result.time / tick_s).astype(np.int64)
    for tick, inputs in zip(ticks.tolist(), logged_readings(result), strict=True):
        step.step(tick, step.state, inputs, (), step.numbers)
        yield step.state.free_space


def logged_readings(result: RunResult) -> Iterator[tuple[NDArray[np.float64], ...]]:
    """Reads the inputs of the floor map from the log, at each tick (control period).

    Each tick has five arrays, in this order:

    - (sensors,) ranges of the range sensors, m
    - (sensors,) echoes, 1 or 0
    - (sensors,) ages of the readings, s
    - (3,) pose (x, y, theta) by odometry, m and rad
    - (2,) speeds of the left and right wheel, as commanded at the previous tick, rad/s
    """
    scenario, columns, tick_s = result.scenario, result.columns, result.scenario.tick_s
    sensors = scenario.sensing.ultrasonic
    ticks = np.rint(result.time / tick_s).astype(np.int64)
    # The log does not state which sensor has just fired. But the sensors fire on a
    # schedule, which determines the ages of their readings.
    since = (ticks[:, None] - sensors.turns(tick_s)) % sensors.round_ticks(tick_s)
    ranges, echo, poses, wheels = (
        np.column_stack([columns[name] for name in names])
        for names in (
            _numbered("range", scenario),
            _numbered("echo", scenario),
            _POSE,
            _WHEELS,
        )
    )
    # A row contains the command from its tick on. Before this tick, the command of the
    # previous row applied.
    wheels = np.vstack([np.zeros(2), wheels[:-1]])
    for row in range(len(ticks)):
        age = since[row] * tick_s
        yield ranges[row], echo[row], age, poses[row], wheels[row]


def known_space(result: RunResult, times: ArrayLike) -> KnownSpace | None:
    """Reconstructs the map of the floor that a robot had at the given times, s.

    For each time, the function uses the nearest tick (control period). A tick that is
    nearest to several times occurs once in the result. The grid contains all cells that
    were known at any of these ticks. The result is None if ``has_known_space`` is
    false.
    """
    if not has_known_space(result):
        return None
    wanted = np.ravel(np.asarray(times, dtype=float))
    rows = np.unique(np.abs(result.time[:, None] - wanted).argmin(axis=0))
    views = []
    for row, space in enumerate(remembered_space(result)):
        if row in rows:
            views.append(_view(space))
        if row == rows[-1]:
            break
    return _on_one_grid(result.time[rows], views, space.cell_m)


def _numbered(name: str, scenario: Scenario) -> list[str]:
    """Returns the column names of one quantity, one name per sensor."""
    return [f"{name}_{k}" for k in range(1, scenario.sensing.ultrasonic.count + 1)]


#: Known part of a map: i and j of its first cell, free cells, and hits.
_View = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.float64]]


def _view(space: FreeSpace) -> _View:
    """Copies the known part of a map, and sorts its cells by their position."""
    cells = len(space.free_until)
    first = space.first.copy()
    at = np.ix_(*((first[:, None] + np.arange(cells)) % cells))
    free = space.free_until[at] >= space.rolled_m[0]
    hits = np.where(free, 0.0, space.hits[at])
    known = np.argwhere(free | (hits > 0.0))
    if len(known) == 0:
        return first, free[:0, :0], hits[:0, :0]
    low, high = known.min(axis=0), known.max(axis=0) + 1
    part = slice(low[0], high[0]), slice(low[1], high[1])
    return first + low, free[part], hits[part]


def _on_one_grid(
    times: NDArray[np.float64], views: list[_View], cell_m: float
) -> KnownSpace:
    """Puts views of different parts of the floor on the smallest common grid."""
    filled = [view for view in views if view[1].size] or views[:1]
    low = np.min([first for first, _, _ in filled], axis=0)
    high = np.max([first + free.shape for first, free, _ in filled], axis=0)
    shape = (len(views), *(high - low))
    free, hits = np.zeros(shape, dtype=bool), np.zeros(shape)
    for k, (first, own_free, own_hits) in enumerate(views):
        if not own_free.size:
            continue
        i, j = first - low
        wide, deep = own_free.shape
        free[k, i : i + wide, j : j + deep] = own_free
        hits[k, i : i + wide, j : j + deep] = own_hits
    corner = float(low[0] * cell_m), float(low[1] * cell_m)
    return KnownSpace(times, corner, cell_m, free, hits)
