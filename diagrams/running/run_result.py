"""The result of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from diagrams.building.robot import Parts
from diagrams.running.referee import Referee
from diagrams.running.stop_rules import SUCCESSFUL, Collision
from diagrams.scenario.bodies import RecordedPath, Surroundings
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.shorthand import ROBOT
from diagrams.scenario.warnings.scenario_warning import ScenarioWarning
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.search.search_ending import SEARCH_REASONS

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class RunResult:
    """Describes what a robot did at every tick (control period), and why its run ended.

    If the run has several robots, the field ``several`` has one result per robot. In
    the result of the whole run, each column name then begins with the name of the robot
    and a dot. Its ``cause`` is the cause of one robot (see ``Referee.decisive``).
    """

    scenario: Scenario
    """Scenario of the run. In the result of one of several robots, it is the scenario
    of that robot alone (``Scenario.of_robot``).
    """
    cause: str
    """Cause for which the run ended: reached, completed, found, unsettled, timeout,
    astray, collision, stuck, no way found, false find, lost, diverged, or interrupted.
    docs/model.md defines these causes.
    """
    collision: Collision | None
    """The collision, if the cause is collision."""
    columns: dict[str, NDArray[np.float64]]
    """Columns of ``trajectory``."""
    wall_s: float
    """Computing time of the simulation, s. It excludes the time to build the diagram,
    and the time to compile or load code with numba.
    """
    name: str = ROBOT
    """Name of the robot."""
    engine: Engine = "drake"
    """The engine that simulated the run."""
    several: dict[str, Self] = field(default_factory=dict)
    """Results of the individual robots, if there are several."""
    others: Surroundings | None = None
    """Surroundings of this robot, including the recorded paths of the other robots."""
    whole: Scenario | None = None
    """The whole scenario; None if ``scenario`` is the whole scenario."""
    ended: float = 0.0
    """Number of the ending of a search, see ``systems.search.search_ending``."""
    world: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """Columns with the data that the sink (the computer of the operator) received from
    each searching robot. The result of each robot contains these data, too:
    ``robot.frames`` in ``world`` equals ``sink_frames`` in ``columns`` of ``robot``.
    """

    @property
    def full_scenario(self) -> Scenario:
        """The whole scenario that was run."""
        return self.whole or self.scenario

    @cached_property
    def warnings(self) -> tuple[ScenarioWarning, ...]:
        """Warnings about the whole scenario."""
        return warnings_of(self.full_scenario)

    @property
    def robots(self) -> dict[str, Self]:
        """The result of each robot, by name."""
        return self.several or {self.name: self}

    @cached_property
    def surroundings(self) -> Surroundings:
        """The bodies that the robot could hit, and the target of the robot."""
        return self.others or self.scenario.surroundings()

    @property
    def ending(self) -> str:
        """The cause, with the touched object or the reason why the search ended."""
        if self.collision:
            return f"{self.cause} with {self.collision.object}"
        return f"{self.cause}: {self.reason}" if self.reason else self.cause

    @property
    def success(self) -> bool:
        """Whether the run ended well: at the goal, at what was sought, or on time."""
        return self.cause in SUCCESSFUL

    @property
    def reason(self) -> str:
        """The reason why a search was given up; otherwise empty."""
        return SEARCH_REASONS.get(round(self.ended), "")

    @property
    def target_moves(self) -> bool:
        """Whether the target of the robot ever moves."""
        return self.surroundings.followed.path.moves

    @property
    def goal_radius_m(self) -> float:
        """Greatest distance of P from the target with which P is in the goal, m."""
        return self.scenario.goal_radius(moves=self.target_moves)

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) times of the ticks, s."""
        return self.columns["t"]

    def poses(self, body: str) -> NDArray[np.float64]:
        """(n, 3) x, y, theta in W at the ticks, m and rad; body is ``WB`` or ``WS``."""
        names = (f"p_{body}_x", f"p_{body}_y", f"theta_{body}")
        return np.stack([self.columns[name] for name in names], axis=1)

    def vector(self, name: str) -> NDArray[np.float64]:
        """(2, n) x and y of a quantity at the ticks, for example ``p_WP``."""
        return np.array([self.columns[f"{name}_x"], self.columns[f"{name}_y"]])

    @property
    def simulated_s(self) -> float:
        """Simulated time, s."""
        return float(self.time[-1])

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """Table with one row per tick, in SI units and the frames of docs/model.md."""
        import pandas as pd

        return pd.DataFrame(self.columns)


def gather_result(
    referee: Referee,
    logs: Mapping[str, dict[str, NDArray[np.float64]]],
    wall_s: float,
    engine: Engine = "drake",
    world: dict[str, NDArray[np.float64]] | None = None,
) -> RunResult:
    """Makes the result of a run that has ended.

    Args:
        referee: The referee, which has judged the robots during the run.
        logs: Columns of each robot, including the time t.
        wall_s: Computing time of the simulation, s.
        engine: The engine that simulated the run.
        world: Columns of the blocks that all robots share.

    Returns:
        The result of the run. With several robots, its field ``several`` contains the
        result of each robot.
    """
    scenario = referee.scenario
    paths = {
        name: RecordedPath(log["t"], np.column_stack([log[key] for key in _POSE]))
        for name, log in logs.items()
    }
    several = len(logs) > 1
    results = {}
    for name, log in logs.items():
        around = scenario.surroundings(name, paths)
        own = scenario.of_robot(name)
        results[name] = RunResult(
            own,
            referee.cause_of(name),
            referee.collision(name),
            _completed(log, own, around) | _heard_by_sink(world or {}, name),
            wall_s,
            name,
            engine,
            others=around,
            whole=None if own is scenario else scenario,
            ended=referee.ended(name),
            world=world or {},
        )
    if not several:
        return next(iter(results.values()))
    columns = {"t": next(iter(logs.values()))["t"]}
    for name, result in results.items():
        for key, values in result.columns.items():
            if key != "t":
                columns[f"{name}.{key}"] = values
    decisive = results[referee.decisive]
    return RunResult(
        scenario,
        decisive.cause,
        decisive.collision,
        columns,
        wall_s,
        decisive.name,
        engine,
        several=results,
        ended=decisive.ended,
        world=world or {},
    )


def _heard_by_sink(
    world: Mapping[str, NDArray[np.float64]], robot: str
) -> dict[str, NDArray[np.float64]]:
    """Returns what the sink has received from one robot, as columns of this robot."""
    begin = f"{robot}."
    return {
        f"sink_{key.removeprefix(begin)}": values
        for key, values in world.items()
        if key.startswith(begin)
    }


_POSE = ("p_WB_x", "p_WB_y", "theta_WB")


def logged_columns(
    parts: Parts, times: NDArray[np.float64], rows: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Returns the columns of a robot's log, including the time of each row.

    Args:
        parts: Blocks of the robot, and names of its columns.
        times: (n,) times of the rows, s.
        rows: (columns, n) logged values.

    Returns:
        (n,) array of each column, by name of the column.
    """
    names = [name for columns in parts.logged.values() for name in columns]
    return {"t": times, **dict(zip(names, rows, strict=True))}


def _completed(
    columns: dict[str, NDArray[np.float64]], scenario: Scenario, around: Surroundings
) -> dict[str, NDArray[np.float64]]:
    """Adds columns that follow from the logged columns.

    These columns are the position of the control point P, the true pose of the source,
    and the true and measured range and bearing of the source.
    """
    offset, theta = scenario.only.robot.control_point_m, columns["theta_WB"]
    c, s = np.cos(theta), np.sin(theta)
    x_P = columns["p_WB_x"] + offset * c
    y_P = columns["p_WB_y"] + offset * s
    pose_WS = np.ascontiguousarray(around.followed.path.poses(columns["t"]).T)
    columns["p_WS_x"], columns["p_WS_y"], columns["theta_WS"] = pose_WS
    dx, dy = columns["p_WS_x"] - x_P, columns["p_WS_y"] - y_P
    ahead, left = c * dx + s * dy, c * dy - s * dx
    columns["p_WP_x"], columns["p_WP_y"] = x_P, y_P
    columns["source_range_true"] = np.sqrt(dx * dx + dy * dy)
    columns["source_bearing_true"] = np.arctan2(left, ahead)
    if "detected" not in columns:  # the robot drives to a goal or searches for an odor
        return columns
    x, y = columns["p_PS_B_x"], columns["p_PS_B_y"]
    heard, ranged = columns["detected"] > 0.5, columns["range_valid"] > 0.5
    columns["source_bearing"] = np.where(heard, np.arctan2(y, x), np.nan)
    columns["source_range"] = np.where(heard & ranged, np.hypot(x, y), np.nan)
    return columns
