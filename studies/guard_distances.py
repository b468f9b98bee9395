"""How much clear floor a guarded robot needs ahead, by theorem and by simulation.

    python -m studies guard_distances [--chart FILE]

For speeds of the robot and of bodies, the distance of the axle from a wall straight
ahead at which the guard no longer passes the command: as the theorem has it, with the
bounds of the braking, and in runs by compiled loops in which the robot drives at the
wall. Then for each preset of sensors what of the round it sees, and so which guarantee
there is. ``--chart`` draws both as well.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Wedge

from analysis.report.palette import COLORS, SERIES_COLORS, draw_grid
from analysis.safety.driver_trials import TWIST, make_trial, run_result
from diagrams import RunResult, Scenario
from diagrams.scenario.warnings.guarantees import clear_way, seen_angle_deg
from studies.tables import Table
from systems.ranging.parameters import UltrasonicParameters
from systems.ranging.sensor_presets import SENSOR_PRESETS
from systems.safety.braking import PASSED
from systems.safety.parameters import GuardParameters

#: Of the robot and of bodies, m/s.
SPEEDS_M_S, BODIES_M_S = (0.2, 0.4, 0.62, 0.72), (0.0, 0.3, 0.6, 1.0)
#: Of the presets in the chart; a range is 1.
_APART = 2.4


def needed_distance(speed: float, body_speed: float) -> float:
    """``clear_way`` of the default robot with a guard.

    Args:
        speed: Of the robot, m/s.
        body_speed: Up to which it is guarded against bodies, m/s.

    Returns:
        m, from the axle.
    """
    return clear_way(Scenario(guard=GuardParameters()), speed, body_speed)


def passed_distance(speed: float, body_speed: float) -> float:
    """The same in a run: where the guard first did not pass the command.

    Args:
        speed: Of the robot, m/s.
        body_speed: Up to which it is guarded against bodies, m/s.

    Returns:
        m, from the axle.
    """
    run, wall_m = drive_at_a_wall(speed, body_speed)
    passed = run.columns["guard_action"] == PASSED
    first = np.argmin(passed) if not passed.all() else len(passed) - 1
    return float(wall_m - run.columns["p_WB_x"][first])


def drive_at_a_wall(speed: float, body_speed: float) -> tuple[RunResult, float]:
    """Simulates a robot that drives at a wall straight ahead.

    Args:
        speed: Commanded speed, m/s.
        body_speed: Largest obstacle speed that the robot's guard allows for, m/s.

    Returns:
        The run, and the x coordinate of the wall's face, m.
    """
    names, rows = ("wall", "straight", "no noise"), [[1e3, TWIST, speed, 0.0, 0, 0]]
    wall_m = 2.9
    boxes = [(wall_m + 0.05, 0.0, 0.0, 0.1, 3.0)]
    trial = make_trial(names, boxes, rows, 0.0, (8.0, 0.0), 1)
    changes = {"guard": {"obstacle_speed_m_s": body_speed}, "duration_s": 20.0}
    return run_result(trial, changes), wall_m


def draw_chart(passed: Mapping[tuple[float, float], float]) -> Figure:
    """Clear way against speed, and what the presets see.

    Args:
        passed: By speeds of robot and bodies ``passed_distance``, m.

    Returns:
        The picture.
    """
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    _draw_distances(left, passed)
    _draw_views(right)
    return figure


def _draw_distances(axes: Axes, passed: Mapping[tuple[float, float], float]) -> None:
    speeds = np.linspace(0.05, 0.72, 25)
    for u, color in zip(BODIES_M_S, SERIES_COLORS, strict=False):
        name = f"bodies up to {u:g} m/s" if u else "obstacles at rest: static safety"
        needed = [needed_distance(v, u) for v in speeds.tolist()]
        axes.plot(speeds, needed, color=color, label=name)
        runs = [passed[v, u] for v in SPEEDS_M_S]
        axes.plot(SPEEDS_M_S, runs, "o", color=color)
    axes.set(
        xlabel="speed of the robot (m/s)",
        ylabel="clear way that it needs, from the axle (m)",
        title="Theorem (lines) and runs (points)",
        ylim=(0.0, None),
    )
    draw_grid(axes)
    axes.legend(loc="upper left", fontsize="small")


def _draw_views(axes: Axes) -> None:
    robot = Scenario().only.robot
    for column, name in enumerate(SENSOR_PRESETS):
        sensors = UltrasonicParameters.model_validate({"preset": name})
        x = _APART * column
        for each in sensors.sensors:
            middle, half = 90.0 + each.axis_deg, each.beam_half_angle_deg
            wedge = Wedge((x, 0.0), 1.0, middle - half, middle + half)
            wedge.set(facecolor=COLORS["seen"], alpha=0.35, linewidth=0.0)
            axes.add_patch(wedge)
        axes.plot([x], [0.0], "o", color=COLORS["robot"])
        share = seen_angle_deg(sensors, robot.control_point_m)
        movers = " ".join(_against_movers(share)).split(" ", 2)
        lines = [name, f"sees {share:.0f} deg", "static safety", "and", *movers]
        for row, line in enumerate(lines):
            weight = "bold" if row == 0 else "normal"
            y = -1.35 - 0.33 * row
            axes.text(x, y, line, ha="center", fontsize="small", fontweight=weight)
    axes.set(
        xlim=(-1.2, _APART * (len(SENSOR_PRESETS) - 1) + 1.2),
        ylim=(-4.2, 1.2),
        title="What sensors see, and which guarantee that is",
        aspect="equal",
    )
    axes.set_axis_off()


def _against_movers(share_deg: float) -> tuple[str, ...]:
    around = math.isclose(share_deg, 360.0, abs_tol=1.0)
    return "passive orientation", "all round" if around else "in view"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--chart", metavar="FILE", help="picture to write")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """Both tables; draws the chart where it is asked for."""
    passed = {(v, u): passed_distance(v, u) for v in SPEEDS_M_S for u in BODIES_M_S}
    rows = [
        [f"{v:g} m/s"]
        + [f"{needed_distance(v, u):.2f} / {passed[v, u]:.2f}" for u in BODIES_M_S]
        for v in SPEEDS_M_S
    ]
    head = [f"bodies {u:g} m/s" if u else "obstacles at rest" for u in BODIES_M_S]
    yield Table("clear floor ahead, theorem / run, m", ["robot", *head], rows)
    rows = []
    for name in SENSOR_PRESETS:
        sensors = UltrasonicParameters.model_validate({"preset": name})
        share = seen_angle_deg(sensors, Scenario().only.robot.control_point_m)
        kind = ", ".join(part for part in _against_movers(share) if part != "in view")
        rows.append([f"`{name}`", f"{share:.0f} deg", "yes", kind])
    names = ["sensors", "see", "static safety", "against what moves"]
    yield Table("guarantees", names, rows)
    if options.chart:
        draw_chart(passed).savefig(options.chart, dpi=110)
