"""Front or back: the recursion by hand, and what it must decide."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.front_back import (
    CHECK_AFTER_S,
    LARGEST_SCORE,
    MEMORY,
    SWITCH_MARGIN,
    Candidates,
    resolve,
)
from systems.source_tracker import TrackerParameters

TRACKER = TrackerParameters(source_top_speed_m_s=0.5, mirror_tolerance_m=0.15)
coordinate = st.floats(-5.0, 5.0)
points = st.tuples(coordinate, coordinate)


def checked(front, back, *, seconds: float = 0.5):
    """Memory after a first estimate at (2, 0) and (-2, 0), and the next one."""
    memory, chosen = resolve(Candidates.none(), [2.0, 0.0], [-2.0, 0.0], TRACKER)
    assert chosen == [2.0, 0.0], "front, while nothing speaks against it"
    memory = Candidates.older(memory, seconds)
    return resolve(memory, front, back, TRACKER)


def test_nothing_heard_does_not_age():
    assert Candidates.older(Candidates.none(), 1.0) == Candidates.none()


def test_scores_by_hand():
    """Front ran 0.85 m in 0.5 s, 0.6 m more than believable; back rests.

    Front costs (0.6 / 0.15)^2 = 16, and back nothing; both then fade.
    """
    memory, chosen = checked([2.0, 0.85], [-2.0, 0.0])
    assert chosen == [-2.0, 0.0]
    assert memory[:5] == [2.0, 0.85, -2.0, 0.0, 0.0]
    assert memory[5] == pytest.approx(MEMORY * 16.0)
    assert memory[6] == 0.0
    assert memory[7] == 1.0


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("lead", [SWITCH_MARGIN - 0.1, SWITCH_MARGIN + 0.1])
def test_verdict_turns_over_only_beyond_the_margin(behind, lead):
    """The candidate of the verdict pays ``lead`` more than the other one."""
    far = 0.5 * 0.5 + 0.15 * math.sqrt(lead)
    front, back = [2.0, 0.0 if behind else far], [-2.0, far if behind else 0.0]
    memory = [2.0, 0.0, -2.0, 0.0, 0.5, 0.0, 0.0, float(behind)]
    memory, chosen = resolve(memory, front, back, TRACKER)
    stays = lead < SWITCH_MARGIN
    assert chosen == (back if behind == stays else front)
    assert Candidates.behind(memory) == (behind == stays)


def test_a_believable_motion_costs_nothing():
    memory, chosen = checked([2.2, 0.1], [-2.2, 0.1])
    assert chosen == [2.2, 0.1]
    assert memory[5:] == [0.0, 0.0, 0.0]


def test_anchors_stay_until_the_check_is_due():
    memory, chosen = checked([2.0, 3.0], [-2.0, 0.0], seconds=CHECK_AFTER_S - 0.01)
    assert memory[:4] == [2.0, 0.0, -2.0, 0.0]
    assert chosen == [-2.0, 0.0], "but the choice looks at the new candidates"


def test_crossing_over_is_one_source_passing_by():
    """A source that passes the array swaps the candidates: paths may cross."""
    start = [0.05, 1.0], [-0.05, 1.0]
    memory, _ = resolve(Candidates.none(), *start, TRACKER)
    memory = [*start[0], *start[1], 0.5, 0.0, 20.0, 0.0]  # surely in front
    memory, chosen = resolve(memory, [0.1, 1.0], [-0.1, 1.0], TRACKER)
    assert chosen == [0.1, 1.0]
    assert memory[6] < 1.0, "the way from front to back was free"


@given(st.lists(st.tuples(points, points), min_size=1, max_size=12))
def test_scores_are_bounded_and_one_candidate_is_free(pairs):
    memory = Candidates.none()
    for front, back in pairs:
        memory, chosen = resolve(memory, [*front], [*back], TRACKER)
        assert chosen in ([*front], [*back])
        memory = Candidates.older(memory, 0.5)
    scores = memory[5:7]
    assert min(scores) == 0.0
    assert max(scores) <= MEMORY * LARGEST_SCORE


@given(st.floats(165.0, 255.0))
def test_the_image_of_a_resting_source_runs_when_the_robot_turns(direction_deg):
    """A source behind throughout a turn of 60 deg, heard every 0.5 s."""
    direction = math.radians(direction_deg)
    source = [2.0 * math.cos(direction), 2.0 * math.sin(direction)]
    memory = Candidates.none()
    chosen = None
    for theta in (0.0, math.pi / 9, 2 * math.pi / 9, math.pi / 3):
        normal = (math.cos(theta), math.sin(theta))
        ahead = source[0] * normal[0] + source[1] * normal[1]
        image = [source[i] - 2.0 * ahead * normal[i] for i in (0, 1)]
        memory, chosen = resolve(memory, image, source, TRACKER)
        memory = Candidates.older(memory, 0.5)
    assert chosen == source
