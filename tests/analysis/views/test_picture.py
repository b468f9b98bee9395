"""The pictures show the run: every artist is compared with the run's columns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon, Rectangle, Wedge

from analysis.report.palette import COLORS
from analysis.runs.contact import contact_point
from analysis.runs.known_space import known_space
from analysis.views.bursts import sound_bursts
from analysis.views.framing import bounds
from analysis.views.picture import plot_trajectory
from analysis.views.time_series import plot_time_series
from diagrams import load_scenario, simulate

PANELS = 5


def _patches(figure, kind, prefix=""):
    patches = [p for p in figure.axes[0].patches if isinstance(p, kind)]
    return [p for p in patches if (p.get_gid() or "").startswith(prefix)]


def _line(axes, label):
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return line


def _corners(patch):
    return patch.get_xy()[:4]


def test_footprints_are_the_robot_at_their_time(crossing_run):
    columns = crossing_run.columns
    patches = _patches(plot_trajectory(crossing_run), Polygon, "robot at ")
    assert len(patches) >= 3
    for patch in patches:
        tick = round(float(patch.get_gid().removeprefix("robot at ")) / 0.025)
        corners = _corners(patch)
        sides = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        assert sorted(sides[:2]) == pytest.approx([0.35, 0.82])
        center = (columns["p_WB_x"][tick], columns["p_WB_y"][tick])
        assert corners.mean(axis=0) == pytest.approx(center)


def test_footprints_are_the_first_and_the_last(crossing_run):
    patches = _patches(plot_trajectory(crossing_run), Polygon, "robot at ")
    times = [float(p.get_gid().removeprefix("robot at ")) for p in patches]
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(crossing_run.simulated_s)


def test_microphones_lie_on_the_front_edge(ideal_run):
    axes = plot_trajectory(ideal_run).axes[0]
    bars = [line for line in axes.get_lines() if line.get_marker() == "o"]
    first = next(line for line in bars if np.size(line.get_xdata()) == 3)
    places = [[0.175, 0.4], [0.175, 0.0], [0.175, -0.4]]
    np.testing.assert_allclose(np.array(first.get_data()).T, places, atol=1e-9)


def test_paths_are_the_columns(crossing_run):
    axes, columns = plot_trajectory(crossing_run).axes[0], crossing_run.columns
    robot = _line(axes, "path of the control point P")
    assert np.array_equal(robot.get_xdata(), columns["p_WP_x"])
    assert np.array_equal(robot.get_ydata(), columns["p_WP_y"])
    source = _line(axes, "path of the source")
    assert np.array_equal(source.get_xdata(), columns["p_WS_x"])


def test_estimates_are_the_heard_frames_and_grow_stronger(crossing_run):
    columns = crossing_run.columns
    axes = plot_trajectory(crossing_run).axes[0]
    crosses = axes.collections[0]
    # The target goes by an estimate from the tick after it on.
    heard = np.r_[False, columns["detected"][:-1] > 0.5]
    # Half a second in two sounds, for 16 s: 8 bursts of 20 frames.
    assert 140 <= np.count_nonzero(heard) <= 180
    places = np.column_stack(
        [columns["p_WS_estimated_x"][heard], columns["p_WS_estimated_y"][heard]]
    )
    assert np.array_equal(np.asarray(crosses.get_offsets()), places)
    strength = np.asarray(crosses.get_edgecolor())[:, 3]
    assert np.all(np.diff(strength) > 0.0)


def test_a_resting_obstacle_is_filled_where_it_stands(crossing_run):
    (box,) = _patches(plot_trajectory(crossing_run), Polygon, "obstacle box")
    assert box.get_fill()
    assert _corners(box).min(axis=0) == pytest.approx([2.55, 0.775])
    assert _corners(box).max(axis=0) == pytest.approx([2.65, 0.825])


def cart_way(time):
    """4 m at 0.3 m/s, with 1 m/s^2 at the start and the end."""
    left = max(4.0 / 0.3 + 0.3 - time, 0.0)
    if time < 0.3:
        return 0.5 * time**2
    return 4.0 - 0.5 * left**2 if left < 0.3 else 0.3 * time - 0.045


def test_a_moving_obstacle_is_outlined_with_its_time(crossing_run):
    figure = plot_trajectory(crossing_run)
    outlines = _patches(figure, Polygon, "obstacle cart at ")
    assert len(outlines) >= 3
    texts = {text.get_text() for text in figure.axes[0].texts}
    for patch in outlines:
        time = float(patch.get_gid().removeprefix("obstacle cart at "))
        y = -2.0 + cart_way(time)
        assert not patch.get_fill()
        assert _corners(patch).mean(axis=0) == pytest.approx([3.0, y])
        assert f"{time:g} s" in texts


def test_cones_open_30_degrees_up_to_the_range_read(crossing_run):
    columns = crossing_run.columns
    cones = _patches(plot_trajectory(crossing_run), Wedge)
    assert len(cones) % 3 == 0
    assert len(cones) >= 6
    read = np.column_stack([columns[f"range_{k}"] for k in (1, 2, 3)])
    echo = np.column_stack([columns[f"echo_{k}"] for k in (1, 2, 3)]) > 0.5
    for index, cone in enumerate(cones):
        assert cone.theta2 - cone.theta1 == pytest.approx(30.0)
        sensor = 3 * index // len(cones)
        ticks = np.flatnonzero(read[:, sensor] == cone.r)
        color = "echo" if echo[ticks[0], sensor] else "empty"
        assert cone.get_facecolor()[:3] == pytest.approx(to_rgb(COLORS[color]))
    kinds = {cone.get_facecolor()[:3] for cone in cones}
    assert len(kinds) == 2


def test_the_middle_cone_looks_ahead(crossing_run):
    # At the start the robot faces along x.
    cones = _patches(plot_trajectory(crossing_run), Wedge)
    left, middle, right = cones[:: len(cones) // 3]
    assert (middle.theta1, middle.theta2) == pytest.approx((-15.0, 15.0))
    assert left.theta1 == pytest.approx(15.0)
    assert right.theta2 == pytest.approx(-15.0)
    assert middle.center == pytest.approx((0.175, 0.0))


def test_ideal_sensing_draws_no_cones(ideal_run):
    assert _patches(plot_trajectory(ideal_run), Wedge) == []


def test_the_contact_lies_on_the_face_that_was_hit(collision_run):
    assert collision_run.cause == "collision"
    x, y = contact_point(collision_run)
    # The box fills 0.85 < x < 1.15, -0.05 < y < 0.25; a tick is at most 18 mm.
    assert x == pytest.approx(0.85, abs=0.02)
    assert -0.05 - 1e-9 <= y <= 0.25 + 1e-9
    star = _line(plot_trajectory(collision_run).axes[0], "where they touched")
    assert star.get_xdata()[0] == x


def test_what_was_hit_is_drawn_where_it_was_and_the_star_does_not_hide_it(
    collision_run,
):
    figure = plot_trajectory(collision_run)
    (hit,) = _patches(figure, Polygon, "hit")
    assert _corners(hit).mean(axis=0) == pytest.approx([1.0, 0.1])
    assert hit.get_facecolor()[:3] == pytest.approx(to_rgb(COLORS["hit"]))
    star = _line(figure.axes[0], "where they touched")
    assert star.get_markerfacecolor() == "none"


def test_a_room_has_its_walls_and_an_interferer_its_color(ideal_run):
    overrides = [
        "obstacle_sensing=ideal",
        "room={size_m: [8.0, 9.0, 3.0], corner_m: [-1.5, -2.5]}",
        "sources={leader: {}, radio: {body: false, waypoints_m: [[3, 3]]}}",
    ]
    scenario = load_scenario("default", overrides)
    figure = plot_trajectory(replace(ideal_run, scenario=scenario))
    (walls,) = _patches(figure, Rectangle, "room")
    assert walls.get_bbox().extents == pytest.approx([-1.5, -2.5, 6.5, 6.5])
    axes = figure.axes[0]
    (x_low, x_high), (y_low, y_high) = axes.get_xlim(), axes.get_ylim()
    assert x_low < -1.5
    assert x_high > 6.5
    assert y_low < -2.5
    assert y_high > 6.5
    radio = _line(axes, "radio (not followed)")
    assert radio.get_color() == COLORS["interferer"]
    assert radio.get_xydata()[0] == pytest.approx([3.0, 3.0])
    assert _line(axes, "path of leader").get_color() == COLORS["source"]


def test_a_run_without_collision_has_no_contact(ideal_run):
    with pytest.raises(ValueError, match="completed"):
        contact_point(ideal_run)


def test_the_title_tells_scenario_law_and_cause(collision_run):
    title = plot_trajectory(collision_run).axes[0].get_title()
    assert "default, law none: collision with box (robot's fault)" in title


def test_the_map_is_to_scale_and_the_legend_hides_nothing(crossing_run):
    figure = plot_trajectory(crossing_run)
    figure.canvas.draw()
    axes = figure.axes[0]
    box = axes.get_window_extent()
    x_low, x_high = axes.get_xlim()
    y_low, y_high = axes.get_ylim()
    assert box.width / (x_high - x_low) == pytest.approx(
        box.height / (y_high - y_low), rel=1e-6
    )
    legend = figure.legends[0].get_window_extent()
    assert legend.y0 >= 0.0
    labeled = axes.get_tightbbox()
    assert labeled is not None
    assert legend.y1 <= labeled.y0
    assert legend.x1 <= figure.bbox.x1


def test_bearings_are_in_degrees_and_ranges_in_meters(crossing_run):
    columns = crossing_run.columns
    ranges, bearings = plot_time_series(crossing_run).axes[:2]
    assert np.array_equal(
        _line(ranges, "true").get_ydata(), columns["source_range_true"]
    )
    assert np.array_equal(
        _line(ranges, "estimated").get_ydata(), columns["source_range"], equal_nan=True
    )
    assert _line(ranges, "follow distance").get_ydata()[0] == pytest.approx(
        crossing_run.scenario.follower.attraction.follow_distance_m
    )
    estimated = np.asarray(_line(bearings, "estimated").get_ydata())
    expected = columns["source_bearing"] * 180.0 / math.pi
    np.testing.assert_allclose(estimated, expected, rtol=1e-12)


def test_forces_and_speeds_are_those_of_the_columns(crossing_run):
    columns = crossing_run.columns
    forces, speeds, turning = plot_time_series(crossing_run).axes[2:5]
    for name in ("attraction", "repulsion"):
        squared = columns[f"{name}_x"] ** 2 + columns[f"{name}_y"] ** 2
        drawn = np.asarray(_line(forces, name).get_ydata())
        np.testing.assert_allclose(drawn**2, squared, atol=1e-12)
    # A robot that rolls without slip moves along its heading only.
    forward = np.asarray(_line(speeds, "robot, forward").get_ydata())
    squared = columns["v_WB_x"] ** 2 + columns["v_WB_y"] ** 2
    np.testing.assert_allclose(forward**2, squared, atol=1e-9)
    rim = np.asarray(_line(speeds, "left wheel, command").get_ydata())
    np.testing.assert_allclose(rim, 0.06 * columns["wheel_speed_left"], atol=1e-12)
    rate = np.asarray(_line(turning, "robot, to the left").get_ydata())
    np.testing.assert_allclose(rate, np.degrees(columns["omega_WB"]))


def test_each_burst_is_shaded_in_every_panel(crossing_run):
    figure = plot_time_series(crossing_run)
    assert len(figure.axes) == PANELS
    for axes in figure.axes:
        shades = [p for p in axes.patches if isinstance(p, Rectangle)]
        # Each has a line along its foot.
        for height in (1.0, 0.025):
            spans = [
                (p.get_x(), p.get_width()) for p in shades if p.get_height() == height
            ]
            np.testing.assert_allclose(spans, [(2.0 * k, 0.5) for k in range(8)])


def test_a_burst_ends_with_the_run(collision_run):
    sound = collision_run.scenario.source.sound
    assert sound_bursts(sound, 2.2) == [(0.0, 0.5), (2.0, 2.2)]


def test_the_clearance_panel_marks_the_least(crossing_run):
    clearance = np.abs(crossing_run.time - 4.0) + 0.25
    figure = plot_time_series(crossing_run, clearance)
    assert len(figure.axes) == PANELS + 1
    mark = _line(figure.axes[-1], "least: 0.25 m")
    assert mark.get_xdata()[0] == pytest.approx(4.0)
    assert np.array_equal(
        _line(figure.axes[-1], "to nearest body").get_ydata(), clearance
    )


def test_a_clearance_of_another_run_is_refused(crossing_run):
    with pytest.raises(ValueError, match=r"clearance: .*of this run"):
        plot_time_series(crossing_run, np.zeros(3))


def test_a_run_of_one_tick_can_be_drawn(shortest_run):
    assert len(shortest_run.time) == 1
    figure = plot_trajectory(shortest_run)
    assert len(_patches(figure, Polygon, "robot at ")) == 1
    axes = plot_time_series(shortest_run, np.array([0.4])).axes
    assert axes[0].get_xlim()[1] > 0.0


def test_a_guarded_run_lies_on_what_the_robot_knew_last(guarded_run):
    """The picture's cells are those of the log, in its place; no cone hides them."""
    figure = plot_trajectory(guarded_run)
    axes = figure.axes[0]
    known = known_space(guarded_run, guarded_run.simulated_s)
    assert known is not None
    (layer,) = axes.get_images()
    assert layer.get_extent() == pytest.approx(known.extent)
    shown = np.asarray(layer.get_array())[:, :, 3] > 0.0
    assert np.array_equal(shown, known.free[0].T)
    dots = np.array(_line(axes, "places that echoes came from").get_data()).T
    assert np.array_equal(dots, known.middles(known.hits[0] > 0.0))
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "seen as free at the end" in texts
    assert not _patches(figure, Wedge)
    # Light enough to read what is drawn on it: the layer leaves 0.87 of white.
    assert np.asarray(layer.get_array())[:, :, 3].max() == pytest.approx(0.13)


def test_the_map_of_a_guarded_run_has_the_limits_of_the_run(guarded_run, crossing_run):
    axes = plot_trajectory(guarded_run).axes[0]
    known = known_space(guarded_run, guarded_run.simulated_s)
    assert known is not None
    x_low, x_high, y_low, y_high = bounds(guarded_run, margin=0.7)
    assert axes.get_xlim() == pytest.approx((x_low, x_high))
    assert axes.get_ylim()[0] <= y_low
    assert axes.get_ylim()[1] >= y_high
    assert known.extent[3] > axes.get_ylim()[1]
    assert not plot_trajectory(crossing_run).axes[0].get_images()


def test_panels_of_a_guard_show_its_columns(guarded_run):
    figure, columns = plot_time_series(guarded_run), guarded_run.columns
    assert len(figure.axes) == PANELS + 2
    actions, distances = figure.axes[-2:]
    middles = guarded_run.time + 0.5 * guarded_run.scenario.tick_s
    for number, bars in enumerate(actions.collections):
        covered = np.zeros(len(middles), dtype=bool)
        for bar in bars.get_paths():
            times = np.asarray(bar.vertices)[:, 0]
            covered |= (times.min() < middles) & (middles < times.max())
        assert np.array_equal(covered, columns["guard_action"] == number)
    named = [text.get_text() for text in actions.get_yticklabels()]
    assert named == ["passed", "slowed", "turned", "braked", "halted"]
    spare = _line(distances, "to spare").get_ydata()
    assert np.array_equal(spare, columns["guard_distance"])
    way = _line(distances, "needed to stop").get_ydata()
    assert np.array_equal(way, columns["guard_stopping_distance"])
    labels = [line.get_label() for line in distances.get_lines()]
    assert "to spare, obstacles in view" not in labels


def test_robots_know_each_its_own_floor():
    overrides = ["hearing=ideal", "guard={}", "duration_s=1"]
    run = simulate(load_scenario("two_followers", overrides))
    layers = plot_trajectory(run).axes[0].get_images()
    assert len(layers) == len(run.robots) == 2
    for layer, own in zip(layers, run.robots.values(), strict=True):
        known = known_space(own, own.simulated_s)
        assert known is not None
        assert layer.get_extent() == pytest.approx(known.extent)


def test_a_robot_on_a_route_which_hears_nothing_has_its_goal_and_target():
    result = simulate(load_scenario("robots_2", ["duration_s=1"]))
    labels = plot_trajectory(result).axes[0].get_legend_handles_labels()[1]
    assert {"goals", "paths of the targets"} <= set(labels)
    assert not [label for label in labels if "estimates" in label]
