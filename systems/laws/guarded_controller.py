"""The law that looks before it moves: plans through what is known, and is guarded."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import read_arrays
from systems.framework.parameters import Parameters
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.laws.impedance import AttractionParameters
from systems.laws.law import Equation, Law
from systems.planning.way import OCCUPIED, UNKNOWN, Way, find_way, make_way
from systems.safety.free_space import FreeSpace, edge_cells, make_free_space
from systems.safety.free_space_map import FreeSpaceParameters, body_radius

__all__ = ["GUARDED", "GuardedController", "GuardedParameters"]


class GuardedParameters(Parameters):
    """How the guarded law drives and looks."""

    top_speed_m_s: float = 0.62
    back_speed_m_s: float = 0.15
    approach_gain: float = 1.2
    turn_gain: float = 3.0
    top_turn_rad_s: float = 2.0
    carrot_m: float = 1.5
    weave_rad: float = 0.3
    weave_period_s: float = 2.4
    replan_s: float = 0.5
    blocked_s: float = 0.3
    give_up_s: float = 5.5


#: Places in the memory.
(
    TICK, V, OMEGA, MODE, SINCE, BLOCKED, PLANNED, CARROT_X, CARROT_Y,
    LEFT, LOOK, AHEAD, STARTED, MOVED_X, MOVED_Y, MOVED_S, MARK, BACK,
    BLOCK_X, BLOCK_Y,
) = range(20)
#: What it does.
WAITING, DRIVING, LOOKING, BACKING = range(4)


class GuardedNumbers(NamedTuple):
    """What the step of ``GuardedController`` depends on."""

    memory: NDArray[np.float64]
    way: Way
    space: FreeSpace
    own: GuardedParameters
    follow_distance_m: float
    control_point_m: float
    radius: float
    tick_s: float


@njit(cache=True)
def _wrap(angle: float) -> float:  # pragma: no cover  (compiled)
    return (angle + math.pi) % math.tau - math.pi


@njit(cache=True)
def carrot(
    way: Way, space: FreeSpace, x: float, y: float, farthest: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Farthest point of the way that can be driven to straight."""
    points, size, cell = int(way.facts[0, 0]), way.price.shape[0], 2.0 * space.cell_m
    low_i, low_j = int(way.facts[0, 3]), int(way.facts[0, 4])
    best_x, best_y, begin = x, y, -1.0
    for k in range(points):
        px, py = way.path[k, 0], way.path[k, 1]
        i, j = math.floor(px / cell) - low_i, math.floor(py / cell) - low_j
        distance = math.hypot(px - x, py - y)
        if k == 0:
            begin = way.cost[i, j]
        if distance > farthest and k > 1:
            break
        steps = max(1, math.ceil(2.0 * distance / cell))
        price = 0.0
        for step in range(1, steps + 1):
            a = x + (px - x) * (step - 0.5) / steps
            b = y + (py - y) * (step - 0.5) / steps
            i2, j2 = math.floor(a / cell) - low_i, math.floor(b / cell) - low_j
            i2, j2 = min(max(i2, 0), size - 1), min(max(j2, 0), size - 1)
            price += way.price[i2, j2] / steps
        straight = 10.0 * price * distance / cell
        if straight <= 1.1 * (begin - way.cost[i, j]) or distance < 0.4:
            best_x, best_y = px, py
    return best_x, best_y


def guarded_step(tick, state, inputs, outputs, numbers):  # type: ignore[no-untyped-def]
    """The twist of one tick; see ``systems.framework.step_block.Step``."""
    target, velocity, valid, pose, report, _ = inputs
    twist, plan = outputs
    guarded_twist(
        tick, target, velocity, valid[0], pose, report, numbers.memory, numbers.way,
        numbers.space, numbers.own, numbers.follow_distance_m, numbers.control_point_m,
        numbers.radius, numbers.tick_s,
    )
    m = numbers.memory
    twist[0], twist[1] = m[0, V], m[0, OMEGA]
    plan[0], plan[1], plan[2], plan[3] = m[0, MODE], m[0, CARROT_X], m[0, CARROT_Y], m[0, LEFT]


@njit(cache=True)
def mark(way, m, time):
    k = int(m[0, MARK]) % len(way.marks)
    way.marks[k, 0], way.marks[k, 1] = m[0, BLOCK_X], m[0, BLOCK_Y]
    way.marks[k, 2] = time + 10.0
    m[0, MARK] += 1.0


@njit(cache=True)
def blocking(space, x, y, theta, radius):
    """Middle of the cell that is not free and nearest to where the robot would go."""
    corners = np.empty((1000, 2))
    count = edge_cells(space, x, y, radius + 0.3, space.facts[0, 2], corners)
    ax, ay = x + 0.1 * math.cos(theta), y + 0.1 * math.sin(theta)
    best, bx, by = np.inf, ax, ay
    half = 0.5 * space.cell_m
    for k in range(min(count, 1000)):
        cx, cy = corners[k, 0] + half, corners[k, 1] + half
        d = math.hypot(cx - ax, cy - ay)
        if d < best:
            best, bx, by = d, cx, cy
    return bx, by


@njit
def guarded_twist(
    tick, target, velocity, valid, pose, report, m, way, space, own, follow, offset,
    radius, tick_s,
):
    time = tick * tick_s
    x, y, theta = pose[0], pose[1], pose[2]
    if m[0, TICK] < 0.0:
        m[0, SINCE], m[0, BLOCKED], m[0, PLANNED], m[0, STARTED] = time, time, -9.0, time
        m[0, MOVED_X], m[0, MOVED_Y], m[0, MOVED_S] = x, y, time
        m[0, CARROT_X], m[0, CARROT_Y] = x + math.cos(theta), y + math.sin(theta)
    m[0, TICK] = tick
    if valid < 0.5:
        m[0, V], m[0, OMEGA], m[0, MODE] = 0.0, 0.0, WAITING
        m[0, STARTED] = time if m[0, STARTED] >= 0.0 else m[0, STARTED]
        m[0, BLOCKED] = time
        return
    px, py = x + offset * math.cos(theta), y + offset * math.sin(theta)
    distance = math.hypot(target[0] - px, target[1] - py)
    if time - m[0, PLANNED] >= own.replan_s - 1e-9:
        goal = target[0], target[1]
        find_way(way, space, (x, y), goal, time, radius, 0.85)
        m[0, PLANNED], m[0, LEFT] = time, way.facts[0, 1]
    cx, cy = carrot(way, space, x, y, own.carrot_m)
    left = max(distance, m[0, LEFT] - offset)
    if way.facts[0, 2] < 14.0 and m[0, LEFT] < 1.15 * math.hypot(target[0] - x, target[1] - y):
        left = distance
        if distance < follow + 0.6:
            cx, cy = target[0], target[1]
    m[0, CARROT_X], m[0, CARROT_Y] = cx, cy
    bearing = math.atan2(cy - y, cx - x)
    error = _wrap(bearing - theta)
    source_speed = math.hypot(velocity[0], velocity[1])
    along = velocity[0] * math.cos(bearing) + velocity[1] * math.sin(bearing)
    wanted = own.approach_gain * (left - follow) + 0.8 * along
    wanted = min(max(wanted, -own.back_speed_m_s), own.top_speed_m_s)
    near = abs(left - follow) < 0.2 and source_speed < 0.1
    # Progress.
    if math.hypot(x - m[0, MOVED_X], y - m[0, MOVED_Y]) > 0.15 or near:
        m[0, MOVED_X], m[0, MOVED_Y], m[0, MOVED_S] = x, y, time
    if report[0] < 1.5 or near or wanted < 0.05:
        m[0, BLOCKED] = time
    mode = m[0, MODE]
    if mode == WAITING or mode == DRIVING:
        mode = DRIVING
        first = m[0, STARTED] >= 0.0
        if first or time - m[0, BLOCKED] > own.blocked_s:
            mode = LOOKING
            m[0, SINCE], m[0, LOOK], m[0, AHEAD] = time, 0.0, bearing
            m[0, BLOCK_X], m[0, BLOCK_Y] = np.inf, np.inf
            if first:
                m[0, STARTED] = -1.0
            else:
                bx, by = blocking(space, x, y, theta, radius)
                m[0, BLOCK_X], m[0, BLOCK_Y] = bx, by
                m[0, AHEAD] = math.atan2(by - py, bx - px)
    v, omega = 0.0, 0.0
    if mode == LOOKING:
        # Looks past both sides of what blocks the way.
        wide = 0.4 if m[0, BLOCK_X] == np.inf else 0.6
        side = 1.0 if m[0, LOOK] == 0.0 else -1.0
        to = _wrap(m[0, AHEAD] + side * wide - theta)
        if m[0, LOOK] == 0.0 and abs(to) > abs(_wrap(m[0, AHEAD] - wide - theta)):
            # The nearer side first.
            m[0, LOOK] = 2.0
        if m[0, LOOK] >= 2.0:
            side = -1.0 if m[0, LOOK] == 2.0 else 1.0
            to = _wrap(m[0, AHEAD] + side * wide - theta)
        omega = min(max(4.0 * to, -own.top_turn_rad_s), own.top_turn_rad_s)
        if abs(to) < 0.1:
            m[0, LOOK] += 1.0
            if m[0, LOOK] == 2.0 or m[0, LOOK] == 4.0:
                mode, m[0, BLOCKED], m[0, PLANNED] = DRIVING, time, -9.0
                if m[0, BLOCK_X] < np.inf:
                    mark(way, m, time)
        if m[0, BLOCK_X] < np.inf and report[1] > 0.03:
            mode, m[0, BLOCKED], m[0, PLANNED] = DRIVING, time, -9.0
    if mode == DRIVING:
        if time - m[0, MOVED_S] > own.give_up_s:
            m[0, BLOCK_X] = x + (radius + 0.1) * math.cos(bearing)
            m[0, BLOCK_Y] = y + (radius + 0.1) * math.sin(bearing)
            mark(way, m, time)
            m[0, PLANNED], m[0, MOVED_S] = -9.0, time
            mode, m[0, BACK] = BACKING, time
        weave = 0.0
        if not near:
            weave = own.weave_rad * math.sin(math.tau * time / own.weave_period_s)
        omega = own.turn_gain * _wrap(error + weave)
        omega = min(max(omega, -own.top_turn_rad_s), own.top_turn_rad_s)
        if wanted > 0.0:
            v = wanted * max(0.0, math.cos(error)) if abs(error) < 1.0 else 0.0
        else:
            v = wanted
            omega = own.turn_gain * error
        if near and abs(error) < 0.1:
            omega = own.turn_gain * error * 0.5
    if mode == BACKING:
        v = -own.back_speed_m_s
        if time - m[0, BACK] > 2.0:
            mode, m[0, MOVED_S], m[0, BLOCKED] = DRIVING, time, time
    m[0, V], m[0, OMEGA], m[0, MODE] = v, omega, mode


class GuardedController(LeafSystem):
    """Plans a way to the target through seen and unknown space, and looks ahead.

    .. pydrake_system::

        name: GuardedController
        input_ports:
        - p_WS_estimated [m]
        - v_WS_estimated [m/s]
        - target_valid [0 or 1]
        - pose_WB_estimated [m, m, rad]
        - guard_report [number of what was done, m, m, m]
        - free_space [FreeSpace]
        output_ports:
        - twist_B [m/s, rad/s]
        - plan [number of what it does, m, m, m]
    """

    FACTS = BlockFacts(
        "controller",
        "control",
        columns={
            "twist_B": ("wanted_speed", "wanted_turn"),
            "plan": ("plan_mode", "carrot_x", "carrot_y", "way_left"),
        },
    )

    def __init__(
        self, *, robot=None, attraction=None, repulsion=None, sensors=None,
        known=None, tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        robot = robot or RobotParameters()
        known = known or FreeSpaceParameters()
        own = repulsion.guarded if repulsion is not None else GuardedParameters()
        self._tick_s = tick_s
        self.set_name("guarded_controller")
        memory = np.zeros((1, 20))
        memory[0, TICK] = -1.0
        self._numbers = GuardedNumbers(
            memory, make_way(known.cells), make_free_space(1, known.cell_m, 1, 2), own,
            (attraction or AttractionParameters()).follow_distance_m,
            robot.control_point_m, body_radius(robot) + 0.02, tick_s,
        )
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in (
                ("p_WS_estimated", 2), ("v_WS_estimated", 2), ("target_valid", 1),
                ("pose_WB_estimated", 3), ("guard_report", 4),
            )
        ]
        self._free_space = self.DeclareAbstractInputPort(
            name="free_space", model_value=Value(object())
        )
        for name, size in (("twist_B", 2), ("plan", 4)):
            self.DeclareVectorOutputPort(name=name, size=size, calc=lambda c, o: None)

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        n = self._numbers
        way = Way(*(np.copy(each) for each in n.way))
        space = run.carried["free_space"](0)
        return Step(
            guarded_step, n._replace(memory=np.copy(n.memory), way=way, space=space)
        )


GUARDED = Law(
    name="guarded",
    title="Guarded law",
    label="guarded",
    equations=(Equation("Guarded law", r"v", "v"),),
    gains=GuardedParameters,
    controller=GuardedController,
    plans=True,
)
