"""The assumptions of the guard's theorem (docs/guard.md), each held and each broken.

Trials are those of ``analysis/safety/driver_trials.py``: drivers that press a guarded
robot against bodies at rest. Where all assumptions hold it touches nothing; where one
does not, there are trials in which it does.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.safety.driver_trials import draw_trial, make_trial, run_trial
from diagrams import Scenario, load_scenario, simulate
from phonotaxis.testing import Bench
from studies.support.crossing_trials import contact_speeds, draw_crossing
from systems.base.diff_drive_plant import DiffDrivePlant, body_twist
from systems.base.lagged_motion import advance_pose, lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.ranging.parameters import UltrasonicParameters
from systems.ranging.ultrasonic_array import RangeErrors, measured_ranges, range_errors
from systems.safety.free_space_map import FreeSpaceMap
from systems.safety.motion_guard import MotionGuard
from systems.safety.predicted_motion import braked, roll_on
from systems.safety.views import PlaceError, lasting
from systems.world.cones import fan_ranges

SEED = 7
RADIUS = 0.5 * math.hypot(0.35, 0.82)


def collides(number: int, changes: dict[str, Any] | None = None) -> bool:
    return run_trial(draw_trial(SEED, number), changes).collided


@pytest.mark.slow
def test_with_all_assumptions_nothing_is_touched():
    """Nor does the body come nearer than the theorem leaves of the least margin."""
    for number in (*range(20), 37):
        outcome = run_trial(draw_trial(SEED, number))
        assert not outcome.collided
        assert outcome.clearance_m >= 0.003 - 0.00044


# A1: obstacles rest.


@pytest.mark.slow
def test_a1_obstacles_rest_else_they_come_from_where_nobody_looks():
    """A cart beside the way, or one that crosses it behind the cones at 0.5 m/s."""
    ahead = [[10.0, 0.0, 0.3, 0.0, 0.0, 0.0]]
    names = "posts", "ahead", "plain"
    trial = make_trial(names, [(1.0, 1.5, 0.0, 0.3, 0.3)], ahead, 0.0, (8.0, 0.0), 1)
    assert not run_trial(trial).collided
    crossing = {"waypoints_m": [[1.0, 2.0], [1.0, -2.0]], "speed_m_s": 0.5}
    trial.fields["obstacles"][0] |= crossing
    assert run_trial(trial).collided


# A2: a reading means no obstacle nearer than it, less the margin, inside its aperture.


def test_a2_no_obstacle_is_nearer_than_a_reading_inside_its_aperture():
    """Points of boxes, outline and inside, against the ranges of the cones."""
    draw, inside_any = np.random.default_rng(0), 0
    axes, places, halves = UltrasonicParameters().beams
    half = halves[0]
    for _ in range(300):
        pose = draw.uniform(-1.0, 1.0, 3)
        boxes = draw.uniform([-2, -2, -3, 0.02, 0.02], [2, 2, 3, 1.0, 1.0], (4, 5))
        rows = np.pad(boxes, ((0, 0), (0, 1)))
        ranges = fan_ranges(pose, rows, axes, places, halves, 0.175)
        sensor = pose[:2] + 0.175 * np.array([math.cos(pose[2]), math.sin(pose[2])])
        for x, y, theta, length, width in boxes:
            u, v = draw.uniform(-0.5, 0.5, (2, 400))
            u[:200] = np.sign(u[:200]) * 0.5  # on the outline
            c, s = math.cos(theta), math.sin(theta)
            dx = x + c * u * length - s * v * width - sensor[0]
            dy = y + s * u * length + c * v * width - sensor[1]
            for axis, reading in zip(axes, ranges, strict=True):
                off = np.arctan2(dy, dx) - pose[2] - axis
                inside = np.abs((off + math.pi) % math.tau - math.pi) < half
                inside_any += inside.sum()
                assert (np.hypot(dx, dy)[inside] >= reading - 1e-9).all()
    assert inside_any > 10_000


@pytest.mark.parametrize("noise_m", [0.0, 0.001, 0.01])
def test_a2_noise_stays_below_the_margin_but_for_one_range_in_millions(noise_m):
    """The margin is 2 mm and five standard deviations: 3e-7 by Gauss."""
    sensors = UltrasonicParameters.model_validate({"noise_m": noise_m})
    sensors = sensors.model_copy(update={"sensors": sensors.sensors[:1]})
    ((_, _, margin, _),) = FreeSpaceMap(sensors=sensors).step.numbers.limits
    assert margin == pytest.approx(0.002 + 5.0 * noise_m)
    draw = np.random.default_rng(1)
    numbers = draw.standard_normal((2, 300_000))
    true = draw.uniform(0.1, 3.2, 300_000)
    stretch, *limits = range_errors(sensors)
    errors = RangeErrors(stretch, *(np.repeat(each, len(true)) for each in limits))
    ranges, echo = measured_ranges(true, numbers, errors)
    seen = np.where(echo > 0.5, ranges, 3.0) - margin
    assert (seen < true).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "fields",
    [{"ultrasonic": {"dropout_probability": 0.3}}, {"assumed_sound_speed_m_s": 400.0}],
)
def test_a2_broken_by_missed_echoes_or_by_ranges_that_are_too_long(fields):
    assert collides(2, fields)


# A3: nothing stands in the bubble at the start.


@pytest.mark.parametrize(
    ("text", "half"),
    [
        ("obstacles=[{name: box, size_m: [0.2, 0.1], waypoints_m: [[-%s, 0]]}]", 0.1),
        ("source={length_m: 0.2, waypoints_m: [[%s, 0]]}", 0.1),
        # A robot whose heading is 0 is 0.82 m wide along y.
        ("robots={robot: {}, second: {start: {position_m: [0, -%s]}}}", 0.41),
    ],
)
def test_a3_a_body_in_the_bubble_is_refused_before_the_run(text, half):
    """Its middle at 1 m, the bubble, and half of its size."""
    elsewhere = "guard={}", "source.waypoints_m=[[4, 4]]"
    load_scenario("default", [*elsewhere, text % (1.0 + half + 1e-6)])
    with pytest.raises(InputError) as error:
        load_scenario("default", [*elsewhere, text % (1.0 + half - 1e-6)])
    assert error.value.field.endswith("start.position_m")


# A4: places are known to within the margin.


def moved_apart(
    slip: tuple[float, float], distance: float, draw: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rolled ways, and by then the largest error of cells' places from the robot, m.

    Two plants obey the same wheels, one with slip; cells lie all around.
    """
    believed, true = np.zeros(3), np.zeros(3)
    angle = np.linspace(-math.pi, math.pi, 24, endpoint=False)
    cells = distance * np.column_stack([np.cos(angle), np.sin(angle)])
    robot, ways, errors, way = RobotParameters(), [], [], 0.0
    left, right = draw.uniform(-1.0, 1.0, 2) * 12.0
    for tick in range(1000):
        if tick % 25 == 0:
            left, right = draw.uniform(-1.0, 1.0, 2) * 12.0
            if draw.random() < 0.5:  # straight on, or on the spot
                right = draw.choice([left, -left])
        turned = np.array([left, right]) * 0.005
        way += 0.06 * float(np.abs(turned).mean())
        true = arc_on(true, turned * (1.0 - np.array(slip)), robot)
        believed = arc_on(believed, turned, robot)
        seen = [_from_robot(pose, cells) for pose in (true, believed)]
        ways.append(way)
        errors.append(np.hypot(*(seen[0] - seen[1]).T).max())
    return np.array(ways), np.array(errors)


def arc_on(
    pose: NDArray[np.float64], turned: NDArray[np.float64], robot: RobotParameters
) -> NDArray[np.float64]:
    """Pose after both wheels have turned at constant speeds."""
    twist = body_twist(turned, robot)
    return np.array(advance_pose(pose, twist, twist, lagged_motion(0.005, 0.05)))


def _from_robot(
    pose: NDArray[np.float64], cells: NDArray[np.float64]
) -> NDArray[np.float64]:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return (cells - pose[:2]) @ np.array([[c, -s], [s, c]])


@pytest.mark.parametrize(("error", "distance"), [(0.003, 0.5), (0.02, 3.0)])
def test_a4_cells_are_off_by_less_than_allowed_as_long_as_they_last(error, distance):
    allowed, draw, most = 0.03, np.random.default_rng(2), 0.0
    lasts = lasting(distance, PlaceError(error, 0.0, 0.41, allowed))
    for slip in ((error, error), (error, -error), (-error, error), (-error, 0.0)):
        for _ in range(5):
            ways, errors = moved_apart(slip, distance, draw)
            assert errors[ways <= lasts].max(initial=0.0) <= allowed
            most = max(most, errors[ways <= lasts].max(initial=0.0))
    # And it is no bound that nothing comes near.
    assert most > 0.1 * allowed


@pytest.mark.slow
def test_a4_encoders_in_whole_pulses_stay_within_the_margin():
    """Cells 0.5 m off, which the guard stops at, by drivers of all kinds: 2 mm in 10 s.

    A pulse is 0.145 mm of rim, 0.35 mrad of heading.
    """
    for number in (1, 2, 4, 5, 7):
        trial = draw_trial(SEED, number)
        scenario = Scenario.model_validate(trial.fields)
        run_trial(trial)  # the driver's table
        columns = simulate(scenario, engine="compiled").columns
        off = np.hypot(
            columns["p_WB_x"] - columns["p_WB_estimated_x"],
            columns["p_WB_y"] - columns["p_WB_estimated_y"],
        ) + 0.5 * np.abs(columns["theta_WB"] - columns["theta_WB_estimated"])
        assert off.max() < 0.002


@pytest.mark.slow
def test_a4_broken_by_wheels_that_are_not_as_large_as_is_believed():
    slip = {"plant": {"slip": (0.03, -0.03)}}
    assert collides(37, slip)
    known = {"guard": {"wheel_error": 0.03, "place_error_m": 0.09}}
    assert not collides(37, slip | known)


@pytest.mark.slow
def test_a4_what_is_forgotten_beside_it_is_not_driven_into():
    """A falsification's find: ways led away from the nearest forgotten cell, and on."""
    trial = draw_trial(11, 2154)
    assert trial.variant == "slip apart"
    outcome = run_trial(trial)
    assert not outcome.collided
    assert outcome.clearance_m > 0.01


# A5: braking is never weaker than modeled.


def braking_way(friction: float | None, speed: float = 0.72) -> float:
    """Way to rest, m, of the plant's own equations in steps of 1 ms."""
    plant = PlantParameters(friction=friction)
    at = Bench(DiffDrivePlant(plant=plant))
    state = np.zeros(len(at.state))
    state[5:7] = speed / 0.06
    if friction is not None:
        state[7] = speed
    braking = MotionGuard().step.numbers.braking
    commanded: Any = (speed / 0.06,) * 2
    for _ in range(120):
        commanded = braked(commanded, braking)
        at.set(wheel_speeds=commanded)
        for _ in range(25):
            at.state = state
            state = state + 1e-3 * at.rates()
    return float(state[0])


def foreseen_way(speed: float = 0.72) -> float:
    braking = MotionGuard().step.numbers.braking
    commanded: Any = (speed / 0.06,) * 2
    speeds, pose = commanded, (0.0, 0.0, 0.0)
    for _ in range(120):
        commanded = braked(commanded, braking)
        pose, speeds = roll_on(pose, speeds, commanded, braking)
    return float(pose[0])


def test_a5_the_plant_brakes_as_foreseen():
    """Rolling wheels, and tires that hold: 1.5 m/s^2 take a friction of 0.153."""
    for friction in (None, 0.6, 0.17):
        assert braking_way(friction) == pytest.approx(foreseen_way(), abs=1e-3)


def test_a5_broken_by_a_floor_on_which_tires_do_not_hold():
    """With 0.1 it slides on: v^2/(2 mu g) instead of v^2/2a, and the lag."""
    assert braking_way(0.1) > foreseen_way() + 0.02
    assert braking_way(0.1) == pytest.approx(0.72**2 / (2.0 * 0.1 * 9.81), rel=0.2)


@pytest.mark.slow
def test_a5_broken_in_a_run_by_commands_that_tires_cannot_obey():
    assert collides(4, {"plant": {"friction": 0.1}})


@pytest.mark.slow
def test_in_a_ring_of_sensors_what_moves_finds_the_robot_at_rest_or_withdrawing():
    """One body at 0.3 m/s: passive safety with ``obstacle_speed_m_s``, none without.

    The few that are hit in motion withdraw, or brake after they did.
    """
    moving = {0.0: 0, 0.3: 0}
    contacts = dict(moving)
    for bound in moving:
        for number in range(30):
            trial = draw_crossing(SEED, number, 1, 0.3)
            guard = {"guard": {"obstacle_speed_m_s": bound}}
            if speeds := contact_speeds(trial, guard):
                contacts[bound] += 1
                moving[bound] += speeds[0] > 0.005 or speeds[1] > 0.31
    assert contacts[0.3] > 10
    assert moving[0.0] > 10
    assert moving[0.3] <= 1
