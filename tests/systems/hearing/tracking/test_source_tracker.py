"""The tracker: where an estimate is placed, what is held, and when it is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient

from phonotaxis.testing import Bench, assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.hearing.parameters import TrackerParameters
from systems.hearing.tracking.source_tracker import SourceTracker
from systems.hearing.tracking.tracker_model import (
    blank_track,
    past_pose,
    track_step,
    tracker_numbers,
)

pytestmark = pytest.mark.drake

PLAIN = TrackerParameters(hold="world")
#: As for ideal hearing: every source is where it is heard.
EXACT: Any = {"resolve_front_back": False, "floor_m": 0.0}
SILENT: dict[str, Any] = {
    "p_PS_B": [0.0, 0.0],
    "covariance": [0.0] * 4,
    "detected": [0.0],
    "range_valid": [0.0],
}
HEARD: dict[str, Any] = {
    "p_PS_B": [2.0, 1.0],
    "covariance": [0.04, 0.01, 0.01, 0.09],
    "detected": [1.0],
    "range_valid": [1.0],
}
NORTH = [1.0, 1.0, math.pi / 2]
HOLDS = ["world", "robot", "motion"]


def plain(**changes):
    return PLAIN.model_copy(update=changes)


def track_state(tracker, pose_1, pose_2=None, *, robot=None, exact=True):
    """State of a tracker that has heard nothing, with both past poses."""
    how = EXACT if exact else {}
    numbers = tracker_numbers(tracker, robot or RobotParameters(), 0.025, **how)
    state = blank_track(numbers, pose_1)
    state[3:6] = pose_2 or pose_1
    return state


class Steps:
    """Does one step after the other; the estimates have a range."""

    def __init__(self, tracker, robot, age, pose, *, exact=True):
        how = EXACT if exact else {}
        self.numbers = tracker_numbers(tracker, robot, age, **how)
        self.state, self.ticks = blank_track(self.numbers, pose), 0

    def step(self, pose, p_PS_B=None, covariance=(0.0,) * 4):
        """Target after an estimate, or after none."""
        flag = np.ones(1) * (p_PS_B is not None)
        estimate = np.zeros(2) if p_PS_B is None else np.array(p_PS_B)
        inputs = estimate, np.array(covariance), flag, flag, np.array(pose)
        outputs = tuple(map(np.zeros, (2, 2, 4, 1, 1)))
        track_step(self.ticks, self.state, inputs, outputs, self.numbers)
        self.ticks += 1
        return outputs[0]


def make_bench(tracker=PLAIN, *, pose=NORTH, heard=True, state=None, age=0.025):
    block = SourceTracker(tracker=tracker, measurement_age_s=age, exact=True)
    state = track_state(tracker, pose) if state is None else state
    signals = HEARD if heard else SILENT
    return Bench(block, state=state, pose_WB_estimated=pose, **signals)


def test_places_an_estimate_in_the_world():
    """P at (1, 1.175) facing north; 2 m ahead and 1 m to the left."""
    at = make_bench()
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 3.175], atol=1e-12)
    np.testing.assert_array_equal(at.output("v_WS_estimated"), [0.0, 0.0])
    assert at.output("target_valid")[0] == 1.0
    assert at.output("age")[0] == 0.025


@pytest.mark.parametrize("hold", HOLDS)
def test_covariance_turns_with_the_robot(hold):
    """A tick later a velocity of 0.35 m/s says 9 mm in each direction."""
    pose = [0.0, 0.0, 0.7]
    at = make_bench(plain(hold=hold), pose=pose)
    c, s = math.cos(0.7), math.sin(0.7)
    R = np.array([[c, -s], [s, c]])
    C = R @ np.array(HEARD["covariance"]).reshape(2, 2) @ R.T
    C += (0.35 * 0.025) ** 2 * np.eye(2)
    np.testing.assert_allclose(at.output("covariance_W"), C.ravel(), atol=1e-6)


def test_a_floor_adds_to_the_covariance_of_estimates_from_audio():
    less, more = (
        evaluate(
            SourceTracker(tracker=PLAIN, exact=exact),
            state=track_state(PLAIN, NORTH, exact=exact),
            pose_WB_estimated=NORTH,
            **HEARD,
        )["covariance_W"]
        for exact in (True, False)
    )
    np.testing.assert_allclose(more - less, [1e-4, 0.0, 0.0, 1e-4], atol=1e-12)


def test_an_estimate_belongs_to_the_pose_of_its_moment():
    """The robot has driven 0.1 m since: the source has not."""
    state = track_state(PLAIN, [1.0, 0.9, math.pi / 2])
    at = make_bench(state=state)
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 3.075], atol=1e-12)


@pytest.mark.parametrize(
    ("ticks", "x"),
    [(0.0, 4.0), (0.5, 3.5), (1.0, 3.0), (1.5, 2.0), (2.0, 1.0), (2.25, 0.5)],
)
def test_past_pose_lies_on_a_line_between_ticks(ticks, x):
    poses = np.outer([4.0, 3.0, 1.0, -1.0], [1.0, 0.0, 0.1])
    pose = past_pose(poses[0], poses[1:].ravel(), ticks)
    assert pose == pytest.approx([x, 0.0, x / 10])


def test_target_rests_in_the_world_between_bursts():
    at = make_bench().tick()
    at.set(**SILENT, pose_WB_estimated=[5.0, 5.0, 0.0])
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 3.175], atol=1e-12)


def test_target_moves_with_the_robot_when_held_so():
    """From the new pose, P at (5.175, 5), the target is (2, 1) ahead again."""
    at = make_bench(plain(hold="robot")).tick()
    at.set(**SILENT, pose_WB_estimated=[5.0, 5.0, 0.0])
    np.testing.assert_allclose(at.output("p_WS_estimated"), [7.175, 6.0], atol=1e-12)


def moving_source(hold: str):
    """A bench that has heard a source pass at 0.3 m/s along y, exactly, for 1 s."""
    at = make_bench(plain(hold=hold), pose=[0.0, 0.0, 0.0], heard=False)
    for tick in range(41):
        at.set(**HEARD | {"covariance": [0.0] * 4})
        at.set(p_PS_B=[2.0, 0.3 * 0.025 * tick])
        at.tick()
    at.set(**SILENT)
    return at


@pytest.mark.parametrize("hold", HOLDS)
def test_velocity_is_found_and_fades(hold):
    """Toward 0 with 5 s; what was found within 1 s is some 2 % less than 0.3."""
    at = moving_source(hold)
    first = at.output("v_WS_estimated")
    np.testing.assert_allclose(first, [0.0, 0.3], atol=0.01)
    for _ in range(40):
        at.tick()
    then = at.output("v_WS_estimated")
    np.testing.assert_allclose(then, first * math.exp(-1.0 / 5.0), atol=1e-12)


def test_target_goes_on_with_its_velocity_when_held_so():
    """After t the way is 5 s (1 - exp(-t / 5 s)) times the last velocity."""
    at, rests = moving_source("motion"), moving_source("world")
    held = rests.output("p_WS_estimated")
    np.testing.assert_allclose(held, [2.175, 0.3], atol=1e-12)
    for tick in range(40):
        # The last estimate is of a tick before its arrival, which was a tick ago.
        age = 0.025 * (tick + 2)
        kept = math.exp(-age / 5.0)
        way = at.output("v_WS_estimated") / kept * 5.0 * (1.0 - kept)
        np.testing.assert_allclose(at.output("p_WS_estimated"), held + way, atol=1e-12)
        at.tick()


@pytest.mark.parametrize("hold", ["world", "robot"])
def test_covariance_counts_where_the_source_is_expected_instead(hold):
    """E|x - held|^2 = E|x - expected|^2 + |held - expected|^2."""
    benches = [moving_source(name) for name in (hold, "motion")]
    for at in benches:
        for _ in range(40):
            at.tick()
    held, expected = (at.output("p_WS_estimated") for at in benches)
    C_held, C_expected = (at.output("covariance_W").reshape(2, 2) for at in benches)
    off = held - expected
    assert np.linalg.norm(off) > 0.2
    np.testing.assert_allclose(C_held, C_expected + np.outer(off, off), atol=1e-12)


def test_age_grows_by_a_tick_and_ends_in_a_lost_target():
    at = make_bench(plain(maximum_age_s=0.2)).tick()
    at.set(**SILENT)
    valid = []
    for tick in range(10):
        assert at.output("age")[0] == pytest.approx(0.05 + 0.025 * tick)
        valid.append(at.output("target_valid")[0])
        at.tick()
    # 0.05, 0.075 ... 0.175 are young enough; 0.2 is a matter of rounding.
    assert valid[:6] == [1.0] * 6
    assert valid[7:] == [0.0] * 3


@pytest.mark.parametrize("hold", HOLDS)
def test_nothing_heard_yet_is_no_target(hold):
    at = make_bench(plain(hold=hold), heard=False)
    for _ in range(3):
        assert at.output("target_valid")[0] == 0.0
        for name in ("p_WS_estimated", "v_WS_estimated", "covariance_W"):
            assert np.all(np.isfinite(at.output(name)))
        at.tick()


def test_first_bearing_alone_uses_the_assumed_range():
    at = make_bench()
    at.set(p_PS_B=[0.6, 0.8], range_valid=[0.0])
    expected = [1.0 - 0.8 * 3.0, 1.175 + 0.6 * 3.0]
    np.testing.assert_allclose(at.output("p_WS_estimated"), expected, atol=1e-12)


def test_bearings_are_taken_from_the_middle_of_the_microphones():
    """Which are 0.1 m behind P and 0.2 m to its left; north is ahead."""
    places = ((-0.1, 0.5), (-0.1, 0.2), (-0.1, -0.1))
    robot = RobotParameters(microphones_m=places)
    block = SourceTracker(robot=robot, tracker=PLAIN, exact=True)
    state = track_state(PLAIN, NORTH, robot=robot)
    at = Bench(block, state=state, pose_WB_estimated=NORTH, **HEARD)
    at.set(p_PS_B=[1.0, 0.0], range_valid=[0.0])
    expected = [1.0 - 0.2, 1.175 - 0.1 + 3.0]
    np.testing.assert_allclose(at.output("p_WS_estimated"), expected, atol=1e-12)


def test_a_bearing_moves_the_target_across_itself():
    """The target is at (0, 3.175), 2 m ahead of P and 1 m to the left."""
    at = make_bench().tick()
    u = np.array([2.0, 1.03]) / math.hypot(2.0, 1.03)
    n = np.array([-u[1], u[0]])
    C = 1e-8 * np.outer(n, n)
    at.set(p_PS_B=u, range_valid=[0.0], covariance=C.ravel())
    moved = at.output("p_WS_estimated") - [1.0, 1.175]
    ahead, left = moved[1], -moved[0]
    assert left / ahead == pytest.approx(1.03 / 2.0, abs=1e-5)
    assert math.hypot(ahead - 2.0, left - 1.0) < 0.03


@given(st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=8))
def test_exact_estimates_are_the_target(steps):
    """With no covariance the output is the last estimate, to rounding."""
    before, x = [0.0, 0.0, 0.3], 2.0
    tracker = Steps(PLAIN, RobotParameters(), 0.025, before)
    for step in steps:
        x += step
        pose = [step, x - 2.0, 0.3 + step]
        target = tracker.step(pose, [x, 1.0])
        a, b, theta = before
        c, s = math.cos(theta), math.sin(theta)
        expected = [a + c * (x + 0.175) - s, b + s * (x + 0.175) + c]
        np.testing.assert_allclose(target, expected, atol=1e-13)
        before = pose


def test_exact_estimates_have_the_derivative_of_the_target():
    """The identity, turned into W, whatever the tracker remembers."""
    at = moving_source("world")
    state = at.context.get_discrete_state(0).CopyToVector()
    block = at.block.ToAutoDiffXd()
    x = [AutoDiffXd(2.0, 2, 0), AutoDiffXd(0.31, 2, 1)]
    signals = HEARD | {"p_PS_B": x, "covariance": [0.0] * 4}
    dual = Bench(block, state=state, pose_WB_estimated=[0.0, 0.0, 0.0], **signals)
    gradient = ExtractGradient(dual.output("p_WS_estimated").reshape(-1, 1))
    np.testing.assert_allclose(gradient, np.eye(2), atol=1e-12)


def test_an_outlier_is_dropped_and_the_third_in_a_row_is_believed():
    """The target is at (0, 3.175); 9 m ahead is (0, 10.175)."""
    at = make_bench().tick()
    at.set(p_PS_B=[9.0, 1.0])
    for tick in range(2):
        np.testing.assert_allclose(
            at.output("p_WS_estimated"), [0.0, 3.175], atol=1e-12
        )
        assert at.output("age")[0] == pytest.approx(0.05 + 0.025 * tick)
        at.tick()
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 10.175], atol=1e-9)
    assert at.output("age")[0] == 0.025


def mirror_run(p_WS, tracker, *, turn_rate: float, microphones=None):
    """Targets while the robot turns on the spot and hears the candidate ahead."""
    robot = RobotParameters(**({"microphones_m": microphones} if microphones else {}))
    block = SourceTracker(robot=robot, tracker=tracker, measurement_age_s=0.0)
    state = track_state(tracker, [0.0, 0.0, 0.0], robot=robot, exact=False)
    at = Bench(block, state=state, pose_WB_estimated=[0.0] * 3, **HEARD)
    along_x = microphones is not None
    targets = []
    for tick in range(81):
        theta = turn_rate * 0.025 * tick
        c, s = math.cos(theta), math.sin(theta)
        x = c * p_WS[0] + s * p_WS[1] - 0.175
        y = -s * p_WS[0] + c * p_WS[1]
        heard = [x, abs(y)] if along_x else [abs(x), y]
        at.set(p_PS_B=heard, covariance=[1e-5, 0.0, 0.0, 1e-5])
        at.set(pose_WB_estimated=[0.0, 0.0, theta])
        targets.append(at.output("p_WS_estimated"))
        at.tick()
    return np.array(targets)


@pytest.mark.parametrize("p_WS", [(-2.0, 0.7), (-1.5, -1.0), (2.0, 0.7)])
def test_turning_tells_front_from_back(p_WS):
    targets = mirror_run(p_WS, TrackerParameters(), turn_rate=0.5)
    np.testing.assert_allclose(targets[-1], p_WS, atol=1e-3)


@pytest.mark.parametrize("p_WS", [(1.0, 1.7), (1.0, -1.7)])
def test_turning_tells_left_from_right_of_a_row_along_x(p_WS):
    """The candidate that is reported is the one to the left."""
    row = ((0.2, 0.0), (0.0, 0.0), (-0.2, 0.0))
    targets = mirror_run(p_WS, TrackerParameters(), turn_rate=0.5, microphones=row)
    np.testing.assert_allclose(targets[-1], p_WS, atol=1e-3)


@pytest.mark.parametrize("exact", [True, False])
def test_without_a_question_every_source_is_where_it_is_heard(exact):
    """Ideal hearing; or microphones in a triangle, which know."""
    triangle = ((0.2, 0.0), (-0.1, 0.2), (-0.1, -0.2))
    robot = RobotParameters(microphones_m=triangle)
    block = SourceTracker(robot=robot, exact=exact)
    state = track_state(TrackerParameters(), [0.0] * 3, robot=robot, exact=exact)
    assert len(state) == len(track_state(PLAIN, [0.0] * 3)), "one hypothesis each"
    outputs = evaluate(block, state=state, pose_WB_estimated=[0.0] * 3, **HEARD)
    np.testing.assert_allclose(outputs["p_WS_estimated"], [2.175, 1.0])


def test_a_measurement_cannot_be_older_than_two_seconds():
    with pytest.raises(ValueError, match=r"measurement_age_s is 2.5.*0 and 2"):
        SourceTracker(measurement_age_s=2.5)


def warm_memory(tracker, robot, *, exact):
    """A memory with tracks, velocities, costs and one doubtful frame."""
    steps = Steps(tracker, robot, 0.0375, [0.05, 0.1, 0.25], exact=exact)
    rng = np.random.default_rng(5)
    for k in range(12):
        pose = [0.05 + 0.004 * k, 0.1 + 0.008 * k, 0.25 + 0.01 * k]
        x, y = rng.normal([1.7, 0.6], 0.01) if k != 11 else (3.4, 0.6)
        steps.step(pose, [x, y], [1e-4, 2e-5, 2e-5, 2e-4])
    steps.step(pose)
    return steps.state


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("signal", ["fix", "bearing", "silence"])
@pytest.mark.parametrize("exact", [True, False])
def test_gradient(hold, signal, exact):
    """With respect to estimate, pose, past poses and the tracks' states."""
    robot = RobotParameters(control_point_m=0.2)
    tracker = TrackerParameters(hold=hold)
    memory = warm_memory(tracker, robot, exact=exact)
    # Past poses, and position and velocity of the track ahead, are moved.
    fixed = [f"state[{k}]" for k in (*range(9, 13), *range(17, len(memory)))]
    signals = HEARD | {"covariance": [1e-4, 2e-5, 2e-5, 2e-4]}
    if signal == "bearing":
        signals |= {"range_valid": [0.0], "covariance": [4e-6, 0.0, 0.0, 4e-5]}
    elif signal == "silence":
        signals |= {"detected": [0.0]}
    heard = [0.943, 0.331] if signal == "bearing" else [1.69, 0.61]
    block = SourceTracker(
        robot=robot, tracker=tracker, measurement_age_s=0.0375, exact=exact
    )
    assert_linearization(
        block,
        state=memory,
        pose_WB_estimated=[0.11, 0.2, 0.37],
        **signals | {"p_PS_B": heard},
        hold=[*HEARD.keys() - {"p_PS_B"}, *fixed],
    )
