"""What a run did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from diagrams.building.robot import Parts
from diagrams.running.stop_rules import Collision, RobotRules, decisive_robot
from diagrams.scenario.bodies import RecordedPath, Surroundings
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import ROBOT, Scenario
from diagrams.scenario.warnings.scenario_warning import ScenarioWarning
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.search.search_ending import SEARCH_REASONS

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class RunResult:
    """What a robot did, at every tick, and why its run ended.

    Of several robots, what all did: ``robots`` has one of each, the names of
    columns begin with that of the robot and a dot, and the cause is that of the
    first robot which did not do what it should, the ones that touched something
    before the others.
    """

    scenario: Scenario
    """Of one robot among several, that of it alone (``Scenario.of_robot``)."""
    cause: str
    """One of reached, completed, found, unsettled, timeout, astray, collision, stuck,
    no way found, false find, lost, diverged, interrupted; docs/model.md says when."""
    collision: Collision | None
    """Set where the cause is collision."""
    columns: dict[str, NDArray[np.float64]]
    """Columns of ``trajectory``."""
    wall_s: float
    """Time that the simulation took, without building the diagram and compiling or
    loading what numba compiles, s."""
    name: str = ROBOT
    """Of the robot."""
    engine: Engine = "drake"
    """What carried the run out."""
    several: dict[str, Self] = field(default_factory=dict)
    """What each robot did, where there are several."""
    others: Surroundings | None = None
    """What this robot had about it, other robots on their ways included."""
    whole: Scenario | None = None
    """What was run, where that is more than ``scenario``."""
    ended: float = 0.0
    """Number of the ending of a search, see ``systems.search.search_ending``."""
    world: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """What the sink of a search has heard of each robot, which is in its columns, too:
    ``robot.frames`` here is ``sink_frames`` there."""

    @property
    def full_scenario(self) -> Scenario:
        """The whole scenario that was run."""
        return self.whole or self.scenario

    @cached_property
    def warnings(self) -> tuple[ScenarioWarning, ...]:
        """What a user must know of the whole scenario, although it could be run."""
        return warnings_of(self.full_scenario)

    @property
    def robots(self) -> dict[str, Self]:
        """What each robot did, by name."""
        return self.several or {self.name: self}

    @cached_property
    def surroundings(self) -> Surroundings:
        """What the robot could hit, and what it followed."""
        return self.others or self.scenario.surroundings()

    @property
    def ending(self) -> str:
        """Cause, and what was touched, or why a search was given up."""
        if self.collision:
            return f"{self.cause} with {self.collision.object}"
        return f"{self.cause}: {self.reason}" if self.reason else self.cause

    @property
    def reason(self) -> str:
        """Why a search was given up; else empty."""
        return SEARCH_REASONS.get(round(self.ended), "")

    @property
    def target_moves(self) -> bool:
        """Whether what is followed ever moves."""
        return self.surroundings.followed.path.moves

    @property
    def goal_radius_m(self) -> float:
        """P is in the goal within this distance of what it follows, m."""
        return self.scenario.goal_radius(moves=self.target_moves)

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) s."""
        return self.columns["t"]

    def poses(self, body: str) -> NDArray[np.float64]:
        """(n, 3) x, y, theta in W at the ticks, m and rad; body ``WB`` or ``WS``."""
        names = (f"p_{body}_x", f"p_{body}_y", f"theta_{body}")
        return np.stack([self.columns[name] for name in names], axis=1)

    def vector(self, name: str) -> NDArray[np.float64]:
        """(2, n) x and y of a column's quantity at the ticks, as of ``p_WP``."""
        return np.array([self.columns[f"{name}_x"], self.columns[f"{name}_y"]])

    @property
    def simulated_s(self) -> float:
        """Simulated time, s."""
        return float(self.time[-1])

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """A row a tick: SI units, frames as in docs/model.md."""
        import pandas as pd

        return pd.DataFrame(self.columns)


def gather_result(
    scenario: Scenario,
    rules: Mapping[str, RobotRules],
    logs: Mapping[str, dict[str, NDArray[np.float64]]],
    wall_s: float,
    engine: Engine = "drake",
    world: dict[str, NDArray[np.float64]] | None = None,
) -> RunResult:
    """The result of a run that has ended.

    Args:
        scenario: That was run.
        rules: Each robot's stop rules, with their causes.
        logs: Each robot's columns, with the time t.
        wall_s: Time that the simulation took, s.
        engine: What carried the run out.
        world: Columns of what all robots share.

    Returns:
        Of the only robot, or of all with each in ``several``.
    """
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
            rules[name].final_cause(),
            rules[name].collision,
            _completed(log, own, around) | _heard_by_sink(world or {}, name),
            wall_s,
            name,
            engine,
            others=around,
            whole=None if own is scenario else scenario,
            ended=rules[name].ended,
            world=world or {},
        )
    if not several:
        return next(iter(results.values()))
    columns = {"t": next(iter(logs.values()))["t"]}
    for name, result in results.items():
        for key, values in result.columns.items():
            if key != "t":
                columns[f"{name}.{key}"] = values
    decisive = results[decisive_robot(rules)]
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
    """What the sink of a search knows of one robot, as columns of that robot."""
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
    """The columns of a robot's log, and the time.

    Args:
        parts: Of the robot.
        times: (n,) s.
        rows: (columns, n) what was logged.

    Returns:
        (n,) each, by name.
    """
    names = [name for columns in parts.logged.values() for name in columns]
    return {"t": times, **dict(zip(names, rows, strict=True))}


def _completed(
    columns: dict[str, NDArray[np.float64]], scenario: Scenario, around: Surroundings
) -> dict[str, NDArray[np.float64]]:
    """With what follows from the log: P, and the true and heard place of the source."""
    offset, theta = scenario.robot.control_point_m, columns["theta_WB"]
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
    if "detected" not in columns:  # it drives to a goal, or smells
        return columns
    x, y = columns["p_PS_B_x"], columns["p_PS_B_y"]
    heard, ranged = columns["detected"] > 0.5, columns["range_valid"] > 0.5
    columns["source_bearing"] = np.where(heard, np.arctan2(y, x), np.nan)
    columns["source_range"] = np.where(heard & ranged, np.hypot(x, y), np.nan)
    return columns
