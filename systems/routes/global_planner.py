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
from systems.planning.safety_filter import turning_distance_m
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.clearances import fill_clearances
from systems.routes.occupancy_grid import (
    CELL_M,
    OccupancyGrid,
    free_grid,
    sorted_discs,
)
from systems.routes.parameters import RouteParameters
from systems.routes.route import ROUTE_POINTS, ROUTE_SIZE, ROUTE_UNIT, fill_route
from systems.routes.seen_points import (
    SeenPoints,
    discs_to_avoid,
    is_at_rest,
    make_seen_points,
    remember_objects,
)
from systems.routes.widest_route import (
    clearances_to_try,
    find_widest_route,
    plan_route,
)
from systems.world.geometry import control_point

#: Indices of ``PlannerState.progress``. REPLANS: number of new routes. SINCE_S: time of
#: the last advance of P, s. FROM_M: arc length of P at that time, m. CLEARANCE_M:
#: clearance of the route near P, m.
REPLANS, SINCE_S, FROM_M, CLEARANCE_M = range(4)
#: The robot stalls if P advances along the route by less than ``_STALL_M``, m, within
#: ``_STALLED_S``, s, or within ``_BLOCKED_S``, s, where an object that is seen to be at
#: rest blocks the next ``_AHEAD_M``, m, of the route. Moving objects, such as other
#: robots, may leave during the longer time.
_STALL_M, _STALLED_S, _BLOCKED_S, _AHEAD_M = 0.1, 6.0, 2.0, 1.0
#: Distance from the goal within which the robot has arrived and does not stall, m.
_ARRIVED_M = 0.05
#: Largest value of the port ``route_clearance``, m.
_FAR_M = 1e6
#: Least planned distance between the side of the body and a known obstacle, m (our
#: choice). With cells of 5 cm, each passage that leaves 5 cm on both sides is found.
_BESIDE_M = 0.025


class PlannerNumbers(NamedTuple):
    """Constants of the step of ``GlobalPlanner``."""

    grid: OccupancyGrid
    """Grid of free cells that covers the floor."""
    rectangles: NDArray[np.float64]
    """(k, 6) rectangles of known obstacles in W."""
    goal: tuple[float, float]
    clearances: NDArray[np.float64]
    """(n,) clearances that the planner tries in this order, m."""
    seen_m: float
    """Least distance of new routes from seen obstacles, m."""
    replans: bool
    """Whether the planner makes new routes."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    tick_s: float


class PlannerState(NamedTuple):
    """State of ``GlobalPlanner``."""

    route: NDArray[np.float64]
    """(ROUTE_SIZE,) value of the port ``route``."""
    clearances: NDArray[np.float64]
    """(ROUTE_POINTS,) distance of each point of the route from obstacles, m."""
    progress: NDArray[np.float64]
    """(4,) values at ``REPLANS``, ``SINCE_S``, ``FROM_M`` and ``CLEARANCE_M``."""
    seen: SeenPoints


@njit(cache=True)
def _plan_again(
    numbers: PlannerNumbers,
    state: PlannerState,
    objects: Any,
    p_WP: tuple[float, float],
) -> bool:  # pragma: no cover  (compiled)
    """Plan a route from P past known obstacles, seen points and robots at rest."""
    discs = discs_to_avoid(state.seen, objects, p_WP)
    points = find_widest_route(
        numbers.grid,
        p_WP,
        numbers.goal,
        numbers.rectangles,
        discs,
        numbers.clearances,
        numbers.seen_m,
    )
    if len(points) == 0:
        return False
    fill_route(state.route, points)
    fill_clearances(state.clearances, points, numbers.rectangles, discs)
    return True


@njit(cache=True)
def _clearance_at(
    state: PlannerState, along: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the clearance at an arc length of the route, m, interpolated."""
    last = int(state.route[0]) - 1
    place = min(max(along / state.route[1], 0.0), float(last))
    k = min(int(place), last - 1)
    part = place - k
    if part == 0.0:
        return float(state.clearances[k])
    near, far = state.clearances[k], state.clearances[k + 1]
    return float(near + part * (far - near) if far < np.inf else near)


@njit(cache=True)
def _is_blocked(
    numbers: PlannerNumbers, state: PlannerState, along: float
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether something at rest is too near to the route ahead of a length."""
    route, seen = state.route, state.seen
    count, spacing = int(route[0]), route[1]
    first = min(max(int(along / spacing), 0), count - 1)
    last = min(first + math.ceil(_AHEAD_M / spacing), count - 1)
    # New routes keep ``seen_m``, apart from less than a cell.
    near = numbers.seen_m - CELL_M
    for p in range(min(seen.added[0], len(seen.points))):
        if not is_at_rest(seen, p):
            continue
        x, y = seen.points[p, 0], seen.points[p, 1]
        for k in range(first, last + 1):
            dx, dy = route[2 + 2 * k] - x, route[3 + 2 * k] - y
            if dx * dx + dy * dy < near * near:
                return True
    return False


def planner_step(
    tick: int, state: PlannerState, inputs: Any, outputs: Any, numbers: PlannerNumbers
) -> None:
    """Computes the route for the next tick (control period).

    The planner remembers the objects that the sensors see. If the robot stalls, it
    plans a new route.
    """
    objects, pose, route_progress = inputs
    seen, progress, reached = state.seen, state.progress, route_progress[1]
    progress[CLEARANCE_M] = _clearance_at(state, reached)
    if not numbers.replans:
        return
    x, y = control_point((pose[0], pose[1], pose[2]), numbers.control_point_m)
    time = tick * numbers.tick_s
    remember_objects(seen, numbers.grid, numbers.rectangles, objects, (x, y), time)
    away = math.hypot(numbers.goal[0] - x, numbers.goal[1] - y)
    # P has advanced, or has arrived: restart the timer.
    if reached >= progress[FROM_M] + _STALL_M or away <= _ARRIVED_M:
        progress[FROM_M], progress[SINCE_S] = reached, time
    # Half a tick exceeds the rounding of times.
    waited_s = time - progress[SINCE_S] + 0.5 * numbers.tick_s
    if waited_s < _BLOCKED_S:
        return
    if waited_s < _STALLED_S and not _is_blocked(numbers, state, reached):
        return
    progress[SINCE_S], progress[FROM_M] = time, reached
    if _plan_again(numbers, state, objects, (x, y)):
        progress[REPLANS] += 1.0
        progress[FROM_M] = 0.0
        progress[CLEARANCE_M] = state.clearances[0]


def _publish_route(state: PlannerState, outputs: Any, numbers: PlannerNumbers) -> None:
    """Copy the state of ``planner_step`` to the outputs."""
    route, replans, clearance = outputs
    for k in range(len(route)):
        route[k] = state.route[k]
    replans[0] = state.progress[REPLANS]
    clearance[0] = min(state.progress[CLEARANCE_M], _FAR_M)


class GlobalPlanner(Block):
    """Plans the route to the goal, and plans a new route when the robot stalls.

    A route is a curve for P, the control point ahead of the wheel axle. The first route
    leads from the initial position of P past the known obstacles (``plan_route``).
    During the run, the planner remembers the nearest points of objects that are not
    known to move. It remembers at most one point per cell of its grid.

    If no route has the desired clearance, the planner accepts less, down to half of the
    width of the body plus 2.5 cm. From seen obstacles, it keeps the distance at which
    the body can turn, because it knows only points of them. The output
    ``route_clearance`` is the distance from obstacles at the route's point nearest to
    P. It includes all obstacles that the planner knew when it made the route.

    The robot stalls if P advances by less than 10 cm along the route in 6 s, or in 2 s
    where an object at rest blocks the next meter of the route. An object is at rest if
    it was seen within 15 cm of a remembered point for 3 s. Within 5 cm of the goal, the
    robot does not count as stalled. If the robot stalls, the block plans a new route
    from the position of P. This route also avoids the remembered points and robots at
    rest. If there is no such route, the block keeps the old route and tries again after
    the same time.

    The discrete state is ``PlannerState``. A new route appears at the output one
    control period after the inputs that cause it. There is no feedthrough.

    Args:
        parameters: Goal, clearance, and whether the block plans new routes.
        known: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in the world frame W, m and rad.
        initial_pose: (x, y, theta) of the robot at the start in W, m and rad.
        robot: Width of the body, and position of P on it.
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
        Port("route_clearance", 1, "m"),
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
    least_m = 0.5 * robot.width_m + _BESIDE_M
    try:
        route = plan_route(
            start,
            goal,
            rectangles,
            clearance_m=parameters.clearance_m,
            least_m=least_m,
        )
    except InputError as error:
        field = "start.position_m" if error.field == "start" else error.field
        group = "" if error.field == "start" else "route."
        raise InputError(f"{group}{field}", error.message) from error
    grid = free_grid([start, goal], rectangles)
    clearances = np.full(ROUTE_POINTS, np.inf)
    no_discs = sorted_discs(np.empty((0, 3)))
    fill_clearances(clearances, route.points, rectangles, no_discs)
    numbers = PlannerNumbers(
        grid,
        rectangles,
        goal,
        clearances_to_try(parameters.clearance_m, least_m),
        turning_distance_m(robot) + CELL_M,
        parameters.replan,
        robot.control_point_m,
        tick_s,
    )
    progress: NDArray[np.float64] = np.array([0.0, 0.0, 0.0, clearances[0]])
    seen = make_seen_points(grid)
    state = PlannerState(route.numbers, clearances, progress, seen)
    return Step(planner_step, numbers, state, _publish_route)
