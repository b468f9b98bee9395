"""Adaptation of the gains of a route law, so that the motion follows a reference."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.laws.trajectory.impedance_sensitivity import (
    advance_sensitivity,
    penalty_gradient,
    sensitivity_sources,
)
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_impedance import (
    ContactNumbers,
    contact_numbers,
    contacts_of_objects,
)
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import control_point

# ``_GAINS``: index in the state of the first of the three gains.
# ``_SENSITIVITIES``: index in the state of the first sensitivity. There are four
#   sensitivities for each gain.
_GAINS, _SENSITIVITIES = 0, 3
#: Names of the gains that adapt.
_ADAPTED = "stiffness", "damping", "contact_stiffness"
#: Weight tau_v^2 of velocity errors, s^2 (our choice, like all constants here). A
#: velocity error of 1 m/s counts as much as a position error of 0.5 m.
_VELOCITY_WEIGHT_S2 = 0.5**2
# ``STIFFNESS_BOX_N_M``: least and greatest K of gains with limits, N/m.
# ``DAMPING_BOX_N_S_M``: least and greatest D of gains with limits, N s/m.
STIFFNESS_BOX_N_M, DAMPING_BOX_N_S_M = (0.5, 6.0), (3.0, 8.0)
#: Least and greatest K_e of gains with limits, N/m.
_CONTACT_BOX_N_M = (0.5, 24.0)
#: Limits of gains without limits.
_WIDE = (-1e9, 1e9)


class AdaptationNumbers(NamedTuple):
    """Constants of the step of ``ImpedanceAdaptation``."""

    lyapunov: bool
    """Whether the rule is ``lyapunov``; otherwise it is ``sensitivity``."""
    rates: tuple[float, float, float]
    """Rates gamma of K, D, and K_e."""
    penalty: float
    """Weight lambda of the safety term, without unit."""
    low: tuple[float, float, float]
    """Least K, D, and K_e."""
    high: tuple[float, float, float]
    """Greatest K, D, and K_e."""
    nominal: tuple[float, float, float]
    """Initial K, D, and K_e."""
    contacts: ContactNumbers
    contact_damping: float
    """Contact damping D_e, N s/m."""
    mass: float
    control_point_m: float
    tick_s: float


@register_jitable
def adaptation_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: AdaptationNumbers
) -> None:
    """Adapts the gains K, D, and K_e by one control period.

    K is the stiffness to the target, D is the damping, and K_e is the stiffness of
    contacts. For each gain, the step computes a rate of change by the selected rule,
    ``lyapunov`` or ``sensitivity``. It then changes the gain at this rate for one
    period, and limits the gain. The output contains the gains from before this change.

    The state starts with K, D, and K_e. Four sensitivities follow for each gain q: x
    and y of dp/dq, then x and y of dv/dq. p and v are the position and velocity of the
    control point P.
    """
    target, reference, pose, v_WP, objects = inputs
    for k in range(3):
        outputs[0][k] = state[_GAINS + k]
    p_WP = control_point(pose, numbers.control_point_m)
    found = contacts_of_objects(objects, v_WP, numbers.contacts)
    sources = sensitivity_sources(p_WP, v_WP, target, found, numbers.mass)
    gains = state[0], state[1], state[2]
    # Errors against the reference, and gradient of the safety term. The distance d_sec
    # of the safety term is S.
    ex, ey = p_WP[0] - reference[0], p_WP[1] - reference[1]
    evx, evy = v_WP[0] - reference[2], v_WP[1] - reference[3]
    gx, gy = penalty_gradient(found, numbers.contacts.begins_m, numbers.penalty)
    for k in range(3):
        source = sources[k]
        at = _SENSITIVITIES + 4 * k
        if numbers.lyapunov:
            gradient = evx * source[0] + evy * source[1]
        else:
            gradient = (ex + gx) * state[at] + (ey + gy) * state[at + 1]
            gradient += _VELOCITY_WEIGHT_S2 * (
                evx * state[at + 2] + evy * state[at + 3]
            )
            advance_sensitivity(state, at, source, found, gains, numbers)
        if numbers.rates[k] == 0.0:
            gradient = 0.0
        value = state[_GAINS + k] - numbers.tick_s * (numbers.rates[k] * gradient)
        state[_GAINS + k] = min(max(value, numbers.low[k]), numbers.high[k])


class ImpedanceAdaptation(Block):
    """Adapts the stiffness and damping of a robot on a route.

    K is the stiffness to the target, D is the damping, and K_e is the stiffness of
    contacts. p and v are the position and velocity of the control point P. The
    subscript d marks the target, and the subscript ref marks a reference model. gamma
    is the rate of the adaptation, and M is the virtual mass.

    The block has two rules, in which K', D' and q' are time derivatives:

    - ``lyapunov``: K' = (gamma/M) e_v . (p - p_d) and D' = (gamma/M) e_v . (v - v_d),
      with e_v = v - v_ref. This rule is equivalent to eq. 40 to 42 as printed. Without
      contacts, it makes a Lyapunov function decrease.
    - ``sensitivity``: q' = -gamma dJ/dq for each gain q. J is the cost of eq. 27 with
      two changes: a time tau_v multiplies the velocities, and the penalty of
      ``penalty_gradient`` replaces the safety term. The sensitivities solve eq. 34,
      whose left side we read as a time derivative.

    The discrete state contains K, D, K_e, and four sensitivities to each gain. The
    output ``impedance`` is part of the state. Therefore a change of the gains appears
    at the output one control period later.

    Args:
        parameters: ``AdaptiveTrajectoryParameters``.
        robot: Virtual mass, and position of P.
        tick_s: Control period, s.

    Reference: Engelbrecht, Steyn and Djouani (2021), eq. 27 to 42; docs/routes.md has
    the errata.
    """

    part = "adaptation"
    inputs = (
        Port("target_state", 4, "m, m, m/s, m/s"),
        Port("reference_state", 4, "m, m, m/s, m/s"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("v_WP", 2, "m/s, of the virtual mass"),
        Port(
            "objects_W",
            OBJECT_SLOTS * OBJECT_SIZE,
            "number, m and m/s in eight slots, see systems.ranging.objects",
        ),
    )
    outputs = (
        Port("impedance", 3, "number, K in N/m, D in N s/m and K_e in N/m", _ADAPTED),
    )
    states = (
        *_ADAPTED,
        *(f"{axis}_by_{gain}" for gain in _ADAPTED for axis in ("x", "y", "vx", "vy")),
    )

    def __init__(
        self,
        *,
        parameters: AdaptiveTrajectoryParameters = AdaptiveTrajectoryParameters(),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("impedance_adaptation")
        numbers = adaptation_numbers(parameters, robot, tick_s)
        state = [*numbers.nominal, *[0.0] * 12]
        self.declare(Step(adaptation_step, numbers, state), tick_s=tick_s)


def adaptation_numbers(
    own: AdaptiveTrajectoryParameters, robot: RobotParameters, tick_s: float
) -> AdaptationNumbers:
    """Computes the constants that ``adaptation_step`` uses.

    ``own`` has the rule, the rates, the initial gains, and the contacts. ``robot`` has
    the virtual mass and the position of the control point P. ``tick_s`` is the control
    period, s.
    """
    boxes = STIFFNESS_BOX_N_M, DAMPING_BOX_N_S_M, _CONTACT_BOX_N_M
    low, high = zip(*(box if own.projected else _WIDE for box in boxes), strict=True)
    return AdaptationNumbers(
        own.rule == "lyapunov",
        (own.rate, own.rate, own.contact_rate),
        own.penalty,
        low,
        high,
        (own.stiffness_n_m, own.damping_n_s_m, own.contact_stiffness_n_m),
        contact_numbers(own),
        own.contact_damping_n_s_m,
        robot.mass_kg,
        robot.control_point_m,
        tick_s,
    )
