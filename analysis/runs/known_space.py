"""What a guarded robot knew of the floor, worked out again from its log."""

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

#: Columns of a run without which the map cannot be worked out.
_POSE = ("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated")
_WHEELS = ("wheel_speed_left", "wheel_speed_right")
#: What a user's own block must not stand in for: its ages or its map are not ours.
_OURS = ("ultrasonic", "free_space")


@dataclass(frozen=True)
class KnownSpace:
    """What was known of the floor at some times, in square cells.

    The frame is that of the odometry: it is W at the start, and drifts from it.
    """

    times: NDArray[np.float64]
    """(n,) of ticks, ascending, s."""
    corner_m: tuple[float, float]
    """Least x and y of cell (0, 0), m."""
    cell_m: float
    """Side of a cell, m."""
    free: NDArray[np.bool_]
    """(n, i, j) cells that counted as seen free; i along x, j along y."""
    hits: NDArray[np.float64]
    """(n, i, j) how often an echo came from about there since a cell was last seen
    free; 0 where it counts as free."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least and greatest x, least and greatest y of the cells, m."""
        _, wide, deep = self.free.shape
        x, y = self.corner_m
        return x, x + wide * self.cell_m, y, y + deep * self.cell_m

    def middles(self, cells: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Places of some cells.

        Args:
            cells: (i, j) which.

        Returns:
            (m, 2) their middles, m.
        """
        counted = np.argwhere(cells).astype(np.float64)
        return np.array(self.corner_m) + (counted + 0.5) * np.float64(self.cell_m)


def has_known_space(result: RunResult) -> bool:
    """Whether a run's log tells what the robot knew.

    Args:
        result: The run of one robot.

    Returns:
        Whether it has a guard, and sensors and a map of ours.
    """
    scenario = result.scenario
    if result.several or scenario.own_guard is None:
        return False
    own = {import_own(name, "blocks").part for name in scenario.blocks}
    columns = {
        *_POSE,
        *_WHEELS,
        *_numbered("range", scenario),
        *_numbered("echo", scenario),
    }
    return own.isdisjoint(_OURS) and columns <= result.columns.keys()


def remembered_space(result: RunResult) -> Iterator[FreeSpace]:
    """The map at each tick, entered anew by the block's own step.

    Args:
        result: The run of one guarded robot.

    Yields:
        The same map at every tick of the log, changed: copy what is to be kept.
    """
    scenario, tick_s = result.scenario, result.scenario.tick_s
    sensors = scenario.ultrasonic
    block = FreeSpaceMap(
        parameters=scenario.own_map,
        sensors=sensors,
        robot=scenario.robot,
        odometry=scenario.odometry,
        plant=scenario.plant,
        tick_s=tick_s,
    )
    integrator = scenario.integrator
    run = RunFacts(
        len(result.time),
        tick_s,
        scenario.start.pose,
        integrator.scheme,
        integrator.step_s,
        lambda _: 0,
        {},
    )
    step = block.step_for(run)
    ticks = np.rint(result.time / tick_s).astype(np.int64)
    for tick, inputs in zip(ticks.tolist(), logged_readings(result), strict=True):
        step.step(tick, step.state, inputs, (), step.numbers)
        yield step.state.free_space


def logged_readings(result: RunResult) -> Iterator[tuple[NDArray[np.float64], ...]]:
    """What the range sensors read at each tick, and where the robot took itself to be.

    Args:
        result: The run of one guarded robot.

    Yields:
        (sensors,) ranges, m, echoes, 0 or 1, and ages of them, s, (3,) the pose by
        the odometry, m and rad, and (2,) the wheel speeds commanded until then, rad/s.
    """
    scenario, columns, tick_s = result.scenario, result.columns, result.scenario.tick_s
    sensors = scenario.ultrasonic
    ticks = np.rint(result.time / tick_s).astype(np.int64)
    # Of sensors that fire in turn the log does not tell which one has just fired.
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
    # A row has the command from its tick on; until then it was that of the row before.
    wheels = np.vstack([np.zeros(2), wheels[:-1]])
    for row in range(len(ticks)):
        age = since[row] * tick_s
        yield ranges[row], echo[row], age, poses[row], wheels[row]


def known_space(result: RunResult, times: ArrayLike) -> KnownSpace | None:
    """What a guarded robot knew of the floor.

    Args:
        result: The run of one robot.
        times: (n,) at which, s; of each the nearest tick is taken, once.

    Returns:
        What it knew, on the cells that were known at one of the times; None without a
        guard, or where a block of a user's own stands in for the sensors or the map.
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
    """Columns of a quantity of each sensor."""
    return [f"{name}_{k}" for k in range(1, scenario.ultrasonic.count + 1)]


#: Of a map's cells that are known: the first one's i and j, which are free, and hits.
_View = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.float64]]


def _view(space: FreeSpace) -> _View:
    """The known cells of a map in the order of their places."""
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
    """Views of different parts of the floor on the least grid that holds them all."""
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
