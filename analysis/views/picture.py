"""Draws pictures of a run: the run from above, and quantities over time."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from analysis.reporting.body_labels import spread_labels
from analysis.reporting.notebook_figure import NotebookFigure
from analysis.reporting.palette import COLOURS, draw_grid
from analysis.runs.guarded_motion import GUARD_ACTIONS, guarded_motion
from analysis.runs.known_space import known_space
from analysis.views.plume_history import concentration_map, plume_history
from analysis.views.scene import bounds, looks, run_title, sound_bursts
from analysis.views.search_panels import call_time, search_panels
from analysis.views.trajectory_artists import (
    draw_collision,
    draw_cones,
    draw_estimates,
    draw_known_space,
    draw_obstacles,
    draw_robot,
    draw_room,
    draw_sources,
    times_apart,
)
from diagrams import RunResult
from systems.framework.input_error import InputError

#: Function that draws one quantity of one robot over time.
Panel = Callable[[Axes, RunResult], None]

#: Largest number of characters per line of a title.
LONGEST_LINE = 80

#: Width of the pictures, inch.
WIDTH_IN = 8.0
#: Space around the map for labels, title and legend, inch.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN = 0.75, 0.15, 1.3, 0.5


def plot_trajectory(result: RunResult) -> Figure:
    """Draws the run from above, in the world frame W.

    At a few times, the picture shows:

    - the rectangle of the robot with its microphone bar
    - the source and the moving obstacles
    - the cones of the range sensors, up to the range readings

    Labels show the times. With ideal obstacle sensing, there are no cones. For a robot
    with a safety guard, the floor that the robot knew at the end replaces the cones.

    Crosses show the source positions that the robot estimated. Early estimates are
    faint, and late estimates are strong.

    Args:
        result: Result of the run.

    Returns:
        Picture with axes in m.
    """
    figure, axes = map_axes(result)
    draw_grid(axes)
    axes.set_title(_title(result), fontsize=11)
    for look in looks(result):
        known = known_space(look.result, look.result.simulated_s)
        if known is None:
            draw_cones(axes, look.result, times_apart(look.result))
        else:
            # The map replaces the cones, which would hide the map.
            draw_known_space(axes, look, known)
    draw_room(axes, result)
    draw_obstacles(axes, result)
    if result.full_scenario.odor is not None:
        _draw_odor(axes, result)
    shown = looks(result)
    draw_sources(axes, result, times_apart(shown[0].result))
    for look in shown:
        draw_estimates(axes, look)
        draw_robot(axes, look, times_apart(look.result))
    draw_collision(axes, result)
    spread_labels(axes)
    handles, labels = axes.get_legend_handles_labels()
    shown_once = dict(zip(labels, handles, strict=True))
    figure.legend(
        shown_once.values(),
        shown_once,
        loc="lower center",
        ncols=3,
        fontsize=8.5,
        frameon=False,
    )
    return figure


def _draw_odor(axes: Axes, result: RunResult) -> None:
    """Draws the odor source, and its plume at the end of the run."""
    odor = result.full_scenario.odor
    assert odor is not None
    last = None
    for instant in plume_history(result.full_scenario, result.simulated_s):
        last = instant
    x = np.linspace(*axes.get_xlim(), 121)
    y = np.linspace(*axes.get_ylim(), 81)
    if last is not None:
        dense = concentration_map(last.plume, x, y)
        levels = [0.1, 0.3, 1.0, 3.0, 1e9]
        tints = ["#F3E6EF", "#E7CCDF", "#D9AECB", "#C98BB5"]
        axes.contourf(x, y, dense, levels=levels, colors=tints, zorder=0.5)
        edge = COLOURS["odor"]
        axes.contour(
            x, y, dense, levels=levels[:1], colors=edge, linewidths=0.5, zorder=0.6
        )
        label = "odor at the end (0.1, 0.3, 1, 3 times C1)"
        axes.scatter([], [], marker="s", s=40, color="#D9AECB", label=label)
    place = odor.position_m
    style: dict[str, Any] = {"color": COLOURS["odor"], "ms": 12, "ls": "none"}
    axes.plot(*place, "*", label="source of odour", **style)


def heard_bursts(result: RunResult) -> list[tuple[float, float]]:
    """Returns the bursts of the source that the robot hears.

    If the robot listens to another robot that calls, the bursts begin after the call.

    Args:
        result: Result of a run, for one robot.

    Returns:
        Start and end of each burst, s. The list is empty if the robot drives to a goal.
    """
    if result.scenario.only.has_goal:
        return []
    sound, whole = result.scenario.source.sound, result.full_scenario
    caller = whole.robots.get(whole.target(result.name))
    if caller is not None and caller.searches == "odor":
        since = call_time(result)
        if since is None:
            return []
        sound = sound.model_copy(update={"start_s": since + sound.start_s})
    return sound_bursts(sound, result.simulated_s)


def map_axes(result: RunResult) -> tuple[Figure, Axes]:
    """Makes axes with equal scales that show all bodies, with space for a legend below.

    The aspect ratio of the axes is limited. If necessary, the axes show more of the
    floor.

    Args:
        result: Result of the run.

    Returns:
        Two values. The first value is the figure. The second value is its axes, in the
        world frame W, m.
    """
    x_low, x_high, y_low, y_high = bounds(result, margin=0.7)
    width = WIDTH_IN - LEFT_IN - RIGHT_IN
    tallest, flattest = 1.3 * width, 0.4 * width
    more = max((y_high - y_low) * width / tallest - (x_high - x_low), 0.0) / 2.0
    x_low, x_high = x_low - more, x_high + more
    more = max((x_high - x_low) * flattest / width - (y_high - y_low), 0.0) / 2.0
    y_low, y_high = y_low - more, y_high + more
    height = width * (y_high - y_low) / (x_high - x_low)
    total = BELOW_IN + height + ABOVE_IN
    figure = NotebookFigure(figsize=(WIDTH_IN, total))
    axes = figure.add_axes(
        (LEFT_IN / WIDTH_IN, BELOW_IN / total, width / WIDTH_IN, height / total)
    )
    axes.set(aspect="equal", xlim=(x_low, x_high), ylim=(y_low, y_high))
    axes.xaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))
    axes.set(xlabel="x in W (m)", ylabel="y in W (m)")
    return figure, axes


def plot_time_series(result: RunResult, clearance: ArrayLike | None = None) -> Figure:
    """Draws measured, estimated and commanded quantities over time.

    Bursts of the source are shaded.

    Args:
        result: Result of a run, for one robot.
        clearance: (n,) distance from the robot to the nearest body at each tick
            (control period), m (``analysis.runs.proximity``). With None, the picture
            has no panel of the clearance.

    Returns:
        Picture with one panel per quantity. If the robot has a safety guard, one panel
        shows the actions of the guard. Another panel shows the distance that the robot
        has to spare.

    Raises:
        InputError: ``clearance`` does not have one value per tick.
    """
    hears = not result.scenario.only.has_goal
    panels = time_panels(result)
    distance = None if clearance is None else np.asarray(clearance, dtype=float)
    if distance is not None and distance.shape != result.time.shape:
        raise InputError(
            "clearance",
            f"{distance.shape} values for {result.time.shape} ticks; give the "
            "clearance of this run (analysis.runs.proximity)",
        )
    if distance is not None:
        panels.append(clearance_panel(distance))
    rows = len(panels)
    figure = NotebookFigure(figsize=(WIDTH_IN, 1.0 + 1.55 * rows), layout="constrained")
    all_axes = np.atleast_1d(figure.subplots(rows, sharex=True))
    for axes, panel in zip(all_axes, panels, strict=True):
        panel(axes, result)
    bursts = heard_bursts(result)
    for axes in all_axes:
        for start, end in bursts:
            axes.axvspan(start, end, color=COLOURS["sound"], alpha=0.25, linewidth=0)
            # Yellow is hard to see on white. The line at the bottom is easy to see.
            axes.axvspan(start, end, ymax=0.025, color=COLOURS["sounding"], linewidth=0)
        draw_grid(axes, "y")
        axes.legend(
            loc="upper left",
            bbox_to_anchor=(1.005, 1.03),
            fontsize=8,
            frameon=False,
            handlelength=1.5,
        )
    all_axes[-1].set(
        xlabel="time (s)" + (", shaded while the source sounds" if hears else ""),
        xlim=(0.0, max(result.simulated_s, 1e-3)),
    )
    figure.suptitle(_title(result), fontsize=11)
    figure.align_ylabels(list(all_axes))
    return figure


def time_panels(result: RunResult) -> list[Panel]:
    """Returns all panels of a run's picture over time, except that of the clearance.

    Args:
        result: Result of a run, for one robot.

    Returns:
        Functions that draw one panel each. Their arguments are the axes and the result.
    """
    panels: list[Panel] = (
        [_goal] if result.scenario.only.has_goal else [_range, _bearing]
    )
    if result.scenario.only.searches is not None:
        panels = search_panels(result)
    if "attraction_x" in result.columns:  # not all laws log forces
        panels.append(_forces)
    if "stiffness" in result.columns:
        panels.append(_gains)
    panels += [_speeds, _turning]
    if guarded_motion(result) is not None:
        panels += [_guard_actions, _guard_distances]
    return panels


def _title(result: RunResult) -> str:
    fault = f" ({result.collision.fault}'s fault)" if result.collision else ""
    title = f"{run_title(result)}{fault} after {result.simulated_s:.1f} s"
    return textwrap.fill(title, LONGEST_LINE)


def _heard(axes: Axes, result: RunResult, values: NDArray[np.float64]) -> None:
    axes.plot(
        result.time,
        values,
        ".",
        color=COLOURS["estimate"],
        markersize=4,
        label="estimated",
        zorder=3,
    )


def _range(axes: Axes, result: RunResult) -> None:
    columns = result.columns
    follow = result.scenario.only.follow_distance_m
    colour = COLOURS["source"]
    axes.plot(result.time, columns["source_range_true"], color=colour, label="true")
    if "source_range" in columns:
        _heard(axes, result, columns["source_range"])
    axes.axhline(follow, color="black", ls="--", lw=1.0, label="follow distance")
    axes.set_ylabel("range of\nsource (m)")
    # The limit keeps the curves readable if an estimate is far away.
    axes.set_ylim(0.0, 1.3 * max(follow, float(np.max(columns["source_range_true"]))))


def _goal(axes: Axes, result: RunResult) -> None:
    columns = result.columns
    away = columns["source_range_true"]
    axes.plot(result.time, away, color=COLOURS["source"], label="to the goal")
    off = np.hypot(*(result.vector("target") - result.vector("p_WP")))
    axes.plot(result.time, off, color=COLOURS["robot"], label="to the target")
    replans = np.flatnonzero(np.diff(columns["replans"]))
    for count, tick in enumerate(replans.tolist()):
        label = None if count else "new route"
        axes.axvline(result.time[tick + 1], color="black", ls=":", lw=1.0, label=label)
    axes.set_ylabel("distance of P\n(m)")
    axes.set_ylim(bottom=0.0)


def _bearing(axes: Axes, result: RunResult) -> None:
    true = np.degrees(result.columns["source_bearing_true"])
    # Without a gap, a line would cross the whole panel where the bearing wraps.
    true[1:][np.abs(np.diff(true)) > 180.0] = np.nan
    axes.plot(result.time, true, color=COLOURS["source"], label="true")
    if "source_bearing" in result.columns:
        _heard(axes, result, np.degrees(result.columns["source_bearing"]))
    axes.set_ylabel("bearing of\nsource (deg)")


def _forces(axes: Axes, result: RunResult) -> None:
    for name in ("attraction", "repulsion"):
        size = np.hypot(*result.vector(name))
        axes.plot(result.time, size, color=COLOURS[name], lw=1.2, label=name)
    axes.set_ylabel("force on P\n(N)")
    axes.set_ylim(bottom=0.0)


def _gains(axes: Axes, result: RunResult) -> None:
    for name, label, colour in (
        ("stiffness", "K (N/m)", "source"),
        ("damping", "D (N s/m)", "robot"),
        ("contact_stiffness", "K_e (N/m)", "repulsion"),
    ):
        axes.plot(result.time, result.columns[name], color=COLOURS[colour], label=label)
    axes.set_ylabel("adapted gains")
    axes.set_ylim(bottom=0.0)


def _speeds(axes: Axes, result: RunResult) -> None:
    columns, robot = result.columns, result.scenario.only.robot
    theta = columns["theta_WB"]
    forward = columns["v_WB_x"] * np.cos(theta) + columns["v_WB_y"] * np.sin(theta)
    for side in ("left", "right"):
        rim = columns[f"wheel_speed_{side}"] * robot.wheel_radius_m
        label = f"{side} wheel, command"
        axes.plot(result.time, rim, color=COLOURS[side], lw=1.0, label=label)
    axes.plot(result.time, forward, color=COLOURS["robot"], label="robot, forward")
    if "wanted_speed" in columns:  # a guard may reduce the command
        _wanted(axes, result.time, columns["wanted_speed"])
    axes.set_ylabel("speed (m/s)")


def _turning(axes: Axes, result: RunResult) -> None:
    rate = np.degrees(result.columns["omega_WB"])
    axes.plot(result.time, rate, color=COLOURS["robot"], label="robot, to the left")
    if "wanted_turn" in result.columns:
        _wanted(axes, result.time, np.degrees(result.columns["wanted_turn"]))
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set_ylabel("turn rate\n(deg/s)")


def _wanted(axes: Axes, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Draws the command of the law, which a guard may reduce."""
    label = "wanted by the law"
    axes.plot(time, values, "--", color=COLOURS["law"], lw=1.0, label=label)


def _guard_actions(axes: Axes, result: RunResult) -> None:
    actions, tick_s = np.rint(result.columns["guard_action"]), result.scenario.tick_s
    for number, name in enumerate(GUARD_ACTIONS):
        done = actions == number
        colour = COLOURS["empty" if number == 0 else "source"]
        # The edges hide gaps between the bars of neighboring ticks.
        axes.broken_barh(
            [(time, tick_s) for time in result.time[done]],
            (number - 0.35, 0.7),
            facecolor=colour,
            edgecolor=colour,
            linewidth=0.4,
            zorder=2,
            label=f"{name}: {100.0 * np.mean(done):.0f} %",
        )
    # This curve shows the same actions for pages that draw only curves.
    axes.plot(
        result.time,
        actions,
        color=COLOURS["robot"],
        drawstyle="steps-post",
        linewidth=0.7,
        label="what it did",
        zorder=3,
    )
    axes.set_yticks(range(len(GUARD_ACTIONS)), GUARD_ACTIONS)
    axes.set_ylim(len(GUARD_ACTIONS) - 0.4, -0.6)
    axes.set_ylabel("command,\nby the guard")


def _guard_distances(axes: Axes, result: RunResult) -> None:
    time, columns = result.time, result.columns
    spare, view = columns["guard_distance"], columns["guard_view_distance"]
    axes.plot(time, spare, color=COLOURS["robot"], label="to spare")
    guard = result.scenario.only.own_guard
    if guard is not None and guard.obstacle_speed_m_s:
        axes.plot(
            time,
            view,
            color=COLOURS["left"],
            lw=1.0,
            label="to spare, obstacles in view",
        )
    way, colour = columns["guard_stopping_distance"], COLOURS["source"]
    axes.plot(time, way, color=colour, label="needed to stop")
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set_ylabel("guard's\ndistances (m)")


def clearance_panel(clearance: ArrayLike) -> Panel:
    """Returns a panel that shows the distance to the nearest body over time.

    The panel marks the least distance.

    Args:
        clearance: (n,) distance to the nearest body at the ticks (control periods), m.

    Returns:
        Function that draws the panel. Its arguments are the axes and the result of the
        run.
    """
    distance = np.asarray(clearance, dtype=float)

    def panel(axes: Axes, result: RunResult) -> None:
        time, colour = result.time, COLOURS["obstacle"]
        axes.plot(time, distance, color=colour, label="to nearest body")
        at, least = time[np.argmin(distance)], float(np.min(distance))
        axes.plot(at, least, "v", color="black", label=f"least: {least:z.2f} m")
        axes.set_ylabel("clearance\n(m)")
        axes.set_ylim(bottom=min(0.0, 1.1 * least))

    return panel
