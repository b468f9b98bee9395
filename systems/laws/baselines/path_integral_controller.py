"""Baseline: model predictive path integral control on a global plan, as in Nav2."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import (
    MapController,
    half_size,
    occupied_around,
)
from systems.laws.parameters import AttractionParameters
from systems.laws.path_integral import PathIntegralParameters
from systems.planning.body_contact import in_body_axes, time_to_contact
from systems.planning.following import (
    APPROACH_GAIN,
    SOURCE_SHARE,
    SPEED_LIMITS,
    FollowNumbers,
)
from systems.planning.route_approach import (
    Approach,
    RouteNumbers,
    RouteState,
    approach_on_route,
    route_numbers,
    route_state,
)
from systems.planning.turning import turn_rate, wrapped
from systems.safety.free_space import FreeSpace, cell_is_free
from systems.safety.parameters import GuardParameters

#: Half side of the window of the distance field, m. A sequence stays within it.
_WINDOW_M = 2.5
# ``_ROUNDS``: number of plans after which the random numbers repeat.
# ``_SAMPLES``: number of sequences of motions that each plan tries.
# ``_STEPS``: number of steps of a sequence.
_ROUNDS, _SAMPLES, _STEPS = 16, 500, 25
#: Duration of a step of a sequence, s. This time is also the time between two plans.
_STEP_S = 0.1
#: Standard deviation of the sampled speeds, m/s (Nav2: 0.2).
_SPEED_SPREAD_M_S = 0.2
#: Weight gamma of the cost of a deviation from the last plan (Nav2: 0.015). This cost
#: is a sum over the steps of a sequence. All other costs are means over the steps.
_CONTROL_GAIN = 0.015
#: Cost per meter of distance from the wanted position (Nav2's goal critic: 5).
_GOAL_GAIN = 5.0
#: Cost of driving backward, s/m (Nav2's prefer forward critic: 5).
_FORWARD_GAIN = 0.81
#: Cost of a position nearer to an obstacle than the clearance.
_COLLISION_COST = 1_000.0
#: If the local goal is farther off the heading than this angle, rad, the robot first
#: turns on the spot, as with the rotation shim controller of Nav2 (there: 0.785).
_TURN_FIRST_RAD = 0.785
#: Greatest distance between two points of the outline of the body, m.
_APART_M = 0.1
#: Length of a step to a diagonal neighbor, in cells.
_ACROSS = math.sqrt(2.0)


class RollNumbers(NamedTuple):
    """Constants of the sequences and costs; see ``PathIntegralParameters``."""

    turn_spread_rad_s: float
    temperature: float
    angle_gain: float
    obstacle_gain: float
    inflation_m: float
    outline: NDArray[np.float64]
    """(n, 2) points of the outline of the body, in the body frame B, m."""
    clearance_m: float
    """Distance that these points keep from occupied cells, m."""
    control_point_m: float


class PathIntegralNumbers(NamedTuple):
    """Constants of the step of ``PathIntegralController``."""

    roll: RollNumbers
    route: RouteNumbers
    wide: tuple[float, float]
    """Half of the body's length and width, including the clearance, m."""
    period_ticks: int
    noise: NDArray[np.float64]
    """(rounds, samples, steps, 2) normal random numbers of standard deviation 1."""


class PathIntegralState(NamedTuple):
    """The state of ``PathIntegralController``."""

    plan: NDArray[np.float64]
    """(steps, 2) speed, m/s, and yaw rate, rad/s, of each step."""
    route: RouteState


@njit(cache=True)
def distance_field(
    places: Any, x: float, y: float, half: float, cell: float
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the distance from each cell of a window to the nearest occupied cell.

    The window is a square. The function sweeps over the window twice, once forward and
    once backward (a chamfer distance transform). The distance of a cell is the least
    sum of the distance of a visited neighbor and the step from this neighbor. The step
    is one cell side, or sqrt(2) cell sides from a diagonal neighbor.

    Args:
        places: (n, 3) occupied cells: x and y of the middle in the world frame W, m,
            and the distance that the cell itself gets, m: 0, or more if the body may
            come nearer to this cell than to others.
        x: Center of the window, x in W, m.
        y: Center of the window, y in W, m.
        half: Half of the side of the window, m.
        cell: Side of a cell, m.

    Returns:
        (m, m) distances, m. They are at most 8 % longer than straight lines. If there
        are no occupied cells, all distances are 1e6.
    """
    size = 2 * math.ceil(half / cell) + 1
    field = np.full((size, size), 1e6)
    for n in range(len(places)):
        i = math.floor((places[n, 0] - x) / cell + 0.5 * size)
        j = math.floor((places[n, 1] - y) / cell + 0.5 * size)
        if 0 <= i < size and 0 <= j < size:
            field[i, j] = min(field[i, j], places[n, 2])
    for sign in (1, -1):
        order = range(size) if sign > 0 else range(size - 1, -1, -1)
        for i in order:
            for q in range(size):
                j = q if sign > 0 else size - 1 - q
                best = field[i, j]
                if 0 <= j - sign < size:
                    best = min(best, field[i, j - sign] + cell)
                if 0 <= i - sign < size:
                    best = min(best, field[i - sign, j] + cell)
                    for k in (j - 1, j + 1):
                        if 0 <= k < size:
                            best = min(best, field[i - sign, k] + _ACROSS * cell)
                field[i, j] = best
    return field


@njit(cache=True)
def price_unseen(
    field: Any, space: FreeSpace, x: float, y: float, numbers: RollNumbers
) -> None:  # pragma: no cover  (compiled)
    """Lets cells that no sensor has seen cost as much as cells near an obstacle.

    The function limits the distance of these cells to the clearance and the inflation.
    The body may enter them, but prefers floor that was seen free.

    Args:
        field: (m, m) result of ``distance_field`` around (x, y), m; changed in place.
        space: Map of free space.
        x: Center of the window, x in the world frame W, m.
        y: Center of the window, y in W, m.
        numbers: Clearance and inflation.
    """
    cell, size = space.cell_m, len(field)
    near = numbers.clearance_m + numbers.inflation_m
    for i in range(size):
        a = math.floor(x / cell + i + 0.5 - 0.5 * size)
        for j in range(size):
            b = math.floor(y / cell + j + 0.5 - 0.5 * size)
            if not cell_is_free(space, a, b, 0.0):
                field[i, j] = min(field[i, j], near)


@njit(cache=True)
def roll_out(
    controls: Any,
    noise: Any,
    pose: Any,
    goal: Any,
    field: Any,
    cell: float,
    numbers: RollNumbers,
) -> None:  # pragma: no cover  (compiled)
    """Replaces a sequence of motions by the weighted mean of noisy copies (MPPI).

    MPPI is model predictive path integral control. The function adds noise to the
    sequence, computes the cost of each noisy copy, and weights the copy with
    exp(-cost/temperature).

    Args:
        controls: (steps, 2) speed, m/s, and yaw rate, rad/s. The function changes the
            array in place.
        noise: (samples, steps, 2) normal random numbers of standard deviation 1.
        pose: Pose (x, y, theta) of the axle in the world frame W, m and rad.
        goal: Position (x, y), m, and velocity (vx, vy), m/s, in W of the moving goal of
            the control point P.
        field: (m, m) result of ``distance_field`` around the axle, m.
        cell: Side of a cell of the field, m.
        numbers: Constants of the sequences and costs.
    """
    samples, steps = len(noise), len(controls)
    costs, tried = np.empty(samples), np.empty((samples, steps, 2))
    for n in range(samples):
        costs[n] = _cost(controls, noise[n], tried[n], pose, goal, field, cell, numbers)
    # Weights relative to the least cost do not underflow.
    least, total = np.min(costs), 0.0
    mean = np.zeros((steps, 2))
    for n in range(samples):
        weight = math.exp(-(costs[n] - least) / numbers.temperature)
        total += weight
        for k in range(steps):
            mean[k, 0] += weight * tried[n, k, 0]
            mean[k, 1] += weight * tried[n, k, 1]
    for k in range(steps):
        controls[k, 0], controls[k, 1] = mean[k, 0] / total, mean[k, 1] / total


@njit(cache=True)
def _cost(
    controls: Any,
    noise: Any,
    tried: Any,
    pose: Any,
    goal: Any,
    field: Any,
    cell: float,
    numbers: RollNumbers,
) -> float:  # pragma: no cover  (compiled)
    """Computes the cost of one noisy sequence of motions.

    The function writes the noisy sequence to ``tried`` and integrates the pose. The
    cost of a step grows with backward speed, nearness to occupied cells, distance from
    the goal, and the angle to the goal. The deviation from the plan also has a cost.
    """
    least, most, turn = SPEED_LIMITS
    spread, turn_spread = _SPEED_SPREAD_M_S, numbers.turn_spread_rad_s
    steps, dt, half = len(controls), _STEP_S, 0.5 * len(field)
    x, y, theta, total = 0.0, 0.0, pose[2], 0.0
    for k in range(steps):
        v = controls[k, 0] + spread * noise[k, 0]
        w = controls[k, 1] + turn_spread * noise[k, 1]
        v, w = min(max(v, least), most), min(max(w, -turn), turn)
        tried[k, 0], tried[k, 1] = v, w
        # Control cost of the deviation from the plan.
        off = controls[k, 0] * (v - controls[k, 0]) / spread**2
        off += controls[k, 1] * (w - controls[k, 1]) / turn_spread**2
        total += _CONTROL_GAIN * off
        # Motion along the mean heading of the step.
        theta += 0.5 * w * dt
        c, s = math.cos(theta), math.sin(theta)
        x, y, theta = x + v * dt * c, y + v * dt * s, theta + 0.5 * w * dt
        # Clearance of the outline. Cells outside the window count as free.
        nearest = np.inf
        for n in range(len(numbers.outline)):
            along, aside = numbers.outline[n, 0], numbers.outline[n, 1]
            i = math.floor((x + along * c - aside * s) / cell + half)
            j = math.floor((y + along * s + aside * c) / cell + half)
            if 0 <= i < len(field) and 0 <= j < len(field):
                nearest = min(nearest, field[i, j] - numbers.clearance_m)
        cost = max(-v, 0.0) * _FORWARD_GAIN
        if nearest < 0.0:
            cost += _COLLISION_COST
        inflated = math.exp(-max(nearest, 0.0) / numbers.inflation_m)
        cost += numbers.obstacle_gain * inflated
        # Distance and direction from P to the goal at this time.
        time, ahead = (k + 1) * dt, numbers.control_point_m
        gx = goal[0] + goal[2] * time - pose[0] - x - ahead * c
        gy = goal[1] + goal[3] * time - pose[1] - y - ahead * s
        distance = math.hypot(gx, gy)
        cost += _GOAL_GAIN * distance
        if distance > ahead:
            off_goal = abs(wrapped(math.atan2(gy, gx) - theta))
            cost += numbers.angle_gain * off_goal
        total += cost / steps
    return total


@register_jitable
def path_integral_step(
    tick: int,
    state: PathIntegralState,
    inputs: Any,
    outputs: Any,
    numbers: PathIntegralNumbers,
) -> None:
    """Computes speed and yaw rate for one control period.

    Every ``period_ticks`` control periods, the step first makes a new plan. The output
    is always the first motion of the plan.
    """
    pose, plan, space, twist = inputs[3], state.plan, inputs[4], outputs[0]
    steps = len(plan)
    if tick % numbers.period_ticks == 0:
        controls = np.zeros((steps, 2))
        approach = approach_on_route(tick, inputs, state.route, numbers.route)
        at = pose[0], pose[1], pose[2]
        others, followed = occupied_around(inputs, _WINDOW_M)
        # The follow distance is the clearance from the target.
        others[:, 2], followed[:, 2] = 0.0, numbers.roll.clearance_m
        places = np.concatenate((others, followed))
        turn = _turn_first(places, at, approach, numbers.wide)
        if turn != 0.0:
            controls[0, 1] = turn
        elif approach.speed_m_s != 0.0:
            # Start from the remaining steps of the last plan, and repeat its last step.
            for k in range(steps):
                last = min(k + 1, steps - 1)
                controls[k, 0], controls[k, 1] = plan[last, 0], plan[last, 1]
            goal = _goal(at, approach, numbers.route.follow)
            cell = space.cell_m
            field = distance_field(places, at[0], at[1], _WINDOW_M, cell)
            price_unseen(field, space, at[0], at[1], numbers.roll)
            noise = numbers.noise[tick // numbers.period_ticks % _ROUNDS]
            roll_out(controls, noise, at, goal, field, cell, numbers.roll)
        for k in range(steps):
            plan[k, 0], plan[k, 1] = controls[k, 0], controls[k, 1]
    twist[0], twist[1] = plan[0, 0], plan[0, 1]


@njit(cache=True)
def _turn_first(
    places: Any, pose: Any, approach: Approach, wide: tuple[float, float]
) -> float:  # pragma: no cover  (compiled)
    """Returns the yaw rate of a turn on the spot, rad/s, or 0 if MPPI chooses a motion.

    The robot turns if it has to drive on, if its heading is far off the local goal, and
    if it can turn to the local goal without contact.
    """
    bearing = math.atan2(approach.y - pose[1], approach.x - pose[0])
    error = wrapped(bearing - pose[2])
    if approach.speed_m_s <= 0.0 or abs(error) < _TURN_FIRST_RAD:
        return 0.0
    around, _ = in_body_axes(places, pose, wide)
    turn = math.copysign(1.0, error)
    if time_to_contact(around, (0.0, turn), wide) < abs(error):
        return 0.0
    return turn_rate(error)


@register_jitable
def _goal(pose, approach, follow):  # type: ignore[no-untyped-def]
    """Computes the moving goal that the control point P should reach.

    The goal lies in the direction of the local goal on the route. Its distance and
    velocity make P approach with the wanted speed.

    Returns:
        Position (x, y), m, and velocity (vx, vy), m/s, of the goal in the world frame
        W.
    """
    ahead = follow.control_point_m
    px, py = pose[0] + ahead * math.cos(pose[2]), pose[1] + ahead * math.sin(pose[2])
    dx, dy = approach.x - px, approach.y - py
    far = max(math.hypot(dx, dy), 1e-9)
    ux, uy = dx / far, dy / far
    goes, along = approach.speed_m_s, approach.along_m_s
    moves = min(SOURCE_SHARE * along, goes) if goes > 0.0 else 0.0
    rest = (goes - moves) / APPROACH_GAIN
    return px + rest * ux, py + rest * uy, moves * ux, moves * uy


class PathIntegralController(MapController):
    """Tries many random sequences of motions and drives their weighted mean (MPPI).

    Ten times per second, the block makes a new plan in three stages:

    1. It places a goal in the direction of its route to the target. The goal moves with
       at most 80 % of the speed of the target. If the direction is far off the heading,
       the robot first turns on the spot, as with the rotation shim of Nav2.
    2. It draws 500 random sequences of 2.5 s around the previous plan, and computes the
       cost of each. The cost depends on the distance and direction of the goal, on
       driving backward, on occupied cells near the outline of the body, and on unseen
       floor under it.
    3. The new plan is the mean of the sequences, weighted with exp(-cost/temperature).

    A robot that has arrived stops. The state contains the plan and the memory of the
    route planner. There is no latency.

    Args:
        robot: Size of the body, and position of the control point P ahead of the axle.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        gains: ``PathIntegralParameters``.
        guard: Parameters of the map.
        seed: Seed of the random sequences.
        tick_s: Control period, s.

    Reference: Williams et al., Information theoretic model predictive control, IEEE
    Trans. on Robotics 34 (6), 2018. The cost terms are those of the MPPI controller in
    Nav2, which calls them critics.
    """

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        gains: PathIntegralParameters = PathIntegralParameters(),
        guard: GuardParameters = GuardParameters(),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("path_integral_controller")
        length, width = half_size(robot)
        follow = FollowNumbers(attraction.follow_distance_m, robot.control_point_m)
        numbers = PathIntegralNumbers(
            _roll_numbers(gains, robot),
            route_numbers(follow, width + gains.clearance_m, tick_s),
            (length + gains.clearance_m, width + gains.clearance_m),
            max(round(_STEP_S / tick_s), 1),
            _noise(seed),
        )
        route = route_state(guard.cells_for(body_radius(robot)))
        state = PathIntegralState(np.zeros((_STEPS, 2)), route)
        self.declare(Step(path_integral_step, numbers, state), tick_s=tick_s)

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step with its own state and with the noise of the run."""
        step = super().step_for(run)
        noise = _noise(run.seed_of("controller"))
        return step._replace(numbers=step.numbers._replace(noise=noise))


def _roll_numbers(gains: PathIntegralParameters, robot: RobotParameters) -> RollNumbers:
    return RollNumbers(
        gains.turn_spread_rad_s,
        gains.temperature,
        gains.angle_gain,
        gains.obstacle_gain,
        gains.inflation_m,
        outline_points(*half_size(robot)),
        gains.clearance_m,
        robot.control_point_m,
    )


def outline_points(half_length: float, half_width: float) -> NDArray[np.float64]:
    """Places points on the outline of a rectangle, at most ``_APART_M`` apart.

    Args:
        half_length: Half of the extent along x, m.
        half_width: Half of the extent along y, m.

    Returns:
        (n, 2) points relative to the middle of the rectangle, m. The corners are among
        them.
    """
    half = half_length, half_width
    along, aside = (
        np.linspace(-side, side, math.ceil(2.0 * side / _APART_M) + 1) for side in half
    )
    points = [(x, y) for x in along for y in (-half_width, half_width)]
    points += [(x, y) for x in (-half_length, half_length) for y in aside[1:-1]]
    return np.array(points)


def _noise(seed: int) -> NDArray[np.float64]:
    shape = _ROUNDS, _SAMPLES, _STEPS, 2
    return np.random.default_rng(seed).standard_normal(shape)
