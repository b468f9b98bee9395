"""The tracker: what is held, how old it is, and when it is lost."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.front_back import Candidates
from systems.robot import RobotParameters
from systems.source_tracker import (
    NEVER_HEARD_S,
    SourceTracker,
    Track,
    TrackerParameters,
    past_pose,
)

#: Ideal hearing's setting: every source is where it is heard.
PLAIN = TrackerParameters(resolve_front_back=False)
SILENT = {
    "p_PS_B": [0.0, 0.0],
    "covariance": [0.0] * 4,
    "detected": [0.0],
    "range_valid": [0.0],
}
HEARD = {
    "p_PS_B": [2.0, 1.0],
    "covariance": [0.04, 0.01, 0.01, 0.09],
    "detected": [1.0],
    "range_valid": [1.0],
}
NORTH = [1.0, 1.0, math.pi / 2]


def track_state(pose_1, pose_2=None, *, held=(0.0, 0.0), age=NEVER_HEARD_S):
    """The tracker's state with both past poses."""
    poses = (list(pose_1), list(pose_2 or pose_1))
    track = Track(*poses, list(held), [0.0] * 4, age, 0.0, Candidates.none())
    return track.pack()


def make_bench(bench, tracker=PLAIN, *, pose=NORTH, heard=True, state=None, age=0.025):
    block = SourceTracker(tracker=tracker, measurement_age_s=age)
    state = track_state(pose) if state is None else state
    signals = HEARD if heard else SILENT
    return bench(block, state=state, pose_WB_estimated=pose, **signals)


def hear(at, **signals) -> None:
    for name, value in signals.items():
        at.block.GetInputPort(name).FixValue(at.context, np.asarray(value, float))


def test_places_an_estimate_in_the_world(bench):
    """P at (1, 1.175) facing north; 2 m ahead and 1 m to the left."""
    at = make_bench(bench)
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 3.175], atol=1e-12)
    assert at.output("target_valid")[0] == 1.0
    assert at.output("age")[0] == 0.025


def test_covariance_turns_with_the_robot(bench):
    pose = [0.0, 0.0, 0.7]
    at = make_bench(bench, pose=pose)
    c, s = math.cos(0.7), math.sin(0.7)
    R = np.array([[c, -s], [s, c]])
    C = np.array(HEARD["covariance"]).reshape(2, 2)
    np.testing.assert_allclose(at.output("covariance_W"), (R @ C @ R.T).ravel())


def test_an_estimate_belongs_to_the_pose_of_its_moment(bench):
    """The robot has driven 0.1 m since: the source has not."""
    pose_1, pose = [1.0, 0.9, math.pi / 2], NORTH
    at = make_bench(bench, pose=pose, state=track_state(pose_1))
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 3.075], atol=1e-12)


@pytest.mark.parametrize(
    ("age", "x"), [(0.0, 4.0), (0.0125, 3.5), (0.025, 3.0), (0.0375, 2.0), (0.05, 1.0)]
)
def test_past_pose_lies_on_a_line_between_ticks(age, x):
    pose = past_pose([4.0, 0, 0.4], [3.0, 0, 0.3], [1.0, 0, 0.1], age)
    assert pose == pytest.approx([x, 0.0, x / 10])


def test_target_rests_in_the_world_between_bursts(bench):
    at = make_bench(bench).tick()
    hear(at, **SILENT, pose_WB_estimated=[5.0, 5.0, 0.0])
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 3.175], atol=1e-12)


def test_target_moves_with_the_robot_when_held_so(bench):
    """From the new pose, P at (5.175, 5), the target is (2, 1) ahead again."""
    tracker = TrackerParameters(hold="robot", resolve_front_back=False)
    at = make_bench(bench, tracker).tick()
    hear(at, **SILENT, pose_WB_estimated=[5.0, 5.0, 0.0])
    np.testing.assert_allclose(at.output("p_WS_estimated"), [7.175, 6.0], atol=1e-12)


def test_age_grows_by_a_tick_and_ends_in_a_lost_target(bench):
    tracker = TrackerParameters(maximum_age_s=0.2, resolve_front_back=False)
    at = make_bench(bench, tracker).tick()
    hear(at, **SILENT)
    valid = []
    for tick in range(10):
        assert at.output("age")[0] == pytest.approx(0.05 + 0.025 * tick)
        valid.append(at.output("target_valid")[0])
        at.tick()
    # 0.05, 0.075 ... 0.175 are young enough; 0.2 is a matter of rounding.
    assert valid[:6] == [1.0] * 6
    assert valid[7:] == [0.0] * 3


def test_nothing_heard_yet_is_no_target(bench):
    at = make_bench(bench, heard=False)
    for _ in range(3):
        assert at.output("target_valid")[0] == 0.0
        assert np.all(np.isfinite(at.output("p_WS_estimated")))
        at.tick()


def test_first_bearing_alone_uses_the_assumed_range(bench):
    at = make_bench(bench)
    hear(at, p_PS_B=[0.6, 0.8], range_valid=[0.0])
    expected = [1.0 - 0.8 * 3.0, 1.175 + 0.6 * 3.0]
    np.testing.assert_allclose(at.output("p_WS_estimated"), expected, atol=1e-12)


def test_covariance_of_a_bearing_grows_with_the_range_it_is_given(bench):
    """0.01 rad across, at 3 m: 0.03 m; facing north, across is along x of W."""
    at = make_bench(bench)
    covariance = [0.0, 0.0, 0.0, 1e-4]
    hear(at, p_PS_B=[1.0, 0.0], covariance=covariance, range_valid=[0.0])
    expected = [9e-4, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(at.output("covariance_W"), expected, atol=1e-15)


@pytest.mark.parametrize("hold", ["world", "robot"])
def test_later_bearings_keep_the_last_range(bench, hold):
    tracker = TrackerParameters(hold=hold, resolve_front_back=False, jump_m=1.0)
    at = make_bench(bench, tracker).tick()
    hear(at, p_PS_B=[0.8, 0.6], range_valid=[0.0])
    r = math.sqrt(5)
    expected = [1.0 - 0.6 * r, 1.175 + 0.8 * r]
    np.testing.assert_allclose(at.output("p_WS_estimated"), expected, atol=1e-9)


def test_a_new_estimate_replaces_the_target_at_once(bench):
    at = make_bench(bench).tick()
    hear(at, p_PS_B=[2.2, 1.2])
    np.testing.assert_allclose(at.output("p_WS_estimated"), [-0.2, 3.375], atol=1e-12)


def test_an_outlier_is_dropped_and_the_third_in_a_row_is_believed(bench):
    """The target is at (0, 3.175); 9 m ahead is (0, 10.175)."""
    at = make_bench(bench).tick()
    hear(at, p_PS_B=[9.0, 1.0])
    for _ in range(2):
        np.testing.assert_allclose(
            at.output("p_WS_estimated"), [0.0, 3.175], atol=1e-12
        )
        at.tick()
    np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, 10.175], atol=1e-12)


def test_an_old_target_may_have_moved_far(bench):
    """1.5 s at 0.5 m/s and 0.3 m: 1.05 m, not 1.1 m."""
    for distance, believed in ((1.0, True), (1.1, False)):
        state = track_state(NORTH, held=(0.0, 3.175), age=1.5)
        at = make_bench(bench, state=state)
        hear(at, p_PS_B=[2.0 + distance, 1.0])
        y = 3.175 + (distance if believed else 0.0)
        np.testing.assert_allclose(at.output("p_WS_estimated"), [0.0, y], atol=1e-12)


def mirror_run(bench, p_WS, tracker, *, turn_rate: float):
    """Targets while the robot turns on the spot and hears the front image."""
    at = make_bench(bench, tracker, pose=[0.0, 0.0, 0.0], age=0.0)
    targets = []
    for tick in range(81):
        theta = turn_rate * 0.025 * tick
        c, s = math.cos(theta), math.sin(theta)
        x = c * p_WS[0] + s * p_WS[1] - 0.175
        y = -s * p_WS[0] + c * p_WS[1]
        hear(at, p_PS_B=[abs(x), y], pose_WB_estimated=[0.0, 0.0, theta])
        targets.append(at.output("p_WS_estimated"))
        at.tick()
    return np.array(targets)


@pytest.mark.parametrize("p_WS", [(-2.0, 0.7), (-1.5, -1.0), (2.0, 0.7)])
def test_turning_tells_front_from_back(bench, p_WS):
    targets = mirror_run(bench, p_WS, TrackerParameters(), turn_rate=0.5)
    np.testing.assert_allclose(targets[-1], p_WS, atol=1e-9)


def test_without_the_resolver_every_source_is_in_front(bench):
    targets = mirror_run(bench, (-2.0, 0.7), PLAIN, turn_rate=0.0)
    np.testing.assert_allclose(targets[-1], [2.35, 0.7], atol=1e-9)


def test_a_measurement_cannot_be_older_than_two_ticks():
    with pytest.raises(ValueError, match=r"measurement_age_s is 0.06.*0 and 0.05"):
        SourceTracker(measurement_age_s=0.06)


@pytest.mark.parametrize("hold", ["world", "robot"])
@pytest.mark.parametrize("heard", [True, False])
def test_gradient(bench, check_gradient, hold, heard):
    """With respect to estimate, pose and the whole memory."""
    tracker = TrackerParameters(hold=hold, resolve_front_back=False)
    memory = track_state([0.1, 0.2, 0.3], [0.05, 0.1, 0.25], held=(1.5, -0.4), age=0.5)

    def respond(block, x):
        state = [*x[5:13], *memory[8:]]
        signals = HEARD | {"p_PS_B": x[:2], "detected": [float(heard)]}
        at = bench(block, state=state, pose_WB_estimated=x[2:5], **signals)
        outputs = [*at.output("p_WS_estimated"), *at.output("covariance_W")]
        return [*outputs, *at.output("age"), *at.updated()]

    robot = RobotParameters(control_point_m=0.2)
    block = SourceTracker(robot=robot, tracker=tracker, measurement_age_s=0.0375)
    check_gradient(block, respond, [1.7, 0.6, 0.15, 0.3, 0.35, *memory[:8]])


def test_gradient_through_the_resolver(bench, check_gradient):
    def respond(block, x):
        signals = HEARD | {"p_PS_B": x[:2]}
        state = [*memory[:14], 1.2, 0.9, -1.3, 0.8, 0.5, 0.3, 1.1, 0.0]
        at = bench(block, state=state, pose_WB_estimated=x[2:5], **signals)
        return [*at.output("p_WS_estimated"), *at.updated()]

    memory = track_state([0.1, 0.2, 0.3], age=0.5)
    check_gradient(SourceTracker(), respond, [1.7, 0.6, 0.15, 0.3, 0.35])
