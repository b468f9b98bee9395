"""Computes the curves of a run over time, as data for pictures and for pages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.report.palette import COLORS
from analysis.runs.guarded_motion import GUARD_ACTIONS, guarded_motion
from analysis.views.bursts import heard_bursts
from diagrams import RunResult
from diagrams.running.stop_rules import ODOR_WITHIN_M
from diagrams.scenario.participants import OdorSearcher
from systems.framework.input_error import InputError
from systems.search.song_rules import AIRFLOW_THRESHOLD

#: Largest number of points of a curve on a page. A screen cannot show more points.
MOST_POINTS = 1200
#: Names of the phases of each kind of search. The index is the number of the phase.
_PHASES = {
    "song2011": ("", "1 initial", "2 upwind", "3 gradient", "4 local"),
    "upwind_gradient": ("", "upwind", "across"),
    "sound": ("", "waits", "holds", "listens", "computes", "moves", "over"),
}


class Curve(NamedTuple):
    """One curve of a panel."""

    label: str
    """Text in the legend. A curve without a label is not in the legend."""
    t: NDArray[np.float64]
    """(n,) times, s."""
    y: NDArray[np.float64]
    """(n,) values, in the unit of the panel. NaN is a gap."""
    color: str
    """Color, as a hexadecimal string."""
    style: Literal["line", "dashes", "dots", "steps", "mark"] = "line"
    """With ``steps``, each value holds from its time on. ``mark`` is a single point."""
    width: float = 1.5
    """Width of the line, or half of the size of each dot, in points."""


class Shade(NamedTuple):
    """Intervals of time that a panel shades."""

    label: str
    spans: list[tuple[float, float]]
    """Start and end of each interval, s."""
    color: str
    alpha: float
    """Opacity, 0 to 1."""
    between: tuple[float, float]
    """Lower and upper limit of the shaded area, in the unit of the panel."""


class Panel(NamedTuple):
    """One quantity of one robot over time."""

    name: str
    unit: str
    """Unit of the quantity. It is empty for a quantity without a unit."""
    curves: list[Curve]
    low: float | None = None
    """Value at the bottom of the axis. None: the curves determine this value."""
    high: float | None = None
    """Value at the top of the axis. None: the curves determine this value."""
    rows: tuple[tuple[int, str], ...] = ()
    """Values on the axis, each with a name that replaces the number. Without rows, the
    axis shows numbers."""
    shades: tuple[Shade, ...] = ()
    instants: tuple[float, ...] = ()
    """Times at which the robot planned a new route, s."""

    @property
    def title(self) -> str:
        """Name of the quantity, with its unit in parentheses."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def limits(self) -> tuple[float, float]:
        """Values at the bottom and at the top of the axis.

        An end of the axis that is not set by ``low`` or ``high`` is beyond the curves
        by 5 % of their range. If ``low`` is above ``high``, values increase downward.
        """
        values = np.concatenate([curve.y for curve in self.curves])
        values = values[np.isfinite(values)]
        low, high = (values.min(), values.max()) if values.size else (0.0, 1.0)
        margin = 0.05 * (high - low) or 0.05 * max(abs(high), 1.0)
        return (
            float(low - margin) if self.low is None else self.low,
            float(high + margin) if self.high is None else self.high,
        )


def panels(result: RunResult, clearance: ArrayLike | None = None) -> list[Panel]:
    """Returns all panels of one robot's picture over time.

    ``clearance`` has the distance to the nearest body at each of the n ticks (control
    periods), m; see ``analysis.runs.proximity``. If it is None, the panel of the
    clearance is left out. The function raises an InputError if the shape of
    ``clearance`` is not (n,).
    """
    robot, columns = result.scenario.only, result.columns
    wanted: list[Callable[[RunResult], Panel]]
    if robot.searches == "odor":
        wanted = [_search_distance, _gas, _airflow, _heading, _phase]
    elif robot.searches is not None:
        wanted = [_search_distance, _search_bearing, _level, _heading, _phase]
    elif robot.has_goal:
        wanted = [_goal]
    else:
        wanted = [_range, _bearing]
    if "attraction_x" in columns:  # not all laws log forces
        wanted.append(_forces)
    if "stiffness" in columns:
        wanted.append(_gains)
    wanted += [_speeds, _turning]
    if guarded_motion(result) is not None:
        wanted += [_guard_actions, _guard_distances]
    found = [panel(result) for panel in wanted]
    if clearance is not None:
        found.append(_clearance(result, np.asarray(clearance, dtype=float)))
    return found


def page_charts(
    result: RunResult, clearance: Mapping[str, ArrayLike]
) -> list[dict[str, Any]]:
    """Returns the panels of all robots as plain data (charts) for the page of a replay.

    ``clearance`` has the clearance of ``panels`` for each robot, by name of the robot.
    A robot without an entry has no chart of its clearance. Each dictionary is one
    chart. It has the title, the name of the robot (empty if there is only one robot),
    the limits and the named values of the vertical axis, the curves, and the bursts
    that the robot hears. In the curves, None is a gap.
    """
    return [
        {
            "title": panel.title,
            "robot": name if result.several else "",
            "limits": [float(f"{x:.4g}") for x in sorted(panel.limits)],
            "ticks": panel.rows or None,
            "series": [_thinned(curve) for curve in panel.curves],
            "bursts": heard_bursts(own),
        }
        for name, own in result.robots.items()
        for panel in panels(own, clearance.get(name))
    ]


def _thinned(curve: Curve) -> dict[str, Any]:
    t, y, style = curve.t, curve.y, curve.style
    if style in {"dots", "mark"}:
        t, y, style = t[np.isfinite(y)], y[np.isfinite(y)], "dots"
    if style == "steps":
        # All steps are kept. Otherwise, steps of a single tick would be lost.
        new = np.flatnonzero(np.r_[True, y[1:] != y[:-1]])
        t, y = np.r_[t[new], t[-1:]], np.r_[y[new], y[-1:]]
    else:
        step = max(1, math.ceil(len(t) / MOST_POINTS))
        t, y = t[::step], y[::step]
    return {
        "label": curve.label,
        "color": curve.color,
        "style": style,
        "t": _short(t, 3),
        "values": _short(y, 4),
    }


def _short(values: NDArray[np.float64], digits: int) -> list[float | None]:
    rounded = np.round(values, digits).tolist()
    return [value if math.isfinite(value) else None for value in rounded]


def _level_line(
    result: RunResult, label: str, value: float, width: float = 1.0
) -> Curve:
    """Returns a horizontal line over the whole run; dashed if it has a label."""
    ends = np.array([0.0, result.simulated_s])
    style: Literal["dashes", "line"] = "dashes" if label else "line"
    return Curve(label, ends, np.full(2, value), "#000000", style, width)


def _zero(result: RunResult) -> Curve:
    return _level_line(result, "", 0.0, 0.6)


def _without_jumps(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    """Puts a gap (NaN) where an angle wraps, for example from 180 to -180 deg.

    Without the gap, a line would cross the whole panel.
    """
    values = degrees.copy()
    values[1:][np.abs(np.diff(values)) > 180.0] = np.nan
    return values


def _spans(result: RunResult, where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Returns the intervals of time in which a condition holds, s."""
    edges = np.flatnonzero(np.diff(np.r_[False, where, False]))
    times = np.r_[result.time, result.time[-1] + result.scenario.tick_s]
    ends = times[edges].reshape(-1, 2).tolist()
    return [(start, end) for start, end in ends]


def _range(result: RunResult) -> Panel:
    columns, follow = result.columns, result.scenario.only.follow_distance_m
    true = columns["source_range_true"]
    curves = [Curve("true", result.time, true, COLORS["source"])]
    if result.full_scenario.drives_to_point(result.name):
        return Panel("range of goal", "m", curves, 0.0, 1.3 * float(np.max(true)))
    if "source_range" in columns:
        curves.append(_heard(result, "estimated", columns["source_range"], 2.0))
    curves.append(_level_line(result, "follow distance", follow))
    # The limit keeps the curves readable if an estimate is far away.
    high = 1.3 * max(follow, float(np.max(true)))
    return Panel("range of source", "m", curves, 0.0, high)


def _heard(
    result: RunResult, label: str, values: NDArray[np.float64], width: float = 1.5
) -> Curve:
    return Curve(label, result.time, values, COLORS["estimate"], "dots", width)


def _goal(result: RunResult) -> Panel:
    columns, time = result.columns, result.time
    off = np.hypot(*(result.vector("target") - result.vector("p_WP")))
    curves = [
        Curve("to the goal", time, columns["source_range_true"], COLORS["source"]),
        Curve("to the target", time, off, COLORS["robot"]),
    ]
    replans = time[1:][np.diff(columns["replans"]) != 0.0]
    instants = tuple(replans.tolist())
    return Panel("distance of P", "m", curves, low=0.0, instants=instants)


def _bearing(result: RunResult) -> Panel:
    columns, time = result.columns, result.time
    true = _without_jumps(np.degrees(columns["source_bearing_true"]))
    curves = [Curve("true", time, true, COLORS["source"])]
    if result.full_scenario.drives_to_point(result.name):
        return Panel("bearing of goal", "deg", curves)
    if "source_bearing" in columns:
        heard = np.degrees(columns["source_bearing"])
        curves.append(_heard(result, "estimated", heard, 2.0))
    return Panel("bearing of source", "deg", curves)


def _forces(result: RunResult) -> Panel:
    curves = [
        Curve(
            name, result.time, np.hypot(*result.vector(name)), COLORS[name], width=1.2
        )
        for name in ("attraction", "repulsion")
    ]
    return Panel("force on P", "N", curves, low=0.0)


def _gains(result: RunResult) -> Panel:
    curves = [
        Curve(label, result.time, result.columns[name], COLORS[color])
        for name, label, color in (
            ("stiffness", "K (N/m)", "source"),
            ("damping", "D (N s/m)", "robot"),
            ("contact_stiffness", "K_e (N/m)", "repulsion"),
        )
    ]
    return Panel("adapted gains", "", curves, low=0.0)


def _speeds(result: RunResult) -> Panel:
    columns, robot, time = result.columns, result.scenario.only.robot, result.time
    theta = columns["theta_WB"]
    forward = columns["v_WB_x"] * np.cos(theta) + columns["v_WB_y"] * np.sin(theta)
    curves = [
        Curve(
            f"{side} wheel, command",
            time,
            columns[f"wheel_speed_{side}"] * robot.wheel_radius_m,
            COLORS[side],
            width=1.0,
        )
        for side in ("left", "right")
    ]
    curves.append(Curve("robot, forward", time, forward, COLORS["robot"]))
    if "wanted_speed" in columns:
        curves.append(_wanted(time, columns["wanted_speed"]))
    return Panel("speed", "m/s", curves)


def _turning(result: RunResult) -> Panel:
    columns, time = result.columns, result.time
    rate = np.degrees(columns["omega_WB"])
    curves = [Curve("robot, to the left", time, rate, COLORS["robot"])]
    if "wanted_turn" in columns:
        curves.append(_wanted(time, np.degrees(columns["wanted_turn"])))
    return Panel("turn rate", "deg/s", [*curves, _zero(result)])


def _wanted(time: NDArray[np.float64], values: NDArray[np.float64]) -> Curve:
    """Returns the curve of the law's command, which a guard may reduce."""
    return Curve("wanted by the law", time, values, COLORS["law"], "dashes", 1.0)


def _guard_actions(result: RunResult) -> Panel:
    actions = np.rint(result.columns["guard_action"])
    shades = tuple(
        Shade(
            f"{name}: {100.0 * np.mean(actions == number):.0f} %",
            _spans(result, actions == number),
            COLORS["source" if number else "empty"],
            1.0,
            (number - 0.35, number + 0.35),
        )
        for number, name in enumerate(GUARD_ACTIONS)
    )
    did = Curve("what it did", result.time, actions, COLORS["robot"], "steps", 0.7)
    rows, count = tuple(enumerate(GUARD_ACTIONS)), len(GUARD_ACTIONS)
    # The first action is at the top.
    return Panel(
        "command, by the guard", "", [did], count - 0.4, -0.6, rows, shades=shades
    )


def _guard_distances(result: RunResult) -> Panel:
    time, columns = result.time, result.columns
    curves = [Curve("to spare", time, columns["guard_distance"], COLORS["robot"])]
    guard = result.scenario.only.own_guard
    if guard is not None and guard.obstacle_speed_m_s:
        label, view = "to spare, obstacles in view", columns["guard_view_distance"]
        curves.append(Curve(label, time, view, COLORS["left"], width=1.0))
    way = columns["guard_stopping_distance"]
    curves.append(Curve("needed to stop", time, way, COLORS["source"]))
    return Panel("guard's distances", "m", [*curves, _zero(result)])


def _clearance(result: RunResult, distance: NDArray[np.float64]) -> Panel:
    if distance.shape != result.time.shape:
        raise InputError(
            "clearance",
            f"{distance.shape} values for {result.time.shape} ticks; give the "
            "clearance of this run (analysis.runs.proximity)",
        )
    at, least = result.time[[np.argmin(distance)]], float(np.min(distance))
    curves = [
        Curve("to nearest body", result.time, distance, COLORS["obstacle"]),
        Curve(f"least: {least:z.2f} m", at, np.array([least]), "#000000", "mark"),
    ]
    return Panel("clearance", "m", curves, low=min(0.0, 1.1 * least))


def _search_distance(result: RunResult) -> Panel:
    columns, stop = result.columns, result.scenario.stop
    smells = result.scenario.only.searches == "odor"
    away = np.hypot(*(result.vector("p_WB") - result.vector("p_WS")))
    curves = [Curve("true", result.time, away, COLORS["source"])]
    if "source_range" in columns:
        curves.append(_heard(result, "heard", columns["source_range"]))
    found = ODOR_WITHIN_M if smells else stop.sound_within_m
    curves.append(_level_line(result, "found within", found))
    high = 1.1 * max(found, float(np.max(away)))
    return Panel("range of source", "m", curves, 0.0, high)


def _search_bearing(result: RunResult) -> Panel:
    columns = result.columns
    true = _without_jumps(np.degrees(columns["source_bearing_true"]))
    heard = _heard(result, "heard", np.degrees(columns["source_bearing"]))
    curves = [Curve("true", result.time, true, COLORS["source"]), heard]
    return Panel("bearing of source", "deg", curves)


def _columns(
    result: RunResult, width: float, *named: tuple[str, str, str]
) -> list[Curve]:
    """Returns columns of the table as curves.

    ``named`` has the name of each column, its label, and the key of its color.
    """
    return [
        Curve(label, result.time, result.columns[name], COLORS[color], width=width)
        for name, label, color in named
    ]


def _gas(result: RunResult) -> Panel:
    curves = _columns(
        result,
        0.9,
        ("gas_left", "R3, left", "left"),
        ("gas_right", "R1, right", "right"),
        ("gas_rear", "R2, rear", "empty"),
    )
    return Panel("gas, Rs/R0", "", curves)


def _airflow(result: RunResult) -> Panel:
    curves = _columns(
        result,
        0.7,
        ("airflow_left", "F1, left", "left"),
        ("airflow_right", "F2, right", "right"),
    )
    searcher = result.scenario.searcher
    assert isinstance(searcher, OdorSearcher)
    if searcher.search.rules == "song2011":
        curves.append(_level_line(result, "threshold", AIRFLOW_THRESHOLD))
    return Panel("airflow", "", curves, low=0.0)


def _level(result: RunResult) -> Panel:
    return Panel("level", "dBm", _columns(result, 0.6, ("rssi_dbm", "radio", "empty")))


def _heading(result: RunResult) -> Panel:
    curves = [
        *_columns(result, 1.4, ("expected_heading_deg", "expected", "source")),
        *_columns(result, 0.7, ("heading_deg", "compass", "robot")),
    ]
    curves = [curve._replace(y=_without_jumps(curve.y)) for curve in curves]
    return Panel("heading", "deg from north", curves)


def _phase(result: RunResult) -> Panel:
    searcher = result.scenario.searcher
    rules = searcher.search.rules if isinstance(searcher, OdorSearcher) else "sound"
    rows = tuple(enumerate(_PHASES[rules]))[1:]
    edges = 0.5, len(rows) + 0.5
    moves = _spans(result, result.columns["move"] > 0.5)
    shades = [Shade("moves", moves, COLORS["seen"], 0.2, edges)]
    if "listening" in result.columns:
        listens = _spans(result, result.columns["listening"] > 1.5)
        shades.append(Shade("listens", listens, COLORS["echo"], 0.3, edges))
    curves = _columns(result, 1.2, ("search_phase", "phase", "robot"))
    return Panel("phase", "", curves, *edges, rows, tuple(shades))
