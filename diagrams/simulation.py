"""Runs a scenario and returns what happened."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)

from diagrams.builder import SoundFollower, build_sound_follower
from diagrams.scenario import Scenario
from diagrams.stop_rules import Collision, StopRules
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["RunResult", "load_compiled_code", "make_simulator", "simulate"]

#: Columns of the trajectory table, by logged port.
COLUMNS = {
    ("plant", "pose_WB"): ("p_WB_x", "p_WB_y", "theta_WB"),
    ("plant", "velocity_WB"): ("v_WB_x", "v_WB_y", "omega_WB"),
    ("source", "pose_WS"): ("p_WS_x", "p_WS_y", "theta_WS"),
    ("hearing", "p_PS_B"): ("p_PS_B_x", "p_PS_B_y"),
    ("hearing", "detected"): ("detected",),
    ("hearing", "range_valid"): ("range_valid",),
    ("tracker", "p_WS_estimated"): ("p_WS_estimated_x", "p_WS_estimated_y"),
    ("tracker", "target_valid"): ("target_valid",),
    ("odometry", "pose_WB_estimated"): (
        "p_WB_estimated_x",
        "p_WB_estimated_y",
        "theta_WB_estimated",
    ),
    ("collision", "collision_vectors_B"): tuple(
        f"collision_{slot}_B_{axis}" for slot in (1, 2, 3) for axis in "xy"
    ),
    ("collision", "features"): ("feature_1", "feature_2", "feature_3"),
    ("controller", "forces_W"): (
        "attraction_x",
        "attraction_y",
        "repulsion_x",
        "repulsion_y",
    ),
    ("controller", "obstacle_speeds"): tuple(
        f"obstacle_speed_{slot}" for slot in (1, 2, 3)
    ),
    ("command", "wheel_speeds"): ("wheel_speed_left", "wheel_speed_right"),
    ("command", "v_WP"): ("v_WP_x", "v_WP_y"),
    ("ultrasonic", "ranges"): ("range_1", "range_2", "range_3"),
    ("ultrasonic", "echo"): ("echo_1", "echo_2", "echo_3"),
    ("plant", "slip_velocities"): ("slip_left", "slip_right", "slip_sideways"),
}

# Until then a source that sounds from the first instant has been heard and followed.
_FIRST_TICKS_S = 0.15
# Kinds of builds that were run in this process.
_LOADED: set[tuple[object, ...]] = set()


@dataclass(frozen=True)
class RunResult:
    """What a run did, at every 25 ms tick, and why it ended."""

    scenario: Scenario
    cause: str
    """One of reached, completed, unsettled, timeout, astray, collision, stuck, lost,
    diverged; docs/model.md says when."""
    collision: Collision | None
    """Set where the cause is collision."""
    columns: dict[str, NDArray[np.float64]]
    """Columns of ``trajectory``."""
    wall_s: float
    """Time that the simulation took, without building the diagram and compiling or
    loading what numba compiles, s."""

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) s."""
        return self.columns["t"]

    def poses(self, body: str) -> NDArray[np.float64]:
        """(n, 3) x, y, theta in W at the ticks, m and rad; body ``WB`` or ``WS``."""
        names = (f"p_{body}_x", f"p_{body}_y", f"theta_{body}")
        return np.stack([self.columns[name] for name in names], axis=1)

    @property
    def simulated_s(self) -> float:
        """Simulated time, s."""
        return float(self.time[-1])

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """A row a tick: SI units, frames as in docs/model.md."""
        import pandas as pd

        return pd.DataFrame(self.columns)


def make_simulator(follower: SoundFollower) -> Simulator:
    """A simulator of the diagram with the scenario's integrator."""
    simulator = Simulator(follower.diagram)
    config = SimulatorConfig()
    config.integration_scheme = follower.scenario.integrator.scheme
    config.max_step_size = follower.scenario.integrator.step_s
    config.use_error_control = False
    ApplySimulatorConfig(config, simulator)
    return simulator


def simulate(
    scenario: Scenario,
    *,
    follower: SoundFollower | None = None,
    progress: Callable[[float], None] | None = None,
) -> RunResult:
    """Runs a scenario to its end.

    Args:
        scenario: What to run.
        follower: A logged build of the same scenario to use again: Drake
            never frees blocks written in Python, so many runs in one process
            should share a build.
        progress: Called with the simulated time, s, once a simulated second.

    Returns:
        ``RunResult``.

    Raises:
        InputError: The law is not known.
        InputError: The sound file cannot be played, or a value became NaN.
    """
    follower = follower or build_sound_follower(scenario, log=True)
    if follower.scenario != scenario or follower.log is None:
        raise InputError(
            "simulate", "follower must be built from the same scenario with log=True"
        )
    load_compiled_code(follower)
    simulator = make_simulator(follower)
    rules = StopRules(follower)
    simulator.set_monitor(rules)
    start = perf_counter()
    simulator.Initialize()
    views = _python_views(follower, simulator.get_context())
    for second in range(1, math.ceil(scenario.duration_s) + 1):
        simulator.AdvanceTo(min(second, scenario.duration_s))
        if progress is not None:
            progress(simulator.get_context().get_time())
        if rules.cause:
            break
    wall_s = perf_counter() - start
    views.clear()
    columns = _columns(follower, simulator.get_context())
    return RunResult(scenario, rules.final_cause(), rules.collision, columns, wall_s)


def _python_views(follower: SoundFollower, context: Any) -> list[Any]:
    """Objects by which Python sees contexts, states and outputs of the blocks.

    As long as they are held, they are not made anew for each call of a block: 5 %
    of a run.
    """
    views: list[Any] = []
    for role, block in follower.blocks.items():
        own = block.GetMyContextFromRoot(context)
        groups = range(own.num_discrete_state_groups())
        views += [own, *(own.get_discrete_state(group) for group in groups)]
        if own.num_continuous_states():
            views.append(own.get_continuous_state_vector())
        logged = (name for owner, name in follower.logged if owner == role)
        views += [follower.port(role, name).EvalBasicVector(own) for name in logged]
    return views


def load_compiled_code(follower: SoundFollower) -> None:
    """Runs some ticks aside where a process runs a kind of build for the first time.

    numba compiles then, or loads what it compiled in an earlier process: a tenth of
    a run of 40 s, or many times a run, which is none of the simulation's own time.
    ``simulate`` does it by itself; a process that forks does it beforehand.

    Raises:
        InputError: As ``simulate``.
    """
    scenario = follower.scenario
    kind = (
        scenario.hearing,
        scenario.obstacle_sensing,
        scenario.law,
        scenario.tdoa.method,
        scenario.room is None,
        scenario.plant.friction is None,
    )
    if kind not in _LOADED:
        simulator = make_simulator(follower)
        simulator.Initialize()
        simulator.AdvanceTo(min(_FIRST_TICKS_S, scenario.duration_s))
        _LOADED.add(kind)


def _columns(follower: Any, context: Any) -> dict[str, NDArray[np.float64]]:
    log = follower.log.FindLog(context)
    names = [name for key in follower.logged for name in COLUMNS[key]]
    rows = zip(names, np.array(log.data()), strict=True)
    columns = {"t": np.array(log.sample_times()), **dict(rows)}
    offset = follower.scenario.robot.control_point_m
    theta = columns["theta_WB"]
    x_P = columns["p_WB_x"] + offset * np.cos(theta)
    y_P = columns["p_WB_y"] + offset * np.sin(theta)
    dx, dy = columns["p_WS_x"] - x_P, columns["p_WS_y"] - y_P
    bearing = np.arctan2(dy, dx) - theta
    columns["p_WP_x"], columns["p_WP_y"] = x_P, y_P
    columns["source_range_true"] = np.hypot(dx, dy)
    columns["source_bearing_true"] = np.arctan2(np.sin(bearing), np.cos(bearing))
    x, y = columns["p_PS_B_x"], columns["p_PS_B_y"]
    heard, ranged = columns["detected"] > 0.5, columns["range_valid"] > 0.5
    columns["source_bearing"] = np.where(heard, np.arctan2(y, x), np.nan)
    columns["source_range"] = np.where(heard & ranged, np.hypot(x, y), np.nan)
    return columns
