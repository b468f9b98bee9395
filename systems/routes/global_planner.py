"""The route to the goal, planned from the map and again when the robot stalls."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.framework.signals import TICK_S
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.occupancy_grid import OccupancyGrid, block_discs, map_grid
from systems.routes.parameters import RouteParameters
from systems.routes.route import (
    ROUTE_SIZE,
    ROUTE_UNIT,
    fill_route,
    find_route,
    plan_route,
)
from systems.routes.seen_points import (
    SeenPoints,
    discs_to_avoid,
    make_seen_points,
    remember_objects,
)
from systems.world.geometry import control_point

#: Indices of ``PlannerState.progress``. REPLANS: number of new routes. SINCE_S: time of
#: the last advance of P, s. FROM_M: arc length of P at that time, m.
REPLANS, SINCE_S, FROM_M = range(3)
#: The robot stalls if P advances along the route by less than ``_STALL_M``, m, within
#: ``_STALLED_S``, s.
_STALL_M, _STALLED_S = 0.1, 6.0
#: Distance from the goal within which the robot has arrived and does not stall, m.
_ARRIVED_M = 0.15


class PlannerNumbers(NamedTuple):
    """Constants of the step of ``GlobalPlanner``."""

    grid: OccupancyGrid
    """Grid in which the cells too near to known obstacles are blocked."""
    rectangles: NDArray[np.float64]
    """(k, 6) rectangles of known obstacles in W."""
    goal: tuple[float, float]
    clearance_m: float
    replans: bool
    """Whether the planner makes new routes."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    tick_s: float


class PlannerState(NamedTuple):
    """State of ``GlobalPlanner``."""

    route: NDArray[np.float64]
    """(ROUTE_SIZE,) value of the port ``route``."""
    progress: NDArray[np.float64]
    """(3,) values at ``REPLANS``, ``SINCE_S`` and ``FROM_M``."""
    seen: SeenPoints


@njit(cache=True)
def _find_route_again(
    numbers: PlannerNumbers, seen: SeenPoints, objects: Any, p_WP: tuple[float, float]
) -> Any:  # pragma: no cover  (compiled)
    """Plan a route from P past known obstacles, seen points and robots at rest."""
    grid, clearance = numbers.grid, numbers.clearance_m
    discs = discs_to_avoid(seen, objects, p_WP)
    now = OccupancyGrid(grid.blocked.copy(), grid.low)
    block_discs(now, discs, clearance)
    return find_route(now, p_WP, numbers.goal, numbers.rectangles, discs, clearance)


def planner_step(
    tick: int, state: PlannerState, inputs: Any, outputs: Any, numbers: PlannerNumbers
) -> None:
    """Computes the route for the next tick (control period).

    The planner remembers the objects that the sensors see. If the robot stalls, it
    plans a new route.
    """
    if not numbers.replans:
        return
    objects, pose, route_progress = inputs
    seen, progress, reached = state.seen, state.progress, route_progress[1]
    x, y = control_point((pose[0], pose[1], pose[2]), numbers.control_point_m)
    remember_objects(seen, numbers.grid, numbers.rectangles, objects, (x, y))
    time = tick * numbers.tick_s
    away = math.hypot(numbers.goal[0] - x, numbers.goal[1] - y)
    # P has advanced, or has arrived: restart the timer.
    if reached >= progress[FROM_M] + _STALL_M or away <= _ARRIVED_M:
        progress[FROM_M], progress[SINCE_S] = reached, time
    # Half a tick exceeds the rounding of times.
    if time - progress[SINCE_S] < _STALLED_S - 0.5 * numbers.tick_s:
        return
    progress[SINCE_S], progress[FROM_M] = time, reached
    points = _find_route_again(numbers, seen, objects, (x, y))
    if len(points) > 0:
        fill_route(state.route, points)
        progress[REPLANS] += 1.0
        progress[FROM_M] = 0.0


def _publish_route(state: PlannerState, outputs: Any, numbers: PlannerNumbers) -> None:
    """Copy the state of ``planner_step`` to the outputs."""
    route, replans = outputs
    for k in range(len(route)):
        route[k] = state.route[k]
    replans[0] = state.progress[REPLANS]


class GlobalPlanner(Block):
    """Plans the route to the goal, and plans a new route when the robot stalls.

    A route is a curve for P, the control point ahead of the wheel axle. The first route
    leads from the initial position of P past the known obstacles (``plan_route``).
    During the run, the planner remembers the nearest points of objects that are not
    known to move. It remembers at most one point per cell of its grid.

    The robot stalls if P advances by less than 10 cm along the route in 6 s. Within 15
    cm of the goal, it does not count as stalled. If the robot stalls, the block plans a
    new route from the position of P. This route also avoids the remembered points and
    robots at rest. If there is no such route, the block keeps the old route and tries
    again after 6 s.

    The discrete state is ``PlannerState``. A new route appears at the output one
    control period after the inputs that cause it. There is no feedthrough.

    Args:
        parameters: Goal, clearance, and whether the block plans new routes.
        known: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in the world frame W, m and rad.
        initial_pose: (x, y, theta) of the robot at the start in W, m and rad.
        robot: Position of P on the robot.
        tick_s: Control period of the robot, s.

    Raises:
        InputError: There is no route.

    Reference: Engelbrecht, Steyn and Djouani (2021), sec. 2, plan the path with A*.
    Planning again after a stall is our addition.
    """

    part = "global_planner"
    inputs = (
        Port(
            "objects_W",
            OBJECT_SLOTS * OBJECT_SIZE,
            "number, m and m/s in eight slots, see systems.ranging.objects",
        ),
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("route_progress", 2, "m, m"),
    )
    outputs = (
        Port("route", ROUTE_SIZE, ROUTE_UNIT),
        Port("replans", 1, "number of new routes", ("replans",)),
    )

    def __init__(
        self,
        *,
        parameters: RouteParameters = RouteParameters(),
        known: ArrayLike = (),
        initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("global_planner")
        self._goal = parameters.goal_m
        self._make_step = partial(_make_step, parameters, robot, tick_s)
        step = self._make_step(initial_pose, self._goal, known)
        self.declare(step, tick_s=tick_s)

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step with start, goal and map of the run."""
        return self._make_step(run.initial_pose, run.goal or self._goal, run.mapped)


def _make_step(
    parameters: RouteParameters,
    robot: RobotParameters,
    tick_s: float,
    initial_pose: tuple[float, float, float],
    goal: tuple[float, float],
    known: ArrayLike,
) -> Step:
    rectangles: NDArray[np.float64] = np.array(known, dtype=float).reshape(-1, 6)
    start = control_point(initial_pose, robot.control_point_m)
    try:
        route = plan_route(
            start,
            goal,
            rectangles,
            clearance_m=parameters.clearance_m,
        )
    except InputError as error:
        field = "start.position_m" if error.field == "start" else error.field
        group = "" if error.field == "start" else "route."
        raise InputError(f"{group}{field}", error.message) from error
    grid = map_grid([start, goal], rectangles, parameters.clearance_m)
    numbers = PlannerNumbers(
        grid,
        rectangles,
        goal,
        parameters.clearance_m,
        parameters.replan,
        robot.control_point_m,
        tick_s,
    )
    state = PlannerState(route.numbers, np.zeros(3), make_seen_points(grid))
    return Step(planner_step, numbers, state, _publish_route)
