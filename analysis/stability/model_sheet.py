"""The model sheet of a stability analysis: equations, parameters, limits, latencies.

The sheet takes all values from the scenario and from the parameter models of the
blocks. Its formulas are the formulas of docs/model.md.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from analysis.report.provenance import versions
from analysis.stability.choice import plans
from diagrams import Scenario, dump_scenario
from diagrams.scenario.participants import Follower, Router
from systems.framework.meanings import meanings
from systems.framework.parameters import Parameters
from systems.heading.heading_controller import TURNING_BEYOND_DEG
from systems.laws.catalog import LAWS
from systems.laws.law import Equation
from systems.laws.parameters import ImpedanceParameters

#: Groups of fields that affect the control loop with exact sensors, by kind of robot.
_PARTS = {
    "follower": ("attraction", "collision_vector", "robot", "plant", "tracker"),
    "router": ("robot", "plant", "route", "objects"),
    "odor_searcher": ("robot", "plant", "compass", "motor_driver", "search"),
    "sound_searcher": ("robot", "plant", "compass", "motor_driver", "sound_search"),
}
#: Fields of these groups, and of the group ``sound``, that do not affect the loop.
_OTHERS = frozenset(
    {
        "robot.microphones_m",
        "plant.pulses_per_revolution",
        "collision_vector.aggregation",
        *(f"sound.{name}" for name in ("kind", "file", "level_pa")),
        *(f"sound.{name}_hz" for name in ("low", "high", "tone")),
    }
)
#: The field that selects which speed of an obstacle the law uses: ``printed`` or
#: ``closing``.
_VELOCITY_TERM = "collision_vector.velocity_term"
#: Fields that have no effect on the guarded law.
_NOT_GUARDED = frozenset(
    {"attraction.stiffness_n_m", "attraction.damping_n_s_m", _VELOCITY_TERM}
)

#: Conventions that hold for every law.
_CONVENTIONS = (
    (
        "World frame W is on the floor. Body frame B is midway between the wheels, "
        "with x forward."
    ),
    (
        "Angles are counter-clockwise, in rad unless a name ends in `_deg`; all units "
        "are SI."
    ),
    (
        "P is ahead of the axle by epsilon and carries the virtual mass M. The weight "
        "of the robot acts through the motor lag only."
    ),
)
_ASSUMPTIONS = (
    *_CONVENTIONS,
    (
        "Linear models describe the diagram that is simulated with exact sensors "
        "(`hearing` and `obstacle_sensing` ideal, odometry not rounded). They include "
        "no noise, no converter, no estimator and no cones."
    ),
    (
        "They are valid while |v_P| and the wheels stay below their limits, and while "
        "no echo appears or disappears."
    ),
    (
        "The heading follows the motion of P and is neutral at rest. Its poles at 0 "
        "(z = 1) do not count for stability."
    ),
)
_ROUTE_ASSUMPTIONS = (
    *_CONVENTIONS,
    (
        "Linear models describe law, wheel command, plant and odometry (not rounded) "
        "with constant gains; the object sensor is exact and has its latency."
    ),
    (
        "They are valid while |v_P|, the acceleration and the wheels stay below their "
        "limits."
    ),
    "No linear model includes the planner, the safety filter or the adaptation.",
)
_DRIVE_ASSUMPTIONS = (
    *_CONVENTIONS[:2],
    (
        "Linear models describe the law on free floor, with the motor lag and exact "
        "sensors. They are valid while speed and yaw rate stay below their limits."
    ),
    "No linear model includes the map, the planner, weaving, looks or the guard.",
)


@dataclass(frozen=True)
class ParameterRow:
    """A parameter that affects the loop."""

    field: str
    """Path of the parameter in the scenario."""
    part: str
    """Group of the parameter: the first paragraph of the docstring of its model."""
    value: Any
    """Value in the scenario."""
    changed: bool
    """Whether the value differs from the default."""
    text: str
    """Meaning of the parameter: the docstring of its field in the parameter model."""

    @property
    def of_law(self) -> bool:
        """Whether the parameter belongs to the law, rather than to every loop."""
        return (
            self.field.startswith(("impedance.", "laws."))
            or self.field == _VELOCITY_TERM
        )


@dataclass(frozen=True)
class Limit:
    """A limit within which the linear models are valid, or the robot operates."""

    quantity: str
    value: float
    unit: str
    remark: str


@dataclass(frozen=True)
class Latency:
    """A delay on the way from a measured quantity to the wheels."""

    path: str
    """What is measured: ``source``, ``goal``, ``target``, ``obstacle``, or
    ``heading``."""
    part: str
    """What causes the delay."""
    mean_s: float
    """Mean delay, s."""
    remark: str


@dataclass(frozen=True)
class ModelSheet:
    """The model sheet of a stability report: what the analysis assumes."""

    scenario: str
    """Name of the scenario."""
    description: str
    law: str
    seed: int
    scenario_sha256: str
    """SHA-256 of the effective scenario with this law, as YAML."""
    motion: tuple[Equation, ...]
    """Equations that hold for every law."""
    law_equations: tuple[Equation, ...]
    """Equations of the law. Empty for a user's own law."""
    parameters: tuple[ParameterRow, ...]
    envelope: tuple[Limit, ...]
    latencies: tuple[Latency, ...]
    assumptions: tuple[str, ...]
    versions: dict[str, str]

    @property
    def paths(self) -> tuple[str, ...]:
        """Measured quantities that have latencies, for example ``source``."""
        return tuple(dict.fromkeys(row.path for row in self.latencies))

    def latency_s(self, path: str) -> float:
        """Returns the sum of all mean delays from a measured quantity to the wheels, s.

        ``path`` is one of ``paths``.
        """
        return sum(row.mean_s for row in self.latencies if row.path == path)


def model_sheet(scenario: Scenario) -> ModelSheet:
    """Makes the model sheet for the law of a scenario."""
    law, routed = LAWS.get(scenario.only.law), scenario.only.kind == "router"
    motion: tuple[Equation, ...]
    assumptions: tuple[str, ...]
    envelope: tuple[Limit, ...]
    latencies: tuple[Latency, ...]
    if scenario.only.searches is not None:
        motion = _SEARCH_MOTION
        envelope, latencies = (
            _search_envelope(scenario),
            _drive_latencies(scenario, "heading"),
        )
        assumptions = _SEARCH_ASSUMPTIONS
    elif routed:
        motion, assumptions = _route_motion(scenario.tick_s), _ROUTE_ASSUMPTIONS
        envelope, latencies = _route_envelope(scenario), _route_latencies(scenario)
    elif plans(scenario.only.law):
        motion, assumptions = (), _DRIVE_ASSUMPTIONS
        envelope, latencies = _envelope(scenario), _latencies(scenario)
    else:
        motion, assumptions = _motion(scenario.tick_s), _ASSUMPTIONS
        envelope, latencies = _envelope(scenario), _latencies(scenario)
    return ModelSheet(
        scenario=scenario.name,
        description=scenario.description,
        law=scenario.only.law,
        seed=scenario.seed,
        scenario_sha256=hashlib.sha256(dump_scenario(scenario).encode()).hexdigest(),
        motion=motion,
        law_equations=law.equations if law else (),
        parameters=tuple(_parameters(scenario)),
        envelope=envelope,
        latencies=latencies,
        assumptions=assumptions,
        versions=versions(),
    )


def _parameters(scenario: Scenario) -> Iterator[ParameterRow]:
    robot = scenario.only
    groups: dict[str, Parameters] = {
        f"{part}.": getattr(robot, part) for part in _PARTS[robot.kind]
    }
    if isinstance(robot, Follower):
        if robot.gains is not None:
            groups[f"laws.{robot.law}."] = robot.gains
        if robot.hearing != "ideal_always":
            groups["sound."] = scenario.source.sound
    others = _OTHERS | _NOT_GUARDED if plans(robot.law) else _OTHERS
    for prefix, group in groups.items():
        yield from (row for row in _rows(group, prefix) if row.field not in others)
    if isinstance(robot, Router):
        for row in _rows(robot.gains, ""):
            shared = row.field in ImpedanceParameters.model_fields
            name = "impedance" if shared else f"laws.{robot.law}"
            yield replace(row, field=f"{name}.{row.field}")


def _rows(parameters: Parameters, prefix: str) -> Iterator[ParameterRow]:
    default = type(parameters)()
    part = (type(parameters).__doc__ or "").partition("\n\n")[0]
    told = meanings(type(parameters))
    for name in type(parameters).model_fields:
        value = getattr(parameters, name)
        if isinstance(value, Parameters):
            yield from _rows(value, f"{prefix}{name}.")
            continue
        changed = value != getattr(default, name)
        text = _one_line(told.get(name, ""))
        yield ParameterRow(f"{prefix}{name}", _one_line(part), value, changed, text)


def _one_line(text: str) -> str:
    return " ".join(text.replace("``", "`").split())


def _envelope(scenario: Scenario) -> tuple[Limit, ...]:
    robot, sensors = scenario.only.robot, scenario.follower.ultrasonic
    source, target = scenario.source, _target(scenario)
    speed = source.speed_m_s if source.path().moves else 0.0
    return (
        Limit("speed of P", robot.top_speed_m_s, "m/s", "limit of the state v_P"),
        Limit("wheel speed", robot.top_wheel_speed, "rad/s", "both scaled together"),
        Limit(f"speed of the {target}", speed, "m/s", "this scenario"),
        Limit(
            "nearest echo",
            sensors.minimum_range_m,
            "m",
            "nearer obstacles are reported at this distance",
        ),
        Limit("farthest echo", sensors.maximum_range_m, "m", "no echo beyond it"),
        Limit(
            "age of a target",
            scenario.follower.tracker.maximum_age_s,
            "s",
            "the robot brakes if it is older",
        ),
    )


def _target(scenario: Scenario) -> str:
    """Returns ``source``, or ``goal`` if the robot drives to a goal point."""
    return "goal" if scenario.drives_to_point(next(iter(scenario.robots))) else "source"


def _latencies(scenario: Scenario) -> tuple[Latency, ...]:
    return (
        *_hearing_latencies(scenario),
        *_drive_latencies(scenario, _target(scenario)),
        Latency("obstacle", "echo measured", 0.0, "travel time is not modeled"),
        *_drive_latencies(scenario, "obstacle"),
    )


def _hearing_latencies(scenario: Scenario) -> Iterator[Latency]:
    """Yields the delays of the robot's hearing; ideal hearing has fewer."""
    tick, hearing = scenario.tick_s, scenario.follower.hearing
    target, sound = _target(scenario), scenario.source.sound
    if hearing == "audio":
        frame = f"middle of a {tick * 1e3:g} ms frame"
        yield Latency("source", "sound collected", tick / 2.0, frame)
        yield Latency("source", "estimate computed", tick, "TDOAEstimator: one tick")
    else:
        yield Latency(target, "position measured", tick, "IdealSourceSensor: one tick")
    if hearing != "ideal_always":
        silent = max(sound.period_s - sound.on_s, 0.0)
        yield Latency(
            "source",
            "silence between bursts",
            silent**2 / (2.0 * sound.period_s),
            f"up to {silent:g} s; 0 while the source sounds; the tracker bridges it",
        )


def _drive_latencies(scenario: Scenario, path: str) -> tuple[Latency, Latency]:
    block, held = "WheelCommand", "velocity held for one tick"
    if scenario.only.searches is not None:
        block, held = "MotorDriver", "duties held for one tick"
    return (
        Latency(path, held, scenario.tick_s / 2.0, block),
        Latency(path, "motor lag", scenario.only.plant.motor_lag_s, "first order"),
    )


_SEARCH_MOTION = (
    Equation(
        "Deviation from the expected heading",
        r"\gamma=\mathrm{wrap}(\beta-\alpha),\quad"
        r"\epsilon=2\gamma+0.5\int\,\,\gamma\,dt+0.01\,\dot{\gamma}",
        "gamma = wrap(beta - alpha), "
        "eps = 2 gamma + 0.5 integral of gamma + 0.01 gamma'",
    ),
    Equation(
        "Duties of the motors",
        r"d_{l,r}=\max(0,1-|\epsilon|/L)\pm 0.01\,\epsilon",
        "d_l, d_r = max(0, 1 - |eps|/L) +- 0.01 eps",
    ),
)

_SEARCH_ASSUMPTIONS = (
    (
        "The margins describe the heading loop while the robot drives ahead, within "
        "all limits."
    ),
    "The decisions of a step are not part of a linear model.",
)


def _search_envelope(scenario: Scenario) -> tuple[Limit, ...]:
    motors = scenario.searcher.motor_driver.full_speed_m_s
    return (
        Limit("speed of a wheel", motors, "m/s", "at full duty"),
        Limit(
            "output of the PID",
            TURNING_BEYOND_DEG,
            "deg",
            "the robot turns on the spot beyond it",
        ),
    )


def _route_envelope(scenario: Scenario) -> tuple[Limit, ...]:
    robot, target = scenario.only.robot, scenario.router.route
    return (
        Limit("speed of P", robot.top_speed_m_s, "m/s", "limit of the state v_P"),
        Limit("wheel speed", robot.top_wheel_speed, "rad/s", "both scaled together"),
        Limit("speed of the target", target.speed_m_s, "m/s", "along the route"),
        Limit("objects seen", scenario.router.objects.maximum_range_m, "m", "from P"),
    )


def _route_latencies(scenario: Scenario) -> tuple[Latency, ...]:
    latency_s = scenario.router.objects.latency_s
    return (
        *_drive_latencies(scenario, "target"),
        Latency("obstacle", "objects seen", latency_s, "objects.latency_s"),
        *_drive_latencies(scenario, "obstacle"),
    )


def _route_motion(tick_s: float) -> tuple[Equation, ...]:
    command, plant = _drive(tick_s)
    return (
        Equation(
            "Virtual mass at P",
            r"M\,\ddot{p} = U + V",
            "M p'' = U + V, the pull of the target and the push of contacts",
        ),
        command,
        plant,
    )


def _motion(tick_s: float) -> tuple[Equation, ...]:
    return (
        Equation(
            "Virtual mass at P",
            r"M\,\ddot{p} = F_m + F_b,\quad F_b=\sum f(c,s)\,u,"
            r"\quad u=-C_W/c,\quad c=|C_W|",
            "M p'' = F_m + sum of f(c, s) u, u = -C_W/c, c = |C_W|",
        ),
        Equation(
            "Attraction",
            r"F_m = K_r\,(p_S-p)\left(1-\frac{d_f}{|p_S-p|}\right)-D_r\,v_P",
            "F_m = K_r (p_S - p)(1 - d_f/|p_S - p|) - D_r v_P",
        ),
        *_drive(tick_s),
    )


def _drive(tick_s: float) -> tuple[Equation, Equation]:
    """Returns the equations of the wheel command and of the plant."""
    return (
        Equation(
            f"Command, each tick T = {tick_s * 1e3:g} ms",
            r"v_P \leftarrow v_P + T\,\ddot{p},\quad v=v_P\cdot x_B,"
            r"\quad \omega=v_P\cdot y_B/\epsilon",
            "v_P <- v_P + T p'', v = v_P . x_B, omega = v_P . y_B / epsilon",
        ),
        Equation(
            "Plant",
            r"\dot{x}=v\cos\theta,\quad\dot{y}=v\sin\theta,\quad\dot{\theta}=\omega,"
            r"\quad\ddot{\phi}_i=(\dot{\phi}_i^{cmd}-\dot{\phi}_i)/\mathrm{lag}",
            "x' = v cos theta, y' = v sin theta, theta' = omega, "
            "phi_i'' = (commanded - phi_i')/lag",
        ),
    )
