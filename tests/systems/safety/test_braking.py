"""What can be braked: the motion that is foreseen, zones at an edge, moving bodies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from systems.base.diff_drive_plant import PlantNumbers, plant_derivatives
from systems.base.lagged_motion import lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.safety.braking import (
    BRAKED,
    PASSED,
    SLOWED,
    TURNED,
    _dip,
    can_be_braked,
    chosen,
)
from systems.safety.danger import Danger, danger_of
from systems.safety.free_space import clear_disc, clear_outline, make_free_space
from systems.safety.outline import Outline, frame_at, gaps, least_between
from systems.safety.predicted_motion import BrakingNumbers, braked, roll_on
from systems.world.geometry import rectangle_clearance

RADIUS = 0.5 * math.hypot(0.35, 0.82)
#: Distance of a wall ahead from the axle at which the guard stops the robot.
KEEP = RADIUS + 0.012
WHEEL_M, AXLE_M, LAG_S, TICK_S = 0.06, 0.41, 0.05, 0.025
NUMBERS = BrakingNumbers(
    wheel_radius_m=WHEEL_M,
    wheel_separation_m=AXLE_M,
    motor_lag_s=LAG_S,
    braking_m_s2=1.5,
    tick_s=TICK_S,
    parts=1,
    part=lagged_motion(TICK_S, LAG_S),
    top_wheel_speed=12.0,
    outline=Outline(0.175, 0.41, RADIUS),
    keep_m=0.012,
    least_m=0.009,
    obstacle_speed_m_s=0.0,
)
ARC = np.full((1, 2, 2), 100.0)
PLANT = PlantNumbers.of(RobotParameters(), PlantParameters())


def by_the_plant(
    state: NDArray[np.float64], commanded: Any, duration: float = TICK_S
) -> NDArray[np.float64]:
    """The plant's own equations, integrated to 1e-10; (7, 6) in between and at last."""
    solution = solve_ivp(
        lambda _, x: plant_derivatives(x, np.asarray(commanded, dtype=float), *PLANT),
        (0.0, duration),
        state,
        rtol=1e-10,
        atol=1e-12,
        t_eval=np.linspace(0.0, duration, 6),
    )
    return np.asarray(solution.y)


def straight(speed_m_s: float) -> tuple[float, float]:
    return (speed_m_s / WHEEL_M,) * 2


def danger(corners: Any, x: float = 0.0, y: float = 0.0) -> Danger:
    """Cells of 5 cm, by their corners of least x and y."""
    cells = np.reshape(np.array(corners, dtype=float), (-1, 2))
    away = np.maximum(cells - [x, y], [x, y] - cells - 0.05)
    disc = np.hypot(*np.maximum(away, 0.0).T) - RADIUS
    distance = np.maximum(disc, away[:, 1] - 0.41).min(initial=math.inf)
    return Danger(cells, len(cells), 0.05, distance, ARC, np.zeros(1), math.inf)


def wall_at(distance: float) -> Danger:
    """Cells ahead, their nearest side so far from the axle."""
    return danger([(distance, y) for y in np.arange(-1.0, 1.0, 0.05)])


def test_the_foreseen_tick_is_that_of_the_plant():
    """Speeds, places and headings, to the accuracy of the integration by SciPy."""
    draw = np.random.default_rng(0)
    worst = 0.0
    for _ in range(200):
        pose, speeds, commanded = (
            draw.uniform(-3, 3, 3),
            draw.uniform(-12, 12, 2),
            draw.uniform(-12, 12, 2),
        )
        end = by_the_plant(np.array([*pose, 0.0, 0.0, *speeds]), commanded)[:, -1]
        moved, after = roll_on(pose, speeds, commanded, NUMBERS)
        np.testing.assert_allclose(after, end[5:], atol=1e-8)
        assert moved[2] == pytest.approx(end[2], abs=1e-8)
        worst = max(worst, math.dist(moved[:2], end[:2]))
    assert worst < 1e-9


def test_a_whole_braking_is_foreseen_to_rounding():
    """From speeds that a guard lets be: as commanded a tick ago."""
    draw = np.random.default_rng(1)
    worst = 0.0
    for _ in range(60):
        commanded = tuple(draw.uniform(-12, 12, 2))
        speeds = np.array(commanded) * draw.uniform(0.5, 1.0, 2)
        state = np.array([0.0, 0.0, 0.0, 0.0, 0.0, *speeds])
        pose: Any = (0.0, 0.0, 0.0)
        for _ in range(30):
            state = by_the_plant(state, commanded)[:, -1]
            pose, speeds = roll_on(pose, speeds, commanded, NUMBERS)
            worst = max(worst, math.dist(pose[:2], state[:2]))
            commanded = braked(commanded, NUMBERS)
        assert commanded == (0.0, 0.0)
    assert worst < 1e-8


@pytest.mark.parametrize("speed", [0.05, 0.3, 0.6, 0.72])
@pytest.mark.parametrize("braking", [0.5, 1.5, 4.0])
def test_braking_takes_the_closed_form_way(speed, braking):
    """Of commands v - k a T, summed, and of the lag, v lag; below v^2/2a + v lag."""
    numbers = NUMBERS._replace(braking_m_s2=braking)
    commanded, speeds, pose = straight(speed), straight(speed), (0.0, 0.0, 0.0)
    ticks = 0
    while commanded != (0.0, 0.0):
        commanded = braked(commanded, numbers)
        pose, speeds = roll_on(pose, speeds, commanded, numbers)
        ticks += 1
    for _ in range(100):
        pose, speeds = roll_on(pose, speeds, commanded, numbers)
    assert abs(ticks - speed / (braking * TICK_S)) < 1.001
    steps = np.arange(1, 100)
    sums = np.maximum(speed - steps * braking * TICK_S, 0.0).sum() * TICK_S
    assert pose[0] == pytest.approx(sums + speed * LAG_S, abs=1e-12)
    assert pose[0] <= speed**2 / (2.0 * braking) + speed * LAG_S


def test_braking_keeps_the_curve():
    slower = braked((10.0, 4.0), NUMBERS)
    assert slower[1] / slower[0] == pytest.approx(0.4)
    assert (10.0 - slower[0]) * WHEEL_M == pytest.approx(1.5 * TICK_S)
    assert braked((-0.5, 0.3), NUMBERS) == (0.0, 0.0)


def clear_of(pose: Any, corners: Any, length: float = 0.35) -> float:
    """Distance of a body 0.82 m wide from cells, by the geometry of collisions."""
    body = np.array([*pose, length, 0.82, 0.0])
    distances = (
        rectangle_clearance(body, np.array([x + 0.025, y + 0.025, 0, 0.05, 0.05, 0]))
        for x, y in corners
    )
    return float(min(distances))


def nearest_on_the_way(
    speeds: Any, commanded: Any, cells: NDArray[np.float64], in_place: bool
) -> tuple[float, float]:
    """Least distances of the body and of what the guard keeps free, on the way to rest.

    By the plant's equations, six instants a tick. A robot that turns on the spot keeps
    its outline free, another one its lane, which a longer box holds.
    """
    state, exact, kept = np.array([0.0, 0.0, 0.0, 0.0, 0.0, *speeds]), 9.0, 9.0
    (left, right), length = commanded, 0.35 if in_place else 2.0 * RADIUS
    while True:
        path = by_the_plant(state, (left, right))
        for pose in path[:3].T:
            exact = min(exact, clear_of(pose, cells))
            kept = min(kept, clear_of(pose, cells, length))
        state = path[:, -1]
        if left == right == 0.0 and np.abs(state[5:]).max() < 1e-3:
            return exact, kept
        fastest = max(abs(left), abs(right)) * WHEEL_M
        share = max(0.0, 1.0 - 1.5 * TICK_S / fastest) if fastest > 0.0 else 0.0
        left, right = left * share, right * share


def test_what_can_be_braked_is_what_a_finer_simulation_brakes():
    """What passes touches nothing, and what has room enough passes.

    Distances are rounded down by up to half a cell's diagonal less half its side, and
    by what a body may do between two parts.
    """
    draw, judged = np.random.default_rng(4), {True: 0, False: 0}
    for number in range(90):
        speeds, commanded = draw.uniform(-12, 12, (2, 2))
        in_place = number % 3 == 0
        if in_place:
            speeds[1], commanded[1] = -speeds[0], -commanded[0]
        angle, far = draw.uniform(0, math.tau, 4), draw.uniform(0.25, 0.9, 4)
        cells = np.column_stack([far * np.cos(angle), far * np.sin(angle)]) - 0.025
        exact, kept = nearest_on_the_way(speeds, commanded, cells, in_place)
        now = clear_of((0.0, 0.0, 0.0), cells)
        if now < 0.03:
            continue
        found = can_be_braked(
            (0.0, 0.0, 0.0), tuple(speeds), tuple(commanded), danger(cells), NUMBERS
        )
        judged[found] += 1
        if found:
            assert exact >= 0.009
        else:
            assert kept < 0.012 + 0.0104 + 0.006
    assert min(judged.values()) > 10, judged


@pytest.mark.parametrize(
    ("beyond_keep", "way", "may"),
    [
        # Above the margin: as far as to it.
        (0.05, 0.045, True),
        (0.05, 0.055, False),
        # In between and below: away only.
        (-0.001, 0.0004, False),
        (-0.0028, 0.0001, False),
        (-0.001, -0.02, True),
        (-0.004, 0.0002, False),
        (-0.004, -0.0002, True),
        (-0.1, -0.02, True),
        (-0.1, 0.001, False),
    ],
)
def test_the_three_zones(beyond_keep, way, may):
    """Straight ways to a wall: a tick of a command, and what braking adds.

    The last 0.2 mm, which the lag leaves, are not foreseen.
    """
    at_hand = wall_at(KEEP + beyond_keep)
    # A command below the braking of a tick is followed by rest: its way is c T.
    for speed in np.linspace(-0.72, 0.72, 28_801):
        pose, commanded = 0.0, speed
        while commanded != 0.0:
            pose += commanded * TICK_S
            less = abs(commanded) - 1.5 * TICK_S
            commanded = math.copysign(max(less, 0.0), commanded)
        if abs(pose - way) < 2e-5:
            break
    else:
        raise AssertionError("no such way")
    rest: Any = (0.0, 0.0)
    args = (0.0, 0.0, 0.0), rest, straight(speed), at_hand, NUMBERS
    assert can_be_braked(*args) == may


def test_away_from_one_cell_it_may_not_go_toward_another():
    """What is forgotten beside it is no leave to drive to what is ahead."""
    behind, ahead = (-0.45, -0.02), (0.43, -0.02)
    here, rest, wish = (0.0, 0.0, 0.0), (0.0, 0.0), straight(0.03)
    assert can_be_braked(here, rest, wish, danger([behind]), NUMBERS)
    both = danger([behind, ahead])
    assert not can_be_braked(here, rest, wish, both, NUMBERS)


def from_body(points: NDArray[np.float64], pose: Any) -> NDArray[np.float64]:
    """Distances of points from the rectangle of the body, 0 in it."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    own = np.abs((points - pose[:2]) @ np.array([[c, -s], [s, c]])) - [0.175, 0.41]
    return np.asarray(np.hypot(*np.maximum(own, 0.0).T))


def test_where_cells_are_too_near_no_point_of_one_comes_nearer():
    """Against points of the cells, and poses in steps of a tick.

    Points that the body covers at the start are the body's, not an obstacle's.
    """
    draw, passed = np.random.default_rng(3), 0
    grid = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 0.05, 6)]), axis=-1)
    for _ in range(2_000):
        far, bearing = draw.uniform(0.15, 0.6, 4), draw.uniform(0.0, math.tau, 4)
        corners = np.stack([far * np.cos(bearing), far * np.sin(bearing)], axis=1)
        at_hand = danger(corners)
        wish = draw.uniform(-8.0, 8.0, 2)
        wish[1] = draw.choice([wish[1], -wish[0], wish[0]])
        rest: Any = (0.0, 0.0)
        if at_hand.distance_m >= NUMBERS.least_m or not can_be_braked(
            (0.0, 0.0, 0.0), rest, tuple(wish), at_hand, NUMBERS
        ):
            continue
        passed += 1
        points = (corners[:, None, None] + grid).reshape(-1, 2)
        pose, speeds, commanded = (0.0, 0.0, 0.0), rest, tuple(wish)
        for _ in range(60):
            pose, speeds = roll_on(pose, speeds, commanded, NUMBERS)
            commanded = braked(commanded, NUMBERS)
            now = from_body(points, pose)
            nearer = now < from_body(points, (0.0, 0.0, 0.0)) - 2e-4
            assert not np.any(nearer & (now < NUMBERS.least_m - 2e-4))
    assert passed > 100


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turn_on_the_spot_ends_where_the_outline_meets_a_cell(side):
    """Pressing on for 10 s: as near as the margin."""
    corners, pose, speeds, wheels = [(0.3, -0.025)], (0.0, 0.0, 0.0), (0.0, 0.0), 0.0
    rest: Any = (0.0, 0.0)
    commanded, wish = rest, (-2.0 * side, 2.0 * side)
    for _ in range(400):
        frame = frame_at(pose, 0.05)
        disc, aside, _ = gaps(corners[0], 0.05, frame, NUMBERS.outline)
        at_hand = danger(corners)._replace(distance_m=max(disc, aside))
        _, commanded = chosen(pose, speeds, wish, commanded, at_hand, NUMBERS)
        wheels += abs(commanded[0])
        pose, speeds = roll_on(pose, speeds, commanded, NUMBERS)
    gap = clear_of(pose, corners)
    assert 0.3 < side * pose[2] < 1.0
    # After the last look, the corner coasts by up to 0.44 mm.
    assert 0.012 - 0.00044 <= gap < 0.012 + 0.011
    assert wheels > 0.0


def test_beside_cells_on_both_sides_it_drives_on_but_does_not_turn():
    """Between two rows of cells 12.2 mm off, of what is wished the straight part."""
    rows = [(x, y) for x in np.arange(-1, 1, 0.05) for y in (-0.4722, 0.4222)]
    at_hand, rest = danger(rows), (0.0, 0.0)
    here: Any = (0.0, 0.0, 0.0)
    for wish in ((2.0, 9.0), (4.0, 1.0)):
        done, wheels = chosen(here, rest, wish, rest, at_hand, NUMBERS)
        assert done == SLOWED
        assert wheels[0] == wheels[1] == pytest.approx(sum(wish) / 2.0)
    assert chosen(here, rest, (-3.0, 3.0), rest, at_hand, NUMBERS) == (BRAKED, rest)


@pytest.mark.parametrize("cell_m", [0.05, 0.25])
def test_on_unknown_floor_the_body_does_not_turn(cell_m):
    """Nor does it drive, except over cells that it covers: they are at its own place.

    Cells of 25 cm do not fit into the body, so that none is free, and none is an edge.
    """
    here, rest = (0.013, 0.02, 0.4), (0.0, 0.0)
    space = make_free_space(80, cell_m, 1, 2)
    clear_outline(space, here, NUMBERS.outline, math.inf)
    at_hand = danger_of(space, 0.0, here, (1.0, 0.5), NUMBERS)
    for wish in ((2.0, -2.0), (0.1, -0.1), straight(0.1), straight(-0.1), (1.0, 0.5)):
        assert not can_be_braked(here, rest, wish, at_hand, NUMBERS)


def test_from_where_nothing_is_known_nothing_leads_out():
    nowhere = wall_at(0.3)._replace(distance_m=-math.inf)
    for speed in (0.1, -0.1):
        args = (0.0, 0.0, 0.0), (0.0, 0.0), straight(speed), nowhere, NUMBERS
        assert not can_be_braked(*args)


def test_a_long_tick_is_looked_at_in_parts():
    """In a tick of 1 s it passes a cell, with 36 cm of room before and behind it."""
    numbers = NUMBERS._replace(tick_s=1.0, braking_m_s2=1.0)
    corner = danger([(0.5, 0.412)])
    args = (0.0, 0.0, 0.0), straight(0.72), straight(0.72), corner
    assert not can_be_braked(*args, numbers._replace(parts=40))


@pytest.mark.parametrize("lag", [0.05, 0.02])
def test_between_two_looks_a_body_comes_nearer_by_less_than_the_bound(lag):
    """Any wheel speeds and commands; 25 steps a part, and cells around the body."""
    short = NUMBERS._replace(motor_lag_s=lag, part=lagged_motion(TICK_S / 25, lag))
    long = short._replace(part=lagged_motion(TICK_S, lag))
    draw, tightest = np.random.default_rng(4), math.inf
    trials = draw.uniform(-12.0, 12.0, (200, 4))
    # Reversed, and turning on the spot.
    trials[:50, 2:], trials[50:100, 1] = -trials[:50, :2], -trials[50:100, 0]
    for left, right, *commanded in trials:
        angle = draw.uniform(0.0, math.tau, 12)
        corners = 0.46 * np.column_stack([np.cos(angle), np.sin(angle)]) - 0.025
        pose, speeds = (0.0, 0.0, 0.0), (left, right)
        _, after = roll_on(pose, speeds, tuple(commanded), long)
        dip = _dip(speeds, after, tuple(commanded), TICK_S, short)
        found = [
            [gaps(at, 0.05, frame_at(pose, 0.05), NUMBERS.outline) for at in corners]
        ]
        for _ in range(25):
            pose, speeds = roll_on(pose, speeds, tuple(commanded), short)
            frame = frame_at(pose, 0.05)
            found.append([gaps(at, 0.05, frame, NUMBERS.outline) for at in corners])
        path = np.array(found)
        for ends in path.reshape(26, -1).T:
            bound = least_between(ends[0], ends[-1], dip)
            if bound < 0.0:  # beyond the middle of the body
                continue
            assert ends.min() >= bound - 1e-9
            tightest = min(tightest, ends.min() - bound)
    assert tightest < 5e-4


@pytest.mark.parametrize("lag", [0.05, 1.0])
def test_at_rest_no_way_is_left(lag):
    """What is cut off after the last look is a fifth of a millimeter, at any lag."""
    numbers = NUMBERS._replace(motor_lag_s=lag, part=lagged_motion(TICK_S, lag))
    way = 0.1 * (TICK_S + 2.0 * lag)
    for ahead in np.arange(0.0, way, 5e-4):
        at_hand = wall_at(KEEP + ahead)
        args = (0.0, 0.0, 0.0), straight(0.1), straight(0.1), at_hand, numbers
        if can_be_braked(*args):
            break
    commanded, speeds, pose = straight(0.1), straight(0.1), (0.0, 0.0, 0.0)
    for _ in range(int(20.0 * lag / TICK_S) + 100):
        pose, speeds = roll_on(pose, speeds, commanded, numbers)
        commanded = braked(commanded, numbers)
    assert pose[0] <= ahead + 2.1e-4


def press(
    wish: Any, ticks: int, error_m: float = 0.0, seed: int = 0
) -> tuple[float, float]:
    """Least distances of outline and lane from the edge of a bubble under a driver.

    Where models are wrong the robot is moved by up to error_m a tick besides.
    """
    draw = np.random.default_rng(seed)
    space = make_free_space(80, 0.05, 1, 2)
    clear_disc(space, 0.0, 0.0, 1.0, math.inf)
    pose: Any = (0.0, 0.0, 0.0)
    speeds: Any = (0.0, 0.0)
    commanded: Any = (0.0, 0.0)
    outline, lane = math.inf, math.inf
    for tick in range(ticks):
        at_hand = danger_of(space, tick * TICK_S, pose, (1.0, 0.5), NUMBERS)
        near = at_hand.corners[: at_hand.corner_count]
        near = near[np.hypot(*(near + 0.025 - pose[:2]).T) < 0.6]
        outline = min(outline, clear_of(pose, near) if len(near) else math.inf)
        lane = min(lane, at_hand.distance_m)
        _, commanded = chosen(
            pose, speeds, wish(tick, pose), commanded, at_hand, NUMBERS
        )
        pose, speeds = roll_on(pose, speeds, commanded, NUMBERS)
        off = draw.uniform(-error_m, error_m, 2)
        pose = pose[0] + off[0], pose[1] + off[1], pose[2]
    return outline, lane


@pytest.mark.parametrize(
    "wish",
    [
        lambda tick, pose: (12.0, 12.0),
        lambda tick, pose: (-12.0, -12.0),
        lambda tick, pose: (3.0, 8.0),
        lambda tick, pose: (-12.0, -11.0),
        lambda tick, pose: (2.0 * math.sin(0.3 * tick) + 9.0, 9.0),
        lambda tick, pose: (12.0, 12.0) if tick % 7 else (-12.0, 12.0),
        lambda tick, pose: (0.9, 0.9),
    ],
)
def test_a_driver_who_presses_stays_off_by_the_least_margin(wish):
    """For 10 s; and it does come as near as to the margin, ahead of the lane."""
    outline, lane = press(wish, 400)
    assert outline >= 0.012 - 1e-5
    assert 0.009 <= lane <= 0.04


@pytest.mark.parametrize("seed", range(4))
def test_nor_does_it_where_models_are_wrong(seed):
    """A random walk of 0.1 mm a tick pushes it below the least; then it leaves."""
    outline, lane = press(lambda tick, pose: (12.0, 12.0), 2000, 1e-4, seed)
    assert outline > 0.005
    assert 0.005 < lane < 0.0125


def test_what_is_chosen():
    far, rest = wall_at(5.0), (0.0, 0.0)
    here: Any = (0.0, 0.0, 0.0)
    wish = straight(0.5)
    assert chosen(here, rest, wish, rest, far, NUMBERS) == (PASSED, wish)
    # Room for 2 cm: part of the wish, along its curve.
    near = wall_at(KEEP + 0.02)
    done, wheels = chosen(here, rest, (10.0, 9.0), rest, near, NUMBERS)
    assert done == SLOWED
    assert wheels[1] / wheels[0] == pytest.approx(0.9)
    assert 0.0 < wheels[0] < 10.0
    # Room for nothing but a turn.
    near = wall_at(KEEP)
    done, wheels = chosen(here, rest, (12.0, 4.0), rest, near, NUMBERS)
    assert (done, wheels) == (TURNED, (4.0, -4.0))
    # Not even that: braking goes on as it was found possible.
    speed = straight(0.72)
    done, wheels = chosen(here, speed, speed, speed, near, NUMBERS)
    assert done == BRAKED
    assert wheels == braked(speed, NUMBERS)


def moving(speed: float) -> BrakingNumbers:
    return NUMBERS._replace(obstacle_speed_m_s=speed)


def view(distance: float, age: float = 0.0) -> Danger:
    """A view that ends so far ahead of the axle; nothing else is near."""
    arc = np.array([[[distance, y] for y in np.linspace(-0.5, 0.5, 41)]])
    nothing = np.empty((0, 2))
    return Danger(nothing, 0, 0.05, math.inf, arc, np.array([age]), distance)


@pytest.mark.parametrize("age", [0.0, 0.1])
@pytest.mark.parametrize("obstacle_speed", [0.2, 0.6])
def test_what_comes_nearer_is_kept_off_until_rest(age, obstacle_speed):
    """Least room for going on at 0.5 m/s: way to rest, and what comes until then."""
    speed = 0.5
    for ahead in np.arange(0.0, 1.5, 1e-3):
        args = (0.0, 0.0, 0.0), straight(speed), straight(speed)
        at_hand = view(KEEP + ahead, age)
        if can_be_braked(*args, at_hand, moving(obstacle_speed)):
            break
    # Rest is where the lag leaves 0.2 mm, 4 mm/s.
    state, t, needed = np.array([0.0] * 5 + [speed / WHEEL_M] * 2), 0.0, 0.0
    commanded = speed
    while True:
        state = by_the_plant(state, straight(commanded))[:, -1]
        t += TICK_S
        needed = max(needed, state[0] + obstacle_speed * (t + age))
        if commanded == 0.0 and state[5] * WHEEL_M < 0.004:
            break
        commanded = max(0.0, commanded - 1.5 * TICK_S)
    assert ahead == pytest.approx(needed, abs=1.1e-3)


def test_at_rest_and_turning_slowly_it_may_be_touched_turning_fast_it_may_not():
    at_hand, rest = view(KEEP + 0.01), (0.0, 0.0)
    turn = 0.3 * AXLE_M / 2.0 / WHEEL_M
    here: Any = (0.0, 0.0, 0.0)
    for share, may in ((0.99, True), (1.01, False)):
        wish = -share * turn, share * turn
        assert can_be_braked(here, rest, wish, at_hand, moving(0.5)) == may
    assert can_be_braked(here, rest, rest, at_hand, moving(0.5))


def test_it_may_withdraw_from_what_comes():
    at_hand, rest = view(KEEP - 0.05), (0.0, 0.0)
    here: Any = (0.0, 0.0, 0.0)
    assert can_be_braked(here, rest, straight(-0.3), at_hand, moving(0.5))
    assert not can_be_braked(here, rest, straight(0.3), at_hand, moving(0.5))


def test_a_fast_turn_is_no_withdrawal():
    """Drifting back by 6 mm/s, it would swing the bar's end into what is near."""
    at_hand, rest = view(KEEP - 0.05), (0.0, 0.0)
    here: Any = (0.0, 0.0, 0.0)
    assert not can_be_braked(here, rest, (-12.0, 11.8), at_hand, moving(0.5))
    assert can_be_braked(here, rest, (-0.1, -0.1), at_hand, moving(0.5))
    # A curve that leads away by more than it turns is one.
    assert can_be_braked(here, rest, (-6.0, -5.0), at_hand, moving(0.5))


@pytest.mark.parametrize("wish", [(-7.0, 7.0), (8.0, 2.0)])
def test_beside_what_is_near_it_can_still_turn_slowly(wish):
    """Else it would stand before a wall for ever: 0.3 rad/s, to the side wished."""
    at_hand, rest = view(KEEP - 0.05), (0.0, 0.0)
    here: Any = (0.0, 0.0, 0.0)
    done, (left, right) = chosen(here, rest, wish, rest, at_hand, moving(0.6))
    rate = (right - left) * WHEEL_M / AXLE_M
    assert done == TURNED
    assert left + right == pytest.approx(0.0)
    assert rate == pytest.approx(math.copysign(0.3, wish[1] - wish[0]))
