"""Arrows in a replay are as long as what they stand for, and point its way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.views.overlays import commanded_velocity, overlays, scale_m_n
from analysis.views.scene import make_scene


def _arrows(run):
    layers = overlays(make_scene(run), np.zeros(1))
    return {thing.path: thing for layer in layers for thing in layer.things}


def _told(run, **columns):
    return replace(run, columns={**run.columns, **columns})


@pytest.mark.parametrize(
    ("greatest_n", "m_per_n"), [(1.0, 0.5), (4.0, 0.2), (30, 0.02)]
)
def test_one_newton_is_a_round_length_that_shows_the_greatest(
    ideal_run, greatest_n, m_per_n
):
    ones = np.ones_like(ideal_run.time)
    run = _told(
        ideal_run,
        attraction_x=greatest_n * ones,
        attraction_y=0.0 * ones,
        repulsion_x=0.0 * ones,
        repulsion_y=0.0 * ones,
    )
    assert scale_m_n(run) == pytest.approx(m_per_n)


def test_a_law_that_tells_no_forces_has_its_command_alone(ideal_run):
    columns = {k: v for k, v in ideal_run.columns.items() if "attraction" not in k}
    run = replace(ideal_run, columns=columns)
    assert scale_m_n(run) is None
    assert {"law/robot", "follow/robot"} == _arrows(run).keys()


def test_the_command_is_the_velocity_of_p_that_equal_wheels_give(ideal_run):
    """Both wheels at 5 rad/s, of 60 mm: 0.3 m/s along the heading."""
    ones = np.ones_like(ideal_run.time)
    run = _told(
        ideal_run,
        theta_WB=0.5 * ones,
        wheel_speed_left=5.0 * ones,
        wheel_speed_right=5.0 * ones,
    )
    wanted = 0.3 * np.array([math.cos(0.5), math.sin(0.5)])
    vectors = commanded_velocity(run)
    np.testing.assert_allclose(vectors, np.broadcast_to(wanted, vectors.shape))


def test_wheels_against_each_other_move_p_aside(ideal_run):
    """Turn rate 2 w r / d about the axle, P 0.175 m before it, to the left."""
    ones = np.ones_like(ideal_run.time)
    run = _told(
        ideal_run,
        theta_WB=0.0 * ones,
        wheel_speed_left=-1.0 * ones,
        wheel_speed_right=ones,
    )
    rate = 2.0 * 0.06 / 0.41
    np.testing.assert_allclose(commanded_velocity(run)[0], [0.0, 0.175 * rate])


def test_arrows_begin_at_p_and_have_the_size_of_the_force(crossing_run):
    m_per_n, seen = scale_m_n(crossing_run), 0
    arrow = _arrows(crossing_run)["forces/robot/repulsion"]
    for time, pose, scale in zip(arrow.times, arrow.poses, arrow.scale, strict=True):
        tick = round(time / 0.025)
        p = crossing_run.vector("p_WP")[:, tick]
        np.testing.assert_allclose(pose[:2], p, atol=1e-9)
        force = crossing_run.vector("repulsion")[:, tick]
        length = m_per_n * np.hypot(*force)
        if 1e-3 < length < 1.6:
            seen += 1
            assert scale[0] == pytest.approx(length)
            along = [math.cos(pose[2]), math.sin(pose[2])]
            np.testing.assert_allclose(along, force / np.hypot(*force), atol=1e-9)
    assert seen > 20
