"""The route to the goal: planned from the map, and anew where the robot stalls."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.compiling import njit
from systems.framework.finite import read_arrays
from systems.framework.input_error import InputError
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.occupancy_grid import (
    OccupancyGrid,
    arena_about,
    block_discs,
    block_rectangles,
    make_occupancy_grid,
)
from systems.routes.parameters import RouteParameters
from systems.routes.route import ROUTE_SIZE, fill_route, find_route, plan_route
from systems.routes.seen_points import (
    SeenPoints,
    discs_to_avoid,
    make_seen_points,
    remember_objects,
)
from systems.world.geometry import control_point

#: Places in the state after the route.
REPLANS, SINCE_S, FROM_M = range(ROUTE_SIZE, ROUTE_SIZE + 3)
#: Sizes of its groups: the route, how often it was planned anew, and since when, s, and
#: from where along the route, m, P has been making no way.
_SIZES = ROUTE_SIZE, 1, 2


class PlannerNumbers(NamedTuple):
    """What the step of ``GlobalPlanner`` depends on."""

    grid: OccupancyGrid
    """With the cells blocked that are too near to known obstacles."""
    rectangles: NDArray[np.float64]
    """(k, 5) known obstacles in W."""
    seen: SeenPoints
    """Changed."""
    goal: tuple[float, float]
    clearance_m: float
    stall_m: float
    stalled_s: float
    """Infinite: it never plans anew."""
    arrived_m: float
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    tick_s: float


@njit(cache=True)
def _find_anew(
    numbers: PlannerNumbers, objects: Any, p_WP: tuple[float, float]
) -> Any:  # pragma: no cover  (compiled)
    """Points of a route from P past all that is known, has been seen or rests."""
    grid, clearance = numbers.grid, numbers.clearance_m
    discs = discs_to_avoid(numbers.seen, objects, p_WP)
    now = OccupancyGrid(grid.blocked.copy(), grid.low, grid.cell_m)
    block_discs(now, discs, clearance)
    return find_route(now, p_WP, numbers.goal, numbers.rectangles, discs, clearance)


def planner_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: PlannerNumbers
) -> None:
    """The route for the next tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: (ROUTE_SIZE + 3,) array: the route, and ``REPLANS``, ``SINCE_S``,
            ``FROM_M``.
        inputs: As the input ports.
        outputs: Left as they are: they are state.
        numbers: ``PlannerNumbers``.
    """
    if numbers.stalled_s == math.inf:
        return
    objects, pose, progress = inputs
    x, y = control_point((pose[0], pose[1], pose[2]), numbers.control_point_m)
    remember_objects(numbers.seen, numbers.grid, numbers.rectangles, objects, (x, y))
    time = tick * numbers.tick_s
    away = math.hypot(numbers.goal[0] - x, numbers.goal[1] - y)
    if progress[1] >= state[FROM_M] + numbers.stall_m or away <= numbers.arrived_m:
        state[FROM_M], state[SINCE_S] = progress[1], time
    # Half a tick is more than the rounding of times.
    if time - state[SINCE_S] < numbers.stalled_s - 0.5 * numbers.tick_s:
        return
    state[SINCE_S], state[FROM_M] = time, progress[1]
    points = _find_anew(numbers, objects, (x, y))
    if len(points) > 0:
        fill_route(state, points)
        state[REPLANS] += 1.0
        state[FROM_M] = 0.0


def _publish_route(state: Any, outputs: Any, numbers: PlannerNumbers) -> None:
    """The outputs of ``planner_step``'s state."""
    route, replans = outputs
    for k in range(len(route)):
        route[k] = state[k]
    replans[0] = state[REPLANS]


class GlobalPlanner(LeafSystem):
    """Gives the route to the goal, and plans it anew where the robot stalls.

    .. pydrake_system::

        name: GlobalPlanner
        input_ports:
        - objects_W [number, m and m/s in eight slots, see systems.ranging.objects]
        - pose_WB_estimated [m, m, rad]
        - route_progress [m, m]
        output_ports:
        - route [number of points, then in m their spacing, and x and y of each]
        - replans [number of routes that were planned anew]

    The first route leads from where P starts past the known obstacles (``plan_route``).
    The nearest points of objects that are not known to move are remembered, one a cell
    of the grid. Where P comes less than ``stall_m`` farther along the route in
    ``stalled_s``, and is farther from the goal than ``arrived_m``, a route is planned
    from where P is, past these points and robots at rest, too. If there is none, the
    old one stays, and it tries again after as long.

    Discrete state, every tick: route and number of replans, which are the outputs, and
    since when and from where P makes no way; abstract state: ``SeenPoints``. An update
    at t reads the inputs at t, and its route is there from t on: for other updates at
    the next tick. Outputs are state; no feedthrough.

    Args:
        parameters: ``RouteParameters``.
        known: (k, 5) known obstacles in W, see ``systems.world.geometry``.
        initial_pose: (x, y, theta) of the robot at the start, m and rad.
        robot: Place of P.
        tick_s: Period of the robot, s.

    Raises:
        InputError: There is no route.

    Reference: Engelbrecht, Steyn and Djouani (2021), sec. 2: A* plans the path. That it
    plans anew is ours.
    """

    FACTS = BlockFacts("global_planner", "control", columns={"replans": ("replans",)})

    def __init__(
        self,
        *,
        parameters: RouteParameters | None = None,
        known: ArrayLike = (),
        initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        robot: RobotParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self._parameters = parameters or RouteParameters()
        self._robot, self._tick_s = robot or RobotParameters(), tick_s
        self._known: NDArray[np.float64] = np.array(known, dtype=float).reshape(-1, 5)
        self.set_name("global_planner")
        goal = self._parameters.goal_m
        self.step = self._make_step(initial_pose, goal, self._known)
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in (
                ("objects_W", OBJECT_SLOTS * OBJECT_SIZE),
                ("pose_WB_estimated", 3),
                ("route_progress", 2),
            )
        ]
        state: NDArray[np.float64] = np.array(self.step.state)
        groups: Any = np.split(state, np.cumsum(_SIZES)[:-1])
        route, replans, _ = [self.DeclareDiscreteState(values) for values in groups]
        self.DeclareStateOutputPort("route", route)
        self.DeclareStateOutputPort("replans", replans)
        self.DeclareAbstractState(Value(self.step.numbers.seen.copy()))
        if self._parameters.replan:
            # Before the discrete update of the same tick, which finds the memory so.
            self.DeclarePeriodicUnrestrictedUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self._remember
            )
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self._update
            )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop.

        Start, goal and map are those of the run.
        """
        goal = run.goal or self._parameters.goal_m
        return self._make_step(run.initial_pose, goal, np.reshape(run.mapped, (-1, 5)))

    def _make_step(
        self,
        initial_pose: tuple[float, float, float],
        goal: tuple[float, float],
        known: NDArray[np.float64],
    ) -> Step:
        own, epsilon = self._parameters, self._robot.control_point_m
        start = control_point(initial_pose, epsilon)
        try:
            route = plan_route(
                start,
                goal,
                known,
                clearance_m=own.clearance_m,
                cell_m=own.cell_m,
                arena_margin_m=own.arena_margin_m,
            )
        except InputError as error:
            field = "start.position_m" if error.field == "start" else error.field
            group = "" if error.field == "start" else "route."
            raise InputError(f"{group}{field}", error.message) from error
        arena = arena_about([start, goal], known, own.arena_margin_m)
        grid = make_occupancy_grid(arena, own.cell_m, own.clearance_m)
        block_rectangles(grid, known, own.clearance_m)
        numbers = PlannerNumbers(
            grid,
            known,
            make_seen_points(grid),
            goal,
            own.clearance_m,
            own.stall_m,
            own.stalled_s if own.replan else math.inf,
            own.arrived_m,
            epsilon,
            self._tick_s,
        )
        state = [*route.numbers.tolist(), 0.0, 0.0, 0.0]
        return Step(planner_step, numbers, state, _publish_route)

    def _remember(self, context: Any, state: Any) -> None:
        objects, pose, _ = read_arrays(context, self._inputs)
        seen: Any = context.get_abstract_state(0).get_value().copy()
        p_WP = control_point(pose.tolist(), self._robot.control_point_m)
        numbers = self.step.numbers
        remember_objects(seen, numbers.grid, numbers.rectangles, objects, p_WP)
        state.get_mutable_abstract_state(0).set_value(seen)

    def _update(self, context: Any, discrete_state: Any) -> None:
        inputs = read_arrays(context, self._inputs)
        groups = range(len(_SIZES))
        state = np.concatenate([context.get_discrete_state(k).value() for k in groups])
        seen: Any = context.get_abstract_state(0).get_value().copy()
        tick = round(context.get_time() / self._tick_s)
        numbers = self.step.numbers._replace(seen=seen)
        planner_step(tick, state, inputs, (), numbers)
        for k, values in enumerate(np.split(state, np.cumsum(_SIZES)[:-1])):
            discrete_state.set_value(k, values)
