"""Stiffness and damping that adapt so that P moves as the reference does."""

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

#: Places in the state: what adapts, and sensitivities to each, four numbers.
_GAINS, _SENSITIVITIES = 0, 3
#: Names of what adapts.
_ADAPTED = "stiffness", "damping", "contact_stiffness"


class AdaptationNumbers(NamedTuple):
    """What the step of ``ImpedanceAdaptation`` depends on."""

    lyapunov: bool
    rates: tuple[float, float, float]
    """Of K, D and K_e."""
    velocity_weight: float
    """tau_v^2, s^2."""
    penalty: tuple[float, float]
    """lambda, and d_sec, m."""
    normalised: bool
    least_square: float
    """m_0."""
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    nominal: tuple[float, float, float]
    leakage: float
    freezes: bool
    contacts: ContactNumbers
    contact_damping: float
    """D_e, N s/m."""
    mass: float
    control_point_m: float
    tick_s: float


@register_jitable
def adaptation_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: AdaptationNumbers
) -> None:
    """Adapts K, D and K_e by one tick.

    The state is K, D and K_e; then for each of them dp/dq and dv/dq, x and y each.
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
            # A power of Python's raises where it overflows; this the next block names.
            square = state[at] * state[at] + state[at + 1] * state[at + 1]
            square += numbers.velocity_weight * (
                state[at + 2] * state[at + 2] + state[at + 3] * state[at + 3]
            )
            advance_sensitivity(state, at, source, found, loop)
        if frozen or numbers.rates[k] == 0.0:
            gradient = 0.0
        if numbers.normalised:
            gradient = gradient / (numbers.least_square + square)
        value = state[_GAINS + k] - numbers.tick_s * (
            numbers.rates[k] * gradient
            + numbers.leakage * (state[_GAINS + k] - numbers.nominal[k])
        )
        state[_GAINS + k] = min(max(value, numbers.low[k]), numbers.high[k])


class ImpedanceAdaptation(Block):
    """Adapts stiffness and damping of a robot on a route.

    ``lyapunov``: K' = (gamma/M) e_v . (p - p_d), D' = (gamma/M) e_v . (v - v_d), with
    e_v = v - v_ref: what eq. 40 to 42 are as printed, for which a Lyapunov function
    falls where there is no contact. ``sensitivity``: q' = -gamma dJ/dq, with J of eq.
    27 (velocities weighed by tau_v, its penalty a hinge) and the sensitivities of eq.
    34, whose left side is a derivative.

    Discrete state, every tick: K, D, K_e, and their sensitivities, four numbers each.
    ``impedance`` is state; a gradient at a tick changes it from the next tick on.
    ``adaptation_active`` depends on the present input.

    Args:
        parameters: ``AdaptationParameters``.
        impedance: ``TrajectoryImpedanceParameters``: nominal values, and contacts.
        robot: Mass and place of P.
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
    """What the step depends on.

    Args:
        own: Rule, rates and cures.
        law: Nominal values, and contacts.
        robot: Mass and place of P.
        tick_s: Period, s.

    Returns:
        The numbers.
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
