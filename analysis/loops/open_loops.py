"""Open-loop models of the control loop, cut at a sensor or an actuator.

Loop transfer functions L follow the convention of negative feedback: the poles of the
closed loop are the roots of 1 + L = 0.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from analysis.loops.diagram_state import Port
from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import changed, ideal_scenario
from analysis.loops.linear_models import LinearModel, minimal_model
from analysis.loops.operating_points import OperatingPoint
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

BreakPoint = Literal["sensor", "actuator", "wheels"]
Direction = Literal["along", "across"]

#: Signals at which the loop can be cut:
#: - sensor: source position that hearing reports
#: - actuator: acceleration from the control law
#: - wheels: commanded wheel speeds
BREAK_POINTS: tuple[BreakPoint, ...] = ("sensor", "actuator", "wheels")
#: Directions relative to the line from the control point P to the source.
DIRECTIONS: tuple[Direction, ...] = ("along", "across")

#: For each cut: the input port to feed from outside, and the output port that feeds
#: this input in the closed loop.
_WIRES: dict[BreakPoint, tuple[Port, Port]] = {
    "sensor": (("tracker", "p_PS_B"), ("hearing", "p_PS_B")),
    "actuator": (("command", "acceleration_W"), ("controller", "acceleration_W")),
    "wheels": (("plant", "wheel_speeds"), ("command", "wheel_speeds")),
}


def cut_model(point: OperatingPoint, *places: BreakPoint) -> LinearModel:
    """Returns the sampled linear model of the control loop with some signals cut.

    A signal is cut between the block that produces the signal and the block that reads
    the signal. Each of ``places`` adds two inputs and two outputs to the model: one of
    each for each of ``DIRECTIONS``. The input ``<place>_<direction>`` feeds the reading
    block. The output of the same name is the signal from the producing block. At the
    operating point, the robot faces the source, so "along" means ahead. For the wheels,
    "along" is the sum of both wheel speeds over sqrt(2), and "across" is the right
    minus the left wheel speed over sqrt(2). Without ``places``, the model is that of
    the closed loop.
    """
    loop = point.loop
    now = loop.context(point.state, point.time_s)
    values: dict[tuple[Port, ...], Any] = {}
    for place in places:
        (role, name), _ = _WIRES[place]
        block = loop.block(role)
        own = block.GetMyContextFromRoot(now)
        values[((role, name),)] = block.GetInputPort(name).Eval(own).copy()
    after = loop.period_map(point.state, point.time_s)
    wheels = [loop.state_names.index(f"command.wheel_{s}") for s in ("left", "right")]
    if "wheels" in places:
        values[(_WIRES["wheels"][0],)] = after[wheels]
    found = loop.period_derivatives(
        point.state,
        point.time_s,
        inputs=values,
        outputs=[_WIRES[place][1] for place in places if place != "wheels"],
    )
    C, D = found.C, found.D
    if "wheels" in places:
        # The control update at the start of the period computes the wheel command. The
        # plant already receives this command in the same period.
        at = 2 * places.index("wheels")
        C = np.insert(C, [at, at], found.A[wheels], axis=0)
        D = np.insert(D, [at, at], found.B[wheels], axis=0)
    turn = block_diag(*(_axes(point, place) for place in places))
    names = tuple(f"{place}_{way}" for place in places for way in DIRECTIONS)
    return LinearModel(
        name=f"loop cut at {' and '.join(places) or 'nothing'}",
        A=found.A,
        B=found.B @ turn.T,
        C=turn @ C,
        D=turn @ D @ turn.T,
        state_names=loop.state_names,
        input_names=names,
        output_names=names,
        period_s=loop.tick_s,
    )


def _axes(point: OperatingPoint, place: BreakPoint) -> NDArray[np.float64]:
    """(2, 2) matrix from the two elements of a signal to "along" and "across"."""
    if place == "wheels":
        return np.array([[1.0, 1.0], [-1.0, 1.0]]) / math.sqrt(2.0)
    if place == "sensor":
        return np.eye(2)
    return point.axes


def closed(model: LinearModel, signals: tuple[str, ...]) -> LinearModel:
    """Closes the loop again at some of the signals that ``cut_model`` has cut.

    For each name in ``signals``, the output of this name is connected to the input of
    the same name. The input remains an input of the model. Its value is added to the
    value from the output.
    """
    import control

    wires = np.zeros((len(model.input_names), len(model.output_names)))
    for name in signals:
        wires[model.input_names.index(name), model.output_names.index(name)] = 1.0
    whole = control.feedback(model.to_control(), wires, sign=1)
    return replace(model, A=whole.A, B=whole.B, C=whole.C, D=whole.D)


def open_loop(
    point: OperatingPoint,
    at: BreakPoint = "sensor",
    direction: Direction = "along",
) -> LinearModel:
    """Returns the loop transfer function L of one direction, cut at one signal.

    The loop of the other direction stays closed. The sign of L is that for negative
    feedback.
    """
    whole = cut_model(point, at)
    own = f"{at}_{direction}"
    (other,) = [name for name in whole.input_names if name != own]
    part = closed(whole, (other,)).part([own], [own])
    part = minimal_model(replace(part, C=-part.C, D=-part.D))
    return replace(part, name=f"L at the {at}, {direction}")


def target_loop(scenario: Scenario, at: BreakPoint = "sensor") -> LinearModel:
    """Returns the loop transfer function L of a point mass that the source attracts.

    This ideal loop has no obstacle, no motor lag and no sampling. The attraction acts
    on the mass as a spring and a damper along the line to a source at rest. Stiffness
    and damping are derivatives of the controller's force by position and by velocity.
    A cut at the ``sensor`` opens the loop of the spring, and the loop of the damper
    stays closed. A cut at the ``actuator`` or at the ``wheels`` opens both loops. The
    states are position, m, and velocity, m/s. Raises InputError if the stiffness is
    zero.
    """
    if scenario.follower.attraction.stiffness_n_m == 0.0:
        raise InputError(
            "attraction.stiffness_n_m",
            "is 0, and without a spring there is no loop to the target; set it above 0",
        )
    stiffness, damping = _attraction_slopes(scenario)
    mass = scenario.only.robot.mass_kg
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    C = np.array([[stiffness, 0.0]]) / mass
    if at == "sensor":
        A[1, 1] = -damping / mass
    else:
        C[0, 1] = damping / mass
    return LinearModel(
        name=f"ideal target loop, L at the {at}",
        A=A,
        B=np.array([[0.0], [1.0]]),
        C=C,
        D=np.zeros((1, 1)),
        state_names=("p_WP", "v_WP"),
        input_names=("acceleration",),
        output_names=("acceleration",),
    )


def _attraction_slopes(scenario: Scenario) -> tuple[float, float]:
    """Stiffness, N/m, and damping, N s/m, along the line to a source at rest.

    The scenario's obstacles are left out.
    """
    distance = scenario.follower.attraction.follow_distance_m + 2.0
    alone = {
        "law": "none",
        "obstacles": [],
        "source": {"waypoints_m": [[0.0, 0.0]]},
        "start": {"position_m": [-distance, 0.0], "heading_deg": 0.0},
    }
    field = ForceField(ideal_loop(changed(ideal_scenario(scenario), alone)))
    place = [-distance, 0.0]
    return -float(field.gradient(place)[1][0, 0]), field.damping(place)
