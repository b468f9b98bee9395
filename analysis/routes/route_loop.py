"""The linearized loop of a robot on a route, with constant gains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import DiscreteTimeApproximation

from analysis.loops.block_models import block_model, join_blocks
from analysis.loops.ideal_scenarios import require_rolling
from analysis.loops.linear_models import LinearModel, minimal_model
from diagrams.running.simulation import simulator_config
from diagrams.scenario.scenario import Scenario
from systems import DiffDrivePlant
from systems.base.wheel_odometry import WheelOdometry_
from systems.base.wheel_speed_command import WheelCommand_
from systems.framework.block import Block, part_of
from systems.framework.input_error import InputError
from systems.laws.catalog import ROUTE_LAWS
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.laws.trajectory.trajectory_impedance_controller import (
    TrajectoryImpedanceController_,
)
from systems.ranging.objects import KNOWN, THERE, X
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

#: Directions in which the loop is analyzed: along the route and across it.
AXES = ("along", "across")
#: Name of the law's output port, and its name after a cut. Ports with the same name are
#: connected. With the other name, the output is not connected to any input.
_COMMAND, _LAW = "acceleration_W", "law_W"
#: Distances from P to a wall, as shares of the radius of the security zone. They are
#: used if the contact damping depends on the distance.
_DEPTHS = {"edge of a zone": 0.999, "half way in": 0.5, "deep in": 0.1}


@dataclass(frozen=True)
class RoutePoint:
    """An operating point of the linearized loop. The robot faces along x."""

    name: str
    speed_m_s: float = 0.0
    """Speed of target and robot along x, m/s."""
    wall_m: float | None = None
    """Distance from control point P to a wall straight ahead, m. None: no wall."""


def route_law(scenario: Scenario) -> TrajectoryImpedanceParameters:
    """Returns the parameters of the law of the scenario's only robot.

    The function raises an InputError if the robot has no route, or if its law is not
    for a route.
    """
    if scenario.only.kind != "router" or scenario.only.law not in ROUTE_LAWS:
        raise InputError(
            "law",
            f"is {scenario.only.law!r}, but frozen gains need a robot with a route and "
            f"one of the laws {', '.join(ROUTE_LAWS)}; use one of these",
        )
    own: TrajectoryImpedanceParameters = scenario.router.gains
    return own


def route_points(scenario: Scenario) -> tuple[RoutePoint, ...]:
    """Returns the operating points: on the route, at rest, and in front of a wall.

    The points in front of a wall exist only if the law has contact stiffness or contact
    damping.
    """
    own = route_law(scenario)
    points = [
        RoutePoint("on the route", speed_m_s=scenario.router.route.speed_m_s),
        RoutePoint("at rest"),
    ]
    if own.contact_stiffness_n_m > 0.0 or own.contact_damping_n_s_m > 0.0:
        zone_m = own.security_zone_m
        depths = _DEPTHS if own.damping_fades else {"in a zone": 0.5}
        points += [RoutePoint(name, wall_m=d * zone_m) for name, d in depths.items()]
    return tuple(points)


def contact_gains(
    own: TrajectoryImpedanceParameters, distance_m: float
) -> tuple[float, float]:
    """Computes the stiffness, N/m, and the damping, N s/m, that a contact adds.

    Both act along the line from the object to the control point P. ``distance_m`` is
    the distance between object and P. Outside the security zone, both are 0.
    """
    if distance_m >= own.security_zone_m:
        return 0.0, 0.0
    share = 1.0 - distance_m / own.security_zone_m if own.damping_fades else 1.0
    return own.contact_stiffness_n_m, float(share * own.contact_damping_n_s_m)


def frozen_model(scenario: Scenario, point: RoutePoint) -> LinearModel:
    """Computes a minimal sampled linear model of the closed loop.

    One step of the model is one control period. The inputs are the target's position,
    m, and velocity, m/s. The outputs are the position of the control point P, m. The
    law, wheel command, plant and odometry are the blocks of the simulation. AutoDiff
    linearizes each block, and ports with the same name are connected. States that are
    not controllable or not observable are removed. The model assumes that the safety
    filter is inactive, that gains do not adapt, and that no limit is reached. The
    function raises an InputError if the law is not for a route, or if the wheels can
    slip.
    """
    return minimal_model(whole_route_model(scenario, point))


def whole_route_model(scenario: Scenario, point: RoutePoint) -> LinearModel:
    """Computes the model of ``frozen_model``, but keeps all states.

    The states are those of the plant, the odometry, the wheel command and the latency
    of the object sensor.
    """
    models = _blocks(scenario, point)
    targets = tuple(f"target_state[{k}]" for k in range(4))
    poses = tuple(f"pose_WB[{k}]" for k in range(3))
    joined = join_blocks(
        models, _states(models), name="frozen gains", inputs=targets, outputs=poses
    )
    to_P = _place_of_P(scenario)
    return replace(
        joined,
        C=to_P @ joined.C,
        D=to_P @ joined.D,
        input_names=("p_d_x", "p_d_y", "v_d_x", "v_d_y"),
        output_names=("p_WP_x", "p_WP_y"),
    )


def acceleration_loop(scenario: Scenario, point: RoutePoint, axis: str) -> LinearModel:
    """Computes the open loop L that results from a cut at the law's acceleration.

    The cut opens the loop along ``axis``, which is one of ``AXES``. The loop along the
    other axis stays closed. L is for negative feedback: the closed loop has its poles
    where 1 + L = 0.
    """
    k = AXES.index(axis)
    models = tuple(
        _renamed(model) if model.name == "controller" else model
        for model in _blocks(scenario, point)
    )
    whole = join_blocks(
        models,
        _states(models),
        name=f"acceleration {axis}",
        inputs=tuple(f"{_COMMAND}[{i}]" for i in range(2)),
        outputs=tuple(f"{_LAW}[{i}]" for i in range(2)),
    )
    other = 1 - k
    closed = whole.A + np.outer(whole.B[:, other], whole.C[other])
    cut = replace(
        whole,
        A=closed,
        B=whole.B[:, [k]],
        C=-whole.C[[k]],
        D=np.zeros((1, 1)),
        input_names=(axis,),
        output_names=(axis,),
    )
    return minimal_model(cut)


def _renamed(model: LinearModel) -> LinearModel:
    names = tuple(name.replace(_COMMAND, _LAW) for name in model.output_names)
    return replace(model, output_names=names)


def _states(models: tuple[LinearModel, ...]) -> tuple[str, ...]:
    return tuple(name for model in models for name in model.state_names)


def _place_of_P(scenario: Scenario) -> NDArray[np.float64]:
    """Returns the (2, 3) Jacobian of P's position with respect to the pose.

    The heading is 0.
    """
    epsilon = scenario.only.robot.control_point_m
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, epsilon]])


def _blocks(scenario: Scenario, point: RoutePoint) -> tuple[LinearModel, ...]:
    own = route_law(scenario)
    require_rolling(scenario.only.plant)
    robot, tick_s, speed = scenario.only.robot, scenario.tick_s, point.speed_m_s
    wheel, p = speed / robot.wheel_radius_m, np.array([robot.control_point_m, 0.0])
    wheels, pose, v = np.full(2, wheel), np.zeros(3), np.array([speed, 0.0])
    objects = np.zeros(OBJECT_SLOTS * OBJECT_SIZE)
    ahead = 0.0
    if point.wall_m is not None:
        objects[[THERE, X, KNOWN]] = 1.0, point.wall_m, 1.0
        push = own.contact_stiffness_n_m * (own.security_zone_m - point.wall_m)
        ahead = push / own.stiffness_n_m
    target = np.array([p[0] + ahead, 0.0, speed, 0.0])
    plant = DiffDrivePlant(robot=robot, plant=scenario.only.plant)
    config = simulator_config(scenario)
    exact = scenario.only.plant.model_copy(update={"pulses_per_revolution": None})
    odometry = WheelOdometry_[AutoDiffXd](robot=robot, plant=exact, tick_s=tick_s)
    command = WheelCommand_[AutoDiffXd](robot=robot, tick_s=tick_s)
    # Eq. 6, which stops P, has no linear model. It is therefore switched off.
    unblocked = own.model_copy(update={"block_distance_m": None})
    law = TrajectoryImpedanceController_[AutoDiffXd](
        parameters=unblocked, robot=robot, tick_s=tick_s
    )
    driven = block_model(
        DiscreteTimeApproximation(plant, tick_s, config).ToAutoDiffXd(),
        np.array([*pose, 0.0, 0.0, *wheels]),
        [wheels],
        period_s=tick_s,
        ports=plant,
        read_after=True,
    )
    before = [-speed * tick_s, 0.0, 0.0, *(-tick_s * wheels)]
    moved = block_model(
        odometry, np.array(before), [np.zeros(2), wheels], period_s=tick_s
    )
    inputs = [target, objects, pose, v]
    pulled = block_model(law, np.empty(0), inputs, period_s=tick_s)
    commanded = block_model(
        command,
        np.array([*v, *wheels]),
        [np.zeros(2), pose],
        period_s=tick_s,
        held={"wheel_speeds"},
    )
    return (
        _named(plant, driven),
        _named(odometry, moved),
        _named(law, pulled),
        _named(command, commanded),
        _seen_wall(scenario, point),
    )


def _named(block: Block, model: LinearModel) -> LinearModel:
    part = part_of(block)
    states = tuple(f"{part}.{name}" for name in block.states)
    return replace(model, name=part, state_names=states if len(model.A) else ())


def _seen_wall(scenario: Scenario, point: RoutePoint) -> LinearModel:
    """Returns the model of the object sensor, from ``pose_WB`` to ``objects_W``.

    The only object is a wall straight ahead. The sensor observes the wall with the
    latency of the scenario.
    """
    ticks = round(scenario.router.objects.latency_s / scenario.tick_s)
    away = -_place_of_P(scenario)[:1]
    if point.wall_m is None:
        away = 0.0 * away
    A, B, C = np.zeros((ticks, ticks)), np.zeros((ticks, 3)), np.zeros((64, ticks))
    D = np.zeros((OBJECT_SLOTS * OBJECT_SIZE, 3))
    if ticks:
        A[1:, :-1], B[0], C[X, -1] = np.eye(ticks - 1), away[0], 1.0
    else:
        D[X] = away[0]
    return LinearModel(
        name="objects",
        A=A,
        B=B,
        C=C,
        D=D,
        state_names=tuple(f"objects.x_{k + 1}" for k in range(ticks)),
        input_names=tuple(f"pose_WB[{k}]" for k in range(3)),
        output_names=tuple(f"objects_W[{k}]" for k in range(len(C))),
        period_s=scenario.tick_s,
    )
