"""Adaptation of stiffness and damping so that P moves like a reference model."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.laws.trajectory.impedance_sensitivity import (
    Impedance,
    SensitivityNumbers,
    advance_sensitivity,
    penalty_gradient,
    sensitivity_sources,
)
from systems.laws.trajectory.parameters import (
    AdaptationParameters,
    TrajectoryImpedanceParameters,
)
from systems.laws.trajectory.trajectory_impedance import (
    ContactNumbers,
    contact_numbers,
    contacts_of_objects,
)
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import control_point

#: First indices in the state: the three gains, and four sensitivities for each gain.
_GAINS, _SENSITIVITIES = 0, 3
#: Names of the gains that adapt.
_ADAPTED = "stiffness", "damping", "contact_stiffness"


class AdaptationNumbers(NamedTuple):
    """Constants of the step of ``ImpedanceAdaptation``."""

    lyapunov: bool
    """Whether the rule is ``lyapunov``; otherwise it is ``sensitivity``."""
    rates: tuple[float, float, float]
    """Rates gamma of K, D, and K_e."""
    velocity_weight: float
    """Weight tau_v^2 of velocity errors, s^2."""
    penalty: tuple[float, float]
    """Weight lambda, without unit, and distance d_sec, m, of the safety term."""
    normalised: bool
    least_square: float
    """Constant m_0 of the normalization."""
    low: tuple[float, float, float]
    """Least K, D, and K_e."""
    high: tuple[float, float, float]
    """Greatest K, D, and K_e."""
    nominal: tuple[float, float, float]
    """Nominal K, D, and K_e."""
    leakage: float
    """Rate sigma of the return to the nominal gains, 1/s."""
    freezes: bool
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
    """Adapts K, D, and K_e by one tick.

    The state begins with K, D, and K_e. For each of these gains q, the sensitivities
    dp/dq and dv/dq (x and y each) follow.

    For each gain the step computes the gradient of the error, either by the Lyapunov
    rule or from the sensitivities. If normalization is on, it divides the gradient by
    the normalization. Then it moves the gain against the gradient and toward its
    nominal value. Finally it limits the gain. The output has the gains from before this
    change.
    """
    target, reference, pose, v_WP, objects = inputs
    for k in range(3):
        outputs[0][k] = state[_GAINS + k]
    p_WP = control_point(pose, numbers.control_point_m)
    found = contacts_of_objects(objects, v_WP, numbers.contacts)
    sources = sensitivity_sources(p_WP, v_WP, target, found, numbers.mass)
    loop = SensitivityNumbers(
        Impedance(state[0], state[1], state[2]),
        numbers.contact_damping,
        numbers.contacts,
        numbers.mass,
        numbers.tick_s,
    )
    # Errors against the reference, and gradient of the safety term.
    ex, ey = p_WP[0] - reference[0], p_WP[1] - reference[1]
    evx, evy = v_WP[0] - reference[2], v_WP[1] - reference[3]
    penalty, security_m = numbers.penalty
    gx, gy = penalty_gradient(found, security_m, penalty)
    frozen = numbers.freezes and len(found) > 0
    outputs[1][0] = 0.0 if frozen else 1.0
    for k in range(3):
        source = sources[k]
        at = _SENSITIVITIES + 4 * k
        if numbers.lyapunov:
            gradient = evx * source[0] + evy * source[1]
            square = source[0] * source[0] + source[1] * source[1]
        else:
            gradient = (ex + gx) * state[at] + (ey + gy) * state[at + 1]
            gradient += numbers.velocity_weight * (
                evx * state[at + 2] + evy * state[at + 3]
            )
            # Products instead of powers: a power in Python raises on overflow. Here the
            # overflow reaches the next block, whose error message names it.
            square = state[at] * state[at] + state[at + 1] * state[at + 1]
            square += numbers.velocity_weight * (
                state[at + 2] * state[at + 2] + state[at + 3] * state[at + 3]
            )
            advance_sensitivity(state, at, source, found, loop)
        if frozen or numbers.rates[k] == 0.0:
            gradient = 0.0
        if numbers.normalised:
            gradient = gradient / (numbers.least_square + square)
        # One step of the gain with leakage, then the limits.
        value = state[_GAINS + k] - numbers.tick_s * (
            numbers.rates[k] * gradient
            + numbers.leakage * (state[_GAINS + k] - numbers.nominal[k])
        )
        state[_GAINS + k] = min(max(value, numbers.low[k]), numbers.high[k])


class ImpedanceAdaptation(Block):
    """Adapts the stiffness and damping of a robot on a route.

    There are two rules. The rule ``lyapunov`` is K' = (gamma/M) e_v . (p - p_d) and
    D' = (gamma/M) e_v . (v - v_d) with e_v = v - v_ref. The printed eq. 40 to 42 amount
    to this rule. Without contacts, this rule makes a Lyapunov function fall.

    The rule ``sensitivity`` is q' = -gamma dJ/dq for each gain q. J is the cost of eq.
    27 with two changes: the weight tau_v multiplies velocities, and a hinge function
    replaces the penalty. The sensitivities are the solution of eq. 34, if its left side
    is a time derivative.

    The discrete state has K, D, K_e, and four sensitivities of each gain. It is updated
    every tick. The output ``impedance`` is part of the state, so it shows a change of
    the gains from the next tick on. The output ``adaptation_active`` depends on the
    present input.

    Args:
        parameters: ``AdaptationParameters``.
        impedance: ``TrajectoryImpedanceParameters``: nominal gains, and contacts.
        robot: Mass, and position of P.
        tick_s: Period, s.

    Reference: Engelbrecht, Steyn and Djouani (2021), eq. 27 to 42; docs/routes.md
    has the errata.
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
        Port("adaptation_active", 1, "0 or 1", ("adaptation_active",)),
    )
    states = (
        *_ADAPTED,
        *(f"{axis}_by_{gain}" for gain in _ADAPTED for axis in ("x", "y", "vx", "vy")),
    )

    def __init__(
        self,
        *,
        parameters: AdaptationParameters = AdaptationParameters(),
        impedance: TrajectoryImpedanceParameters = TrajectoryImpedanceParameters(),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("impedance_adaptation")
        numbers = adaptation_numbers(parameters, impedance, robot, tick_s)
        state = [*numbers.nominal, *[0.0] * 12]
        self.declare(Step(adaptation_step, numbers, state), tick_s=tick_s)


def adaptation_numbers(
    own: AdaptationParameters,
    law: TrajectoryImpedanceParameters,
    robot: RobotParameters,
    tick_s: float,
) -> AdaptationNumbers:
    """Computes the constants of the step.

    Args:
        own: Rule, rates, and limits of the adaptation.
        law: Nominal gains, and contacts.
        robot: Mass, and position of P.
        tick_s: Period, s.

    Returns:
        The constants.
    """
    boxes = own.stiffness_box_n_m, own.damping_box_n_s_m, own.contact_box_n_m
    wide = (-1e9, 1e9)
    low, high = zip(*(box if own.projected else wide for box in boxes), strict=True)
    rate = 0.0 if own.rule == "none" else own.rate
    contact_rate = 0.0 if own.rule == "none" else own.contact_rate
    return AdaptationNumbers(
        own.rule == "lyapunov",
        (rate, rate, contact_rate),
        own.velocity_weight_s**2,
        (own.penalty, own.penalty_distance_m),
        own.normalisation is not None,
        own.normalisation or 0.0,
        low,
        high,
        (law.stiffness_n_m, law.damping_n_s_m, law.contact_stiffness_n_m),
        own.leakage,
        own.freezes,
        contact_numbers(law),
        law.contact_damping_n_s_m,
        robot.mass_kg,
        robot.control_point_m,
        tick_s,
    )
