"""The metrics of a run: one record per metric, and the functions that compute them.

The summary of a run, sweeps, comparisons, their pages, docs/metrics.md and the command
``phonotaxis columns --metrics`` read the metrics from this file. To add a metric, add
its record to a group in ``GROUPS``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from analysis.runs.measured_run import (
    MOVING_M_S,
    Flags,
    Floats,
    MeasuredRun,
    lengths,
    quantile,
    rms,
    share,
    yaw_ripple,
)
from analysis.runs.smoothness import (
    jerk,
    log_dimensionless_jerk,
    spectral_arc_length,
    turn_reversals,
)
from diagrams.running.run_result import RunResult
from diagrams.running.stop_rules import SUCCESSFUL
from systems.framework.compiling import njit
from systems.world.geometry import beyond_rectangle

#: Position error above which an estimate is an outlier, m.
OUTLIER_M = 0.5
#: Least turn rate that counts as turning, rad/s.
TURNING_RAD_S = 0.1
#: Least push that counts as a reaction of the law, N. A push is a force away from
#: obstacles. This one accelerates a virtual mass of 3.94 kg by 0.13 m/s^2.
REACTION_N = 0.5
#: An echo belongs to an obstacle if its distance differs from the true distance of this
#: obstacle by at most this value, m.
ECHO_M = 0.2
#: Least speed that counts as driving in a search, m/s.
DRIVING_M_S = 0.02
#: A speed of at least this part of the top speed counts as saturated.
FULL = 0.999
#: Speed of the optimal time of a world, m/s: the top speed in the BARN challenge.
REFERENCE_SPEED_M_S = 2.0
#: Sum of the arm lengths of two robots, m: of the listening robot and of the calling
#: robot (Song 2011, 2.1, 3.1). At a smaller distance, the arms can touch.
ARMS_M = 0.15 + 0.20


@dataclass(frozen=True)
class Metric:
    """Definition of a number that describes a run, and of its average over runs."""

    name: str
    """Name in JSON documents and in the tables of sweeps."""
    unit: str
    """Unit; empty for counts and ratios."""
    title: str
    """Name for readers, without the unit."""
    meaning: str
    """Definition as one phrase in Markdown, for docs/metrics.md."""
    value: Callable[[MeasuredRun], float | None]
    """Computes the metric of a run. The value is None if the metric does not apply."""
    of: Literal["ended", "successes"] = "ended"
    """Runs that an average includes: all runs that ended without an error, or only the
    successful ones. The latter is for metrics that an early end of a run changes."""
    average: Literal["median", "mean"] = "median"
    """Average over runs."""
    robots: Literal["mean", "least", "greatest"] = "mean"
    """How the values of several robots are combined into one value of the run."""
    digits: int = 3
    """Number of decimals in tables."""
    paired: bool = False
    """Whether comparisons evaluate the difference of the metric between two runs on the
    same layout."""
    shown: Literal["", "table", "picture"] = ""
    """Whether the pages of sweeps and comparisons show the metric: not at all, in
    tables, or in tables and pictures."""

    @property
    def label(self) -> str:
        """Title with the unit in brackets."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    def text(self, value: float | None) -> str:
        """Writes a value with its unit; a dash if there is none."""
        if value is None:
            return "-"
        return f"{value:.{self.digits}f} {self.unit}".rstrip()


class Group(NamedTuple):
    """Metrics that apply to the same runs."""

    name: str
    applies: Callable[[MeasuredRun], bool]
    """Whether a run has these metrics."""
    metrics: tuple[Metric, ...]


def run_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes all metrics of a run by name, in the units of ``METRICS``.

    If a metric does not apply to the run, its value is None. If the run has several
    robots, each name begins with the name of the robot and a dot.
    """
    if result.several:
        return {
            f"{name}.{metric}": value
            for name, own in result.several.items()
            for metric, value in run_metrics(own).items()
        }
    run = MeasuredRun(result)
    return {
        metric.name: metric.value(run)
        for group in GROUPS
        if group.applies(run)
        for metric in group.metrics
    }


def metric_label(name: str) -> str:
    """Returns title and unit of a metric; its name may begin with a robot's name."""
    robot, _, own = name.rpartition(".")
    label = METRICS[own].label if own in METRICS else own.replace("_", " ")
    return f"{robot}: {label}" if robot else label


def _drives(run: MeasuredRun) -> bool:
    return not run.searches


def _follows(run: MeasuredRun) -> bool:
    return not run.searches and not run.routed


def _has_reference(run: MeasuredRun) -> bool:
    return run.result.scenario.reference_path_m is not None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _first_time(run: MeasuredRun, flags: Flags) -> float | None:
    found = np.flatnonzero(flags)
    return float(run.time[found[0]]) if len(found) else None


def _spl(run: MeasuredRun) -> float | None:
    """Returns success weighted by path length (Anderson et al. 2018)."""
    shortest = run.shortest_path
    if shortest is None:
        return None
    if run.result.cause != "reached":
        return 0.0
    longest = max(run.path_length, shortest)
    return shortest / longest if longest > 0.0 else 1.0


def _following_fraction(run: MeasuredRun) -> float | None:
    band_m = run.result.scenario.stop.following_band_m
    since_heard = np.maximum.accumulate(run.target_valid)
    return share((np.abs(run.following_error) <= band_m)[since_heard])


def _heading_change(run: MeasuredRun) -> float | None:
    path = float(np.sum(run.speed)) * run.tick_s
    turned = float(np.sum(np.abs(np.diff(run.columns["theta_WB"]))))
    return turned / path if path > MOVING_M_S else None


def _turn_reversals(run: MeasuredRun) -> float | None:
    duration = run.result.simulated_s
    reversals = turn_reversals(run.columns["omega_WB"], TURNING_RAD_S)
    return reversals / duration if duration > 0.0 else None


def _control_effort(run: MeasuredRun) -> float | None:
    if not run.has("repulsion_x"):
        return None
    repulsion = run.result.vector("repulsion")
    return rms(lengths(run.result.vector("attraction") + repulsion))


def _push_work(run: MeasuredRun) -> float | None:
    if not run.has("repulsion_x"):
        return None
    # The previous row contains the velocity before the push, and this row that after
    # it.
    after = run.result.vector("v_WP")
    before = np.column_stack([np.zeros(2), after[:, :-1]])
    repulsion = run.result.vector("repulsion")
    push = np.sum(repulsion * (before + after) / 2.0, axis=0)
    return float(np.sum(push)) * run.tick_s


def _wheel_variation(run: MeasuredRun) -> float:
    wheels, radius_m = run.wheel_speeds, run.result.scenario.only.robot.wheel_radius_m
    variation = np.mean(np.abs(np.diff(wheels))) if len(run.time) > 1 else 0.0
    return float(variation) * radius_m / run.tick_s


def _saturated(run: MeasuredRun) -> float | None:
    robot = run.result.scenario.only.robot
    saturated = np.max(np.abs(run.wheel_speeds), axis=0) >= FULL * robot.top_wheel_speed
    saturated |= lengths(run.result.vector("v_WP")) >= FULL * robot.top_speed_m_s
    return share(saturated)


def _impossible_speeds(run: MeasuredRun) -> int | None:
    if not run.has("obstacle_speed_1"):
        return None
    speeds = np.array([run.columns[f"obstacle_speed_{k}"] for k in (1, 2, 3)])
    top = run.result.scenario.only.robot.top_speed_m_s
    return int(np.count_nonzero(np.any(speeds > 2.0 * top, axis=0)))


def _slip(run: MeasuredRun) -> float | None:
    if run.result.scenario.only.plant.friction is None:
        return None
    columns = run.columns
    wheels = np.stack([columns["slip_left"], columns["slip_right"]])
    speeds = lengths((wheels, columns["slip_sideways"]))
    return float(np.sum(np.mean(speeds, axis=0))) * run.tick_s


def _contact_push(run: MeasuredRun) -> float | None:
    if run.result.collision is None or not run.has("repulsion_x"):
        return None
    return math.hypot(*run.result.vector("repulsion")[:, -1])


def _path_efficiency(run: MeasuredRun) -> float | None:
    distance = run.source_distance
    nearer = float(distance[run.begin] - distance[run.end])
    return nearer / run.path_length if run.path_length > 0.0 else None


def _driving_fraction(run: MeasuredRun) -> float | None:
    speed = run.speed[: run.end + 1]
    return float(np.mean(speed > DRIVING_M_S)) if speed.size else None


def _reaction_distance(run: MeasuredRun) -> float | None:
    """Returns the distance from P to the nearest obstacle at the first reaction, m."""
    result, columns = run.result, run.columns
    if not result.surroundings.obstacles or not run.has("repulsion_x", "feature_1"):
        return None
    echoes = [
        [columns[f"feature_{k}"], *result.vector(f"collision_{k}_B")] for k in (1, 2, 3)
    ]
    distance = _first_reaction(
        run.bodies, result.vector("p_WP"), result.vector("repulsion"), np.array(echoes)
    )
    return distance if math.isfinite(distance) else None


@njit(cache=True)
def _first_reaction(
    bodies: Floats, p_WP: Floats, push: Floats, echoes: Floats
) -> float:  # pragma: no cover  (compiled)
    """Returns how near an obstacle is when the control law first reacts to it, m.

    The law reacts at a tick (control period) if three conditions hold. If it never
    reacts, the distance is infinite.

    - The repulsive force ``push`` (2, n) is at least ``REACTION_N``.
    - The nearest obstacle is nearer to the control point P than the target is. The
      target is the last of the m rectangles of ``bodies`` (m, n, 6).
    - A collision vector agrees with this obstacle: its length differs from the distance
      of the obstacle by at most ``ECHO_M``.

    The argument ``echoes`` (k, 3, n) contains k collision vectors, which point from P
    to an echo. Each has a number above 0 if the vector exists, and then its x and y in
    the robot frame B, m.
    """
    for i in range(push.shape[1]):
        if math.hypot(push[0, i], push[1, i]) < REACTION_N:
            continue
        nearest, distance = np.inf, np.inf
        for k in range(len(bodies)):
            nearest = min(nearest, distance)
            du, dv = beyond_rectangle(p_WP[:, i], bodies[k, i])
            distance = math.hypot(du, dv)
        if nearest >= distance:
            continue
        for there, x, y in echoes[:, :, i]:
            if there > 0.5 and abs(math.hypot(x, y) - nearest) <= ECHO_M:
                return nearest
    return np.inf


_ALL = (
    Metric(
        "minimum_clearance_m",
        "m",
        "least clearance",
        "smallest clearance to any body: an obstacle, another robot or the source. "
        "When a contact switch touches an odor source, the clearance can be as low as "
        "-4 mm.",
        lambda run: min(run.least.tolist(), default=None),
        robots="least",
        paired=True,
        shown="picture",
    ),
    Metric(
        "minimum_obstacle_clearance_m",
        "m",
        "least clearance from obstacles",
        "smallest clearance to any body except the source that the robot follows",
        lambda run: min(run.obstacle_clearances, default=None),
        robots="least",
        paired=True,
        shown="picture",
    ),
    Metric(
        "path_length_m",
        "m",
        "path length",
        "length of the path of the origin of B, in a search until the search ends",
        lambda run: run.path_length,
        of="successes",
        paired=True,
    ),
    Metric(
        "final_distance_m",
        "m",
        "distance at the end",
        "distance from P to the source at the end of the run. In a search, it is the "
        "distance from the origin of B to the source or the calling robot at the end "
        "of the search.",
        lambda run: float(run.source_distance[run.end]),
    ),
)
_NEAR = (
    Metric(
        "clearance_p05_m",
        "m",
        "5th percentile of the clearance",
        "5th percentile of the clearance to the nearest body, over all ticks",
        lambda run: quantile(run.clearance, 0.05) if len(run.bodies) else None,
    ),
    Metric(
        "minimum_time_to_contact_s",
        "s",
        "least time to contact",
        "smallest predicted time until the robot touches another body, over all ticks. "
        "The prediction assumes that all bodies keep their present velocity and "
        "heading.",
        lambda run: _finite(run.least_time_to_contact),
        robots="least",
        digits=2,
        paired=True,
    ),
    Metric(
        "reaction_distance_m",
        "m",
        "reaction distance",
        "distance from P to the nearest obstacle when the law first reacts to this "
        "obstacle. The law reacts if it pushes with at least 0.5 N, if the obstacle is "
        "nearer to P than the source is, and if an echo agrees with the distance of "
        "the obstacle within 0.2 m.",
        _reaction_distance,
        paired=True,
        shown="table",
    ),
)
_CONTACT = (
    Metric(
        "contact_warning_s",
        "s",
        "first echo before contact",
        "time from the first echo of the body to the contact; `null` if the body never "
        "caused an echo",
        lambda run: run.echo_times[0],
        digits=2,
    ),
    Metric(
        "contact_unseen_s",
        "s",
        "last echo before contact",
        "time from the last echo of the body to the contact; `null` if the body never "
        "caused an echo",
        lambda run: run.echo_times[1],
        digits=2,
    ),
    Metric(
        "contact_push_n",
        "N",
        "push at contact",
        "magnitude of the law's push at the last tick",
        _contact_push,
        digits=2,
    ),
)
_GOAL = (
    Metric(
        "time_to_goal_s",
        "s",
        "time to the goal",
        "time of the first tick at which P is in the goal, at any speed",
        lambda run: _first_time(run, run.in_goal),
        of="successes",
        robots="greatest",
        digits=1,
        paired=True,
    ),
    Metric(
        "settling_time_s",
        "s",
        "settling time",
        "time of the first tick after which P stays in the goal until the run ends. If "
        "the source is at rest, P must also stay slower than 0.05 m/s, for at least "
        "`stop.rest_time_s`.",
        lambda run: run.settling_time,
        of="successes",
        robots="greatest",
        digits=1,
    ),
    Metric(
        "shortest_path_m",
        "m",
        "shortest path",
        "length of the shortest path from the start to the goal around all obstacles "
        "at rest; `null` for a moving source",
        lambda run: run.shortest_path,
    ),
    Metric(
        "spl",
        "",
        "success weighted by path length",
        "success weighted by path length (SPL, Anderson et al. 2018, arXiv "
        "1807.06757). If the outcome is `reached`, the value is `shortest_path_m` "
        "divided by the larger of `shortest_path_m` and `path_length_m`. Otherwise, "
        "the value is 0.",
        _spl,
        average="mean",
    ),
)


def _score(run: MeasuredRun, least: float) -> float | None:
    """Returns the score of the BARN challenge.

    The score is the optimal time divided by the time to the goal. The time counts as at
    least ``least`` and at most 8 times the optimal time.
    """
    path_m = run.result.scenario.reference_path_m
    if path_m is None:
        return None
    time_s = _first_time(run, run.in_goal)
    if run.result.cause not in SUCCESSFUL or time_s is None:
        return 0.0
    optimal_s = path_m / REFERENCE_SPEED_M_S
    return optimal_s / float(np.clip(time_s, least * optimal_s, 8.0 * optimal_s))


_WORLD = (
    Metric(
        "timeout_fraction",
        "",
        "share of time-outs",
        "1 if the run ended neither at the goal nor by a contact, otherwise 0",
        lambda run: float(run.result.cause not in (*SUCCESSFUL, "collision")),
        average="mean",
        shown="table",
    ),
    Metric(
        "mean_time_s",
        "s",
        "mean time",
        "`time_to_goal_s`, of which tables give the mean and not the median",
        lambda run: _first_time(run, run.in_goal),
        of="successes",
        average="mean",
        robots="greatest",
        digits=1,
        shown="table",
    ),
    Metric(
        "score",
        "",
        "score",
        "score of the BARN challenge: T/clip(`time_to_goal_s`, 2T, 8T), with "
        "T = `reference_path_m` / (2 m/s); 0 without success. At most 0.5.",
        lambda run: _score(run, 2.0),
        average="mean",
        paired=True,
        shown="picture",
    ),
    Metric(
        "score_4",
        "",
        "score of earlier editions",
        "score of the first BARN challenges: T/clip(`time_to_goal_s`, 4T, 8T). At most "
        "0.25.",
        lambda run: _score(run, 4.0),
        average="mean",
        shown="table",
    ),
)
_FOLLOWING = (
    Metric(
        "following_fraction",
        "",
        "share of time in the following band",
        "fraction of the ticks after the first detection at which the magnitude of the "
        "following error is at most `stop.following_band_m`. For the outcome "
        "`completed`, this fraction must be at least 0.5.",
        _following_fraction,
        of="successes",
        digits=2,
        paired=True,
    ),
    Metric(
        "following_error_rms_m",
        "m",
        "rms following error",
        "RMS value of the following error",
        lambda run: rms(np.abs(run.following_error)[run.after_second_burst]),
        of="successes",
        paired=True,
        shown="picture",
    ),
    Metric(
        "following_error_p95_m",
        "m",
        "95th percentile of the following error",
        "95th percentile of the magnitude of the following error",
        lambda run: quantile(np.abs(run.following_error)[run.after_second_burst], 0.95),
        of="successes",
        paired=True,
    ),
    Metric(
        "following_bearing_rms_deg",
        "deg",
        "rms bearing of the source",
        "RMS value of the true bearing of the source",
        lambda run: rms(
            np.degrees(run.columns["source_bearing_true"][run.after_second_burst])
        ),
        of="successes",
        digits=1,
    ),
    Metric(
        "valid_target_fraction",
        "",
        "share of time with a target",
        "fraction of all ticks at which the robot has a valid target",
        lambda run: share(run.target_valid),
        digits=2,
    ),
)
_ROUTE = (
    Metric(
        "route_deviation_m",
        "m",
        "median deviation from the route",
        "median distance of P from the path along which the target moved",
        lambda run: float(np.median(run.route_deviation)),
        paired=True,
    ),
    Metric(
        "route_deviation_max_m",
        "m",
        "greatest deviation from the route",
        "greatest distance of P from the path along which the target moved",
        lambda run: float(np.max(run.route_deviation)),
        robots="greatest",
        paired=True,
        shown="table",
    ),
    Metric(
        "yaw_ripple_rad_s",
        "rad/s",
        "yaw ripple",
        "RMS value of the difference between the yaw rate and its moving mean over "
        "1 s. The metric includes only the ticks at which a body is nearer than 1 m to "
        "the robot's outline, and the 5 s after such a tick.",
        lambda run: yaw_ripple(run.columns["omega_WB"], run.in_encounter, run.tick_s),
        paired=True,
        shown="table",
    ),
    Metric(
        "replans",
        "",
        "new routes",
        "number of times that the planner computed a new route",
        lambda run: float(run.columns["replans"][-1]),
        digits=0,
        paired=True,
    ),
)


def _gains(name: str, unit: str, ending: str, symbol: str) -> tuple[Metric, ...]:
    """Metrics of a gain that the law may adapt: its extremes and its last value."""

    def of(
        which: str,
        robots: Literal["mean", "least", "greatest"],
        read: Callable[[Floats], float],
    ) -> Metric:
        return Metric(
            f"{which}_{name}_{ending}",
            unit,
            f"{which} {name} {symbol}",
            f"{which} value of the {name} {symbol}, if the law adapts {symbol}",
            lambda run: float(read(run.columns[name])),
            robots=robots,
            paired=True,
        )

    return (
        of("least", "least", np.min),
        of("greatest", "greatest", np.max),
        of("last", "mean", lambda values: values[-1]),
    )


_STIFFNESS = _gains("stiffness", "N/m", "n_m", "K")
_DAMPING = _gains("damping", "N s/m", "n_s_m", "D")
_SEARCH = (
    Metric(
        "search_steps",
        "",
        "steps",
        "number of moves that the robot began",
        lambda run: run.search_steps,
        digits=0,
    ),
    Metric(
        "search_time_s",
        "s",
        "time of the search",
        "duration of the search. If the robot waits for a call, the search starts when "
        "the robot first listens to the sound of the caller.",
        lambda run: float(run.time[run.end] - run.time[run.begin]),
        digits=1,
    ),
    Metric(
        "step_length_m",
        "m",
        "step length",
        "`path_length_m` divided by `search_steps`",
        lambda run: run.path_length / run.search_steps if run.search_steps else None,
    ),
    Metric(
        "path_efficiency",
        "",
        "straight over driven",
        "decrease of the distance to the source during the search, divided by "
        "`path_length_m`",
        _path_efficiency,
        digits=2,
    ),
    Metric(
        "minimum_distance_m",
        "m",
        "least distance",
        "smallest distance from the origin of B to the source or the calling robot. At "
        "less than 0.35 m from the calling robot, the arms of both robots can touch.",
        lambda run: float(np.min(run.source_distance[: run.end + 1])),
        robots="least",
    ),
    Metric(
        "driving_fraction",
        "",
        "share of time in motion",
        "fraction of the ticks at which the robot moves faster than 2 cm/s",
        _driving_fraction,
        digits=2,
    ),
)
_SMOOTHNESS = (
    Metric(
        "jerk_rms_m_s3",
        "m/s³",
        "rms jerk",
        "RMS value of the magnitude of the jerk",
        lambda run: rms(run.jerk),
        of="successes",
        paired=True,
        shown="picture",
    ),
    Metric(
        "jerk_max_m_s3",
        "m/s³",
        "greatest jerk",
        "maximum magnitude of the jerk",
        lambda run: float(np.max(run.jerk)) if len(run.jerk) else None,
        of="successes",
        robots="greatest",
        paired=True,
    ),
    Metric(
        "angular_jerk_rms_rad_s3",
        "rad/s³",
        "rms angular jerk",
        "RMS value of the angular jerk",
        lambda run: rms(jerk(run.columns["omega_WB"], run.tick_s)),
        of="successes",
        paired=True,
    ),
    Metric(
        "sparc",
        "",
        "SPARC",
        "spectral arc length of the speed (Balasubramanian et al. 2012). The value is "
        "negative, and it is closer to 0 for smoother motion.",
        lambda run: quantile(spectral_arc_length(run.movements, 1.0 / run.tick_s), 0.5),
        of="successes",
        paired=True,
        shown="table",
    ),
    Metric(
        "ldlj",
        "",
        "LDLJ",
        "log dimensionless jerk of the speed (Balasubramanian et al. 2015). The value "
        "is larger for smoother motion.",
        lambda run: quantile(
            log_dimensionless_jerk(run.movements, 1.0 / run.tick_s), 0.5
        ),
        of="successes",
        paired=True,
    ),
    Metric(
        "turn_reversals_per_s",
        "1/s",
        "turn reversals per second",
        "number of changes of the turning direction per second. The metric ignores yaw "
        "rates below 0.1 rad/s.",
        _turn_reversals,
        of="successes",
        paired=True,
    ),
    Metric(
        "heading_change_rad_m",
        "rad/m",
        "heading change per path length",
        "sum of the magnitudes of all heading changes, divided by the path length",
        _heading_change,
        of="successes",
        paired=True,
    ),
    Metric(
        "mean_speed_m_s",
        "m/s",
        "mean speed",
        "mean speed of the origin of B",
        lambda run: float(np.mean(run.speed)),
    ),
    Metric(
        "top_speed_m_s",
        "m/s",
        "top speed",
        "maximum speed of the origin of B",
        lambda run: float(np.max(run.speed)),
        robots="greatest",
    ),
    Metric(
        "control_effort_rms_n",
        "N",
        "rms control effort",
        "RMS value of the total force on the virtual mass: attraction plus repulsion",
        _control_effort,
        of="successes",
        paired=True,
    ),
    Metric(
        "push_work_j",
        "J",
        "work of the push",
        "net work of the push on the virtual mass. If the value is positive, the push "
        "added more energy to the motion than it removed.",
        _push_work,
    ),
    Metric(
        "wheel_variation_m_s2",
        "m/s²",
        "variation of the wheel commands",
        "mean magnitude of the rate of change of the commanded speeds of the wheel "
        "rims",
        _wheel_variation,
        of="successes",
        paired=True,
    ),
    Metric(
        "saturated_fraction",
        "",
        "share of time at a speed limit",
        "fraction of the ticks at which the virtual mass or a wheel is at its speed "
        "limit",
        _saturated,
        of="successes",
        digits=2,
        paired=True,
    ),
    Metric(
        "impossible_obstacle_speed_ticks",
        "",
        "ticks with an impossible obstacle speed",
        "number of ticks at which the obstacle speed s that the law computed is more "
        "than twice the robot's top speed",
        _impossible_speeds,
        digits=0,
    ),
)
_ODOMETRY = (
    Metric(
        "odometry_error_rms_m",
        "m",
        "rms odometry error",
        "RMS value of the distance between the true and the computed position. Without "
        "slip, this distance is below 1 mm.",
        lambda run: rms(run.odometry_error),
        of="successes",
        paired=True,
    ),
    Metric(
        "odometry_error_final_m",
        "m",
        "odometry error at the end",
        "final value of the distance between the true and the computed position",
        lambda run: float(run.odometry_error[-1]),
        of="successes",
        paired=True,
    ),
    Metric(
        "odometry_heading_error_rms_deg",
        "deg",
        "rms heading error of the odometry",
        "RMS value of the heading error",
        lambda run: rms(
            np.degrees(run.columns["theta_WB_estimated"] - run.columns["theta_WB"])
        ),
        of="successes",
        paired=True,
    ),
    Metric(
        "slip_way_m",
        "m",
        "slip of the wheels",
        "distance by which the wheel rims slid over the floor in any direction, "
        "averaged over both wheels; `null` without `plant.friction`",
        _slip,
        of="successes",
        paired=True,
    ),
)
_HEARING = (
    Metric(
        "frames_with_sound",
        "",
        "frames with sound",
        "number of frames with sound",
        lambda run: int(np.count_nonzero(run.frames_with_sound)),
        digits=0,
    ),
    Metric(
        "frames_with_sound_heard",
        "",
        "frames with sound that were heard",
        "number of frames with sound in which the robot detected the source",
        lambda run: int(np.count_nonzero(run.frames_with_sound & run.detections)),
        digits=0,
    ),
    Metric(
        "detections",
        "",
        "detections",
        "number of all detections",
        lambda run: int(np.count_nonzero(run.detections)),
        digits=0,
    ),
    Metric(
        "detections_with_range",
        "",
        "detections with a range",
        "number of detections that include a range",
        lambda run: int(np.count_nonzero(run.ranged_detections)),
        digits=0,
    ),
    Metric(
        "source_error_median_m",
        "m",
        "median position error of the source",
        "median of the position error, over the detections that include a range",
        lambda run: quantile(run.source_errors, 0.5),
    ),
    Metric(
        "source_error_p95_m",
        "m",
        "95th percentile of the position error",
        "95th percentile of the position error, over the detections that include a "
        "range",
        lambda run: quantile(run.source_errors, 0.95),
    ),
    Metric(
        "source_outlier_fraction",
        "",
        "share of outliers",
        "fraction of the detections that have a position error above 0.5 m. Only "
        "detections that include a range count.",
        lambda run: share(run.source_errors > OUTLIER_M),
        digits=2,
    ),
)
#: All metrics. docs/metrics.md has one table per group.
GROUPS = (
    Group("all", lambda run: True, _ALL),
    Group("near", _drives, _NEAR),
    Group("contact", lambda run: _drives(run) and run.has("range_1"), _CONTACT),
    Group("goal", _drives, _GOAL),
    Group("world", _has_reference, _WORLD),
    Group("following", _follows, _FOLLOWING),
    Group("route", lambda run: run.routed, _ROUTE),
    Group("stiffness", lambda run: run.routed and run.has("stiffness"), _STIFFNESS),
    Group("damping", lambda run: run.routed and run.has("damping"), _DAMPING),
    Group("search", lambda run: run.searches, _SEARCH),
    Group("smoothness", _drives, _SMOOTHNESS),
    Group("odometry", _drives, _ODOMETRY),
    Group("hearing", lambda run: _drives(run) and run.has("detected"), _HEARING),
)
METRICS = {metric.name: metric for group in GROUPS for metric in group.metrics}
