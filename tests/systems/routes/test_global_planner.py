"""The planner with a point that goes where the target is, until something blocks."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from pydantic import ValidationError
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from phonotaxis.testing import evaluate
from systems.base.robot import RobotParameters
from systems.framework.block import RunFacts, copied
from systems.framework.input_error import InputError
from systems.framework.signals import TICK_S
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.global_planner import REPLANS, GlobalPlanner, planner_step
from systems.routes.parameters import RouteParameters
from systems.routes.path_target import PathTarget
from systems.routes.route import ROUTE_SIZE
from systems.routes.widest_route import plan_route
from systems.world.geometry import nearest_point_on_rectangle, segment_clearance

EPSILON = 0.08
ROBOT = RobotParameters(control_point_m=EPSILON)
#: The point comes no nearer to anything, m.
KEEP = 0.28
WALL = (2.0, 0.2, 0.3, 0.1, 1.6, 0.0)
WAITS = RouteParameters(goal_m=(4.0, 0.0), timing="waiting")


def objects_at(x, y, boxes, robot=0.0):
    """The port of boxes at rest within 2 m."""
    seen = []
    for box in boxes:
        dx, dy = nearest_point_on_rectangle((x, y), box)
        if math.hypot(dx, dy) < 2.0:
            seen.append([1.0, dx, dy, 0.0, 0.0, 1.0, 0.0, robot])
    port = np.zeros((OBJECT_SLOTS, OBJECT_SIZE))
    port[: len(seen)] = np.reshape(sorted(seen, key=lambda s: math.hypot(*s[1:3])),
                                   (-1, OBJECT_SIZE))  # fmt: skip
    return port.ravel()


def moved(x, y, target, boxes):
    """To the target at 0.2 m/s at most, as far as nothing is near."""
    dx, dy = target[0] - x, target[1] - y
    part = min(0.2 * TICK_S / max(math.hypot(dx, dy), 1e-9), 1.0)
    ahead = x + part * dx, y + part * dy
    if all(segment_clearance(ahead, ahead, box) > KEEP for box in boxes):
        return ahead
    return x, y


class Point(LeafSystem):
    """P, which goes to the target; what it sees; the robot's heading is 0."""

    def __init__(self, boxes):
        super().__init__()
        self._boxes = boxes
        self._target = self.DeclareVectorInputPort("target_state", 4)
        self.DeclareDiscreteState(2)
        self.DeclarePeriodicDiscreteUpdateEvent(TICK_S, 0.0, self._move)
        state = {self.xd_ticket()}
        for name, size, calc in (
            ("pose_WB_estimated", 3, self._pose),
            ("objects_W", OBJECT_SLOTS * OBJECT_SIZE, self._objects),
        ):
            self.DeclareVectorOutputPort(name, size, calc, prerequisites_of_calc=state)

    def _pose(self, context, output):
        x, y = context.get_discrete_state(0).value()
        output.SetFromVector([x - EPSILON, y, 0.0])

    def _objects(self, context, output):
        x, y = context.get_discrete_state(0).value()
        output.SetFromVector(objects_at(x, y, self._boxes))

    def _move(self, context, state):
        x, y = context.get_discrete_state(0).value()
        at = moved(x, y, self._target.Eval(context), self._boxes)
        state.set_value(0, np.array(at))


def run_by_drake(planner, target, boxes, ticks):
    """Places of P, and replans, a row a tick."""
    builder = DiagramBuilder()
    point = Point(boxes)
    blocks = [builder.AddSystem(b) for b in (planner, target, point)]
    outputs = {
        block.get_output_port(k).get_name(): block.get_output_port(k)
        for block in blocks
        for k in range(block.num_output_ports())
    }
    for block in blocks:
        for k in range(block.num_input_ports()):
            port = block.get_input_port(k)
            builder.Connect(outputs[port.get_name()], port)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    of_point, of_planner = (b.GetMyContextFromRoot(root) for b in (point, planner))
    rows = []
    for k in range(ticks):
        simulator.AdvanceTo(k * TICK_S)
        place = of_point.get_discrete_state(0).value()
        replans = planner.GetOutputPort("replans").Eval(of_planner)
        rows.append([*place, *replans])
    return np.array(rows)


def run_compiled(steps, boxes, ticks, tick, start=(0.0, 0.0)):
    """The same by compiled steps, in the order of compiled loops."""
    planner, target = steps
    states = copied(planner.state), np.array(target.state)
    route, replans = np.zeros(ROUTE_SIZE), np.zeros(1)
    place, progress, valid = np.zeros(4), np.zeros(2), np.zeros(1)
    (x, y), rows = start, []
    for k in range(ticks):
        planner.publish(states[0], (route, replans, np.zeros(1)), planner.numbers)
        pose, objects = np.array([x - EPSILON, y, 0.0]), objects_at(x, y, boxes)
        outputs = place, progress, valid
        tick(target.step, k, states[1], (route, pose), outputs, target.numbers)
        rows.append([x, y, replans[0]])
        seen = objects, pose, progress
        tick(planner.step, k, states[0], seen, (), planner.numbers)
        x, y = moved(x, y, place, boxes)
    return np.array(rows)


def make(parameters=WAITS, known=(), start=(0.0, 0.0)):
    pose = (start[0] - EPSILON, start[1], 0.0)
    return GlobalPlanner(
        parameters=parameters, known=known, initial_pose=pose, robot=ROBOT
    )


def facts(start=(0.0, 0.0), mapped=()):
    pose = (start[0] - EPSILON, start[1], 0.0)
    return RunFacts(0, TICK_S, pose, TICK_S, lambda _: 0, {}, mapped)


def test_the_first_route_is_that_of_the_map():
    """From P, and not from the axle."""
    outputs = evaluate(make(known=[WALL]))
    expected = plan_route((0.0, 0.0), (4.0, 0.0), [WALL]).numbers
    np.testing.assert_array_equal(outputs["route"], expected)
    assert outputs["replans"] == [0.0]


def test_the_clearance_is_that_of_the_route_near_p(compiled_tick):
    """Against the distance from 20,000 points on the edge of the wall."""
    planner = make(known=[WALL])
    step = planner.step_for(facts(mapped=[WALL]))
    route = plan_route((0.0, 0.0), (4.0, 0.0), [WALL])
    x, y, theta, length, width, _ = WALL
    along = np.linspace(-0.5, 0.5, 5000)
    ends = np.full(5000, 0.5)
    edge = np.concatenate(
        [
            np.column_stack(each) * [length, width]
            for each in ((along, ends), (along, -ends), (ends, along), (-ends, along))
        ]
    )
    c, s = math.cos(theta), math.sin(theta)
    edge = edge @ [[c, s], [-s, c]] + [x, y]
    published = []
    for k in (0, 40, 100, len(route.points) - 1):
        progress = 0.0, k * route.spacing_m
        inputs = np.zeros(64), (0.0, 0.0, 0.0), progress
        compiled_tick(step.step, 0, step.state, inputs, (), step.numbers)
        out = np.zeros(ROUTE_SIZE), np.zeros(1), np.zeros(1)
        step.publish(step.state, out, step.numbers)
        off = np.hypot(*(edge - route.points[k]).T).min()
        assert out[2][0] == pytest.approx(off, abs=1e-4)
        published.append(off)
    # The second one is beside the wall, where the planner keeps 0.35 m.
    assert min(published) < 0.4
    assert max(published) > 1.5


def test_a_door_is_planned_at_the_width_that_it_has():
    """A robot of 0.16 m passes a door of 0.5 m, although clearance_m is 0.35."""
    walls = [(2.0, y, 0.0, 0.1, 2.0, 0.0) for y in (1.25, -1.25)]
    rooms = [(2.0, y, 0.0, 6.5, 0.1, 0.0) for y in (2.25, -2.25)]
    ends = [(x, 0.0, 0.0, 0.1, 4.6, 0.0) for x in (-1.2, 5.2)]
    known = walls + rooms + ends
    planner = GlobalPlanner(
        parameters=WAITS,
        known=known,
        initial_pose=(-EPSILON, 0.0, 0.0),
        robot=ROBOT.model_copy(update={"width_m": 0.16}),
    )
    route = evaluate(planner)["route"]
    points = route[2:].reshape(-1, 2)[: int(route[0])]
    beside = np.interp(2.0, *points.T)
    assert abs(beside) < 0.25 - 0.08 - 0.05
    with pytest.raises(InputError, match=r"at 0\.35 m from"):
        plan_route((0.0, 0.0), (4.0, 0.0), known)


def test_it_comes_past_an_unknown_wall_and_compiled_the_same(compiled_tick):
    """It stops at the wall, and knows a way past what it has seen of it."""
    planner, target = make(), PathTarget(parameters=WAITS, robot=ROBOT)
    ticks = 3200
    drake = run_by_drake(planner, target, [WALL], ticks)
    steps = planner.step_for(facts()), target.step_for(facts())
    compiled = run_compiled(steps, [WALL], ticks, compiled_tick)
    np.testing.assert_array_equal(drake[0, :2], 0.0)
    assert math.dist(drake[-1, :2], (4.0, 0.0)) < 1e-3
    assert 1 <= drake[-1, 2] <= 6
    np.testing.assert_array_equal(compiled, drake)
    # Runs share a block, but not what they remember.
    again = run_compiled(
        (planner.step_for(facts()), steps[1]), [WALL], 400, compiled_tick
    )
    np.testing.assert_array_equal(again, drake[:400])


def ticks_of_replans(planner, tick, objects, pose, ways):
    """When the route changed, of a robot that stands, and the state at the end."""
    step = planner.step_for(facts())
    state, changed = step.state, []
    for k, progress in enumerate(ways):
        before = state.route.copy()
        tick(step.step, k, state, (objects, pose, progress), (), step.numbers)
        if (before != state.route).any():
            changed.append(k)
    return changed, state


STANDS = (1.0 - EPSILON, 0.0, 0.0)


@pytest.mark.parametrize(
    ("aside", "made", "at"), [(0.0, 0, 120), (0.0, 60, 140), (0.9, 0, 240)]
)
def test_it_plans_anew_after_2_s_where_something_at_rest_blocks_it_else_after_6_s(
    aside, made, at, compiled_tick
):
    """What is seen at 0 s for the first time is known to be at rest at 3 s, tick 120.

    P makes way until tick ``made``: it is 0.3 m along from then on.
    """
    post = [(1.4, aside, 0.0, 0.1, 0.1, 0.0)]
    objects = objects_at(1.0, 0.0, post)
    ways = [(0.5, 0.3 if k >= made else 0.0) for k in range(300)]
    changed, state = ticks_of_replans(make(), compiled_tick, objects, STANDS, ways)
    # From then on the route is known: planned again from the same place it is the same.
    assert changed == [at]
    route = state.route[2:].reshape(-1, 2)[: int(state.route[0])]
    assert route[0] == pytest.approx([1.0, 0.0])
    assert route[-1] == pytest.approx([4.0, 0.0])
    # What is known is the nearest point, on the left face of the post.
    nearest = [1.35, max(aside - 0.05, 0.0)]
    assert np.hypot(*(route - nearest).T).min() >= 0.35 - 0.02


def test_who_is_at_the_goal_does_not_stall(compiled_tick):
    pose = (3.96 - EPSILON, 0.0, 0.0)
    changed, _ = ticks_of_replans(
        make(), compiled_tick, np.zeros(64), pose, [(0.5, 0.3)] * 600
    )
    assert not changed


def test_way_that_is_made_is_no_stall(compiled_tick):
    """0.11 m in 5.9 s."""
    step = make().step_for(facts())
    first = step.state.route.copy()
    for k in range(1000):
        progress = 0.0, 0.11 * (k // 236)
        inputs = np.zeros(64), STANDS, progress
        compiled_tick(step.step, k, step.state, inputs, (), step.numbers)
    np.testing.assert_array_equal(step.state.route, first)


def test_way_on_a_new_route_counts_from_its_begin(compiled_tick):
    """It stalls 3 m along the first one, and makes way on the second."""
    step = make().step_for(facts())
    for k in range(900):
        along = 3.0 if k <= 240 else 0.11 * ((k - 241) // 236)
        inputs = np.zeros(64), STANDS, (along, along)
        compiled_tick(step.step, k, step.state, inputs, (), step.numbers)
    assert step.state.progress[REPLANS] == 1.0


def test_where_there_is_no_way_the_route_stays_until_there_is_one(compiled_tick):
    """A ring of robots at rest, which go after the second attempt."""
    planner = make()
    step = planner.step_for(facts())
    ring = np.zeros((OBJECT_SLOTS, OBJECT_SIZE))
    for k, slot in enumerate(ring):
        angle = math.tau * k / OBJECT_SLOTS
        x, y = 0.6 * math.cos(angle), 0.6 * math.sin(angle)
        slot[:] = 1, x, y, 0, 0, 1, 0.15, 1
    replans = []
    for k in range(760):
        objects = ring.ravel() if k < 600 else np.zeros(64)
        inputs = objects, STANDS, (0.0, 0.0)
        compiled_tick(step.step, k, step.state, inputs, (), step.numbers)
        replans.append(step.state.progress[REPLANS])
    assert np.flatnonzero(np.diff(replans)).tolist() == [719]
    np.testing.assert_allclose(step.state.route[2:4], [1.0, 0.0], atol=1e-12)


def test_without_replanning_the_route_stays():
    off = WAITS.model_copy(update={"replan": False})
    planner, target = make(off), PathTarget(parameters=off, robot=ROBOT)
    rows = run_by_drake(planner, target, [WALL], 800)
    assert rows[-1, 2] == 0.0
    assert rows[-1, 0] < 2.0
    step = planner.step_for(facts())
    first = copied(step.state)
    inputs = np.zeros(64), STANDS, (0.0, 0.0)
    planner_step(900, step.state, inputs, (), step.numbers)
    np.testing.assert_array_equal(step.state.route, first.route)
    np.testing.assert_array_equal(step.state.progress, first.progress)


def test_a_run_has_its_own_start_and_map():
    planner = make()
    step = planner.step_for(facts(start=(0.0, 1.0), mapped=[WALL]))
    expected = plan_route((0.0, 1.0), (4.0, 0.0), [WALL]).numbers
    np.testing.assert_array_equal(step.state.route, expected)
    np.testing.assert_array_equal(step.numbers.rectangles, [WALL])


def test_planning_anew_takes_less_than_10_ms(compiled_tick):
    """10 m x 10 m in cells of 5 cm, 20 boxes, 500 points seen; median of 7."""
    generator = np.random.default_rng(5)
    boxes = np.column_stack(
        [
            generator.uniform(-4, 4, (20, 2)),
            np.zeros(20),
            np.full((20, 2), 0.4),
            np.zeros(20),
        ]
    )
    boxes = boxes[np.hypot(boxes[:, 0], boxes[:, 1]) > 1.0]
    corners = [[-4.9, 0, 0, 0.2, 10, 0], [4.9, 0, 0, 0.2, 10, 0]]
    own = RouteParameters(goal_m=(4.4, 4.4))
    boxes = boxes[np.hypot(boxes[:, 0] - 4.4, boxes[:, 1] - 4.4) > 1.0]
    planner = make(own, [*boxes, *corners], (-4.4, -4.4))
    step = planner.step_for(facts((-4.4, -4.4), [*boxes, *corners]))
    assert step.numbers.grid.blocked.size >= 200 * 200
    seen = step.state.seen
    seen.points[:500] = generator.uniform(-4, 4, (500, 2)) * [1, 0.1]
    seen.points[:500, 1] -= 1.5
    seen.added[0] = 500
    took = []
    for k in range(8):
        state = copied(step.state)
        inputs = np.zeros(64), (-4.4 - EPSILON, -4.4, 0.0), (0.0, 0.0)
        begin = time.process_time()
        compiled_tick(step.step, 240, state, inputs, (), step.numbers)
        took.append(time.process_time() - begin)
        assert state.progress[REPLANS] == 1.0, k
    assert np.median(took[1:]) < 0.01


@pytest.mark.parametrize(
    ("field", "value"),
    # Slower, it would always stall; for less clearance the cells are too coarse.
    [("speed_m_s", 0.015), ("clearance_m", 0.14)],
)
def test_parameters_that_cannot_serve_are_refused(field, value):
    with pytest.raises(ValidationError, match=f"{field}\n.*greater than or equal"):
        RouteParameters(**{field: value})


def test_a_goal_in_an_obstacle_is_refused():
    with pytest.raises(InputError, match="goal_m"):
        make(known=[(4.0, 0.2, 0.0, 1.0, 1.0, 0.0)])
