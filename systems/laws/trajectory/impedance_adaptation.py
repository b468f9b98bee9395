"""Stiffness and damping that adapt so that P moves as the reference does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from numba.extending import register_jitable
from pydantic import Field, model_validator
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Length,
    NonNegative,
    Parameters,
    Positive,
    Time,
)
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step, StepBlock
from systems.laws.trajectory.impedance_sensitivity import (
    Impedance,
    SensitivityNumbers,
    advance_sensitivity,
    penalty_gradient,
    sensitivity_sources,
)
from systems.laws.trajectory.trajectory_impedance import (
    ContactNumbers,
    TrajectoryImpedanceParameters,
    contact_numbers,
    contacts_of_objects,
)
from systems.ranging.objects import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import control_point

__all__ = ["AdaptationParameters", "ImpedanceAdaptation", "adaptation_step"]

#: Places in the state: what adapts, and sensitivities to each, four numbers.
_GAINS, _SENSITIVITIES = 0, 3


class AdaptationParameters(Parameters):
    """How K, D and K_e adapt (eq. 42); rates and cures are not printed."""

    rule: Literal["none", "lyapunov", "sensitivity"] = "none"
    """Nothing adapts; eq. 40 to 42 as they are printed, which is a Lyapunov rule; or
    the gradient of eq. 27 by the sensitivities that eq. 34 means."""
    rate: NonNegative = 10.0
    """gamma = eta/T of K and D, (N/m)^2/(m^2 s)."""
    contact_rate: NonNegative = 0.0
    """The same of K_e."""
    velocity_weight_s: Time = 0.5
    """tau_v, s: an error of 1 m/s counts as one of tau_v metres."""
    penalty: NonNegative = 0.0
    """lambda of the hinge on distances below ``penalty_distance_m``."""
    penalty_distance_m: Length = 0.5
    """d_sec, m."""
    normalisation: Positive | None = None
    """m_0: rates are divided by m_0 and the squared sensitivity; none: they are not."""
    projected: bool = False
    """Whether K and D stay in their boxes."""
    stiffness_box_n_m: tuple[Positive, Positive] = Field(
        default=(0.5, 6.0), strict=False
    )
    """Least and greatest K, N/m."""
    damping_box_n_s_m: tuple[Positive, Positive] = Field(
        default=(3.0, 8.0), strict=False
    )
    """Least and greatest D, N s/m."""
    contact_box_n_m: tuple[Positive, Positive] = Field(
        default=(0.5, 24.0), strict=False
    )
    """Least and greatest K_e, N/m."""
    leakage: NonNegative = 0.0
    """sigma, 1/s: at which all returns to its nominal value."""
    freezes: bool = False
    """Whether nothing adapts while there is a contact."""

    @model_validator(mode="after")
    def _check(self) -> AdaptationParameters:
        for name in ("stiffness_box_n_m", "damping_box_n_s_m", "contact_box_n_m"):
            low, high = getattr(self, name)
            if low >= high:
                raise InputError(
                    name, f"begins at {low:g} and ends at {high:g}; give the less first"
                )
        return self


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
    """Impedance of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: K, D and K_e; then for each dp/dq, x and y, and dv/dq, x and y.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``AdaptationNumbers``.
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


class ImpedanceAdaptation(LeafSystem, StepBlock):
    """Adapts stiffness and damping of a robot on a route.

    .. pydrake_system::

        name: ImpedanceAdaptation
        input_ports:
        - target_state [m, m, m/s, m/s]
        - reference_state [m, m, m/s, m/s]
        - pose_WB_estimated [m, m, rad]
        - v_WP [m/s, of the virtual mass]
        - objects_W [number, m and m/s in eight slots, see systems.ranging.objects]
        output_ports:
        - impedance [number, K in N/m, D in N s/m and K_e in N/m]
        - adaptation_active [0 or 1]

    ``lyapunov``: K' = (gamma/M) e_v . (p - p_d), D' = (gamma/M) e_v . (v - v_d), with
    e_v = v - v_ref: what eq. 40 to 42 are as printed, for which a Lyapunov function
    falls where there is no contact. ``sensitivity``: q' = -gamma dJ/dq, with J of eq.
    27 (velocities weighed by tau_v, its penalty a hinge) and the sensitivities of eq.
    34, whose left side is a derivative.

    Discrete state, every tick: K, D, K_e, and their sensitivities, four numbers each.
    The outputs are state and present input; what is learnt at a tick counts from the
    next one on.

    Args:
        parameters: ``AdaptationParameters``.
        impedance: ``TrajectoryImpedanceParameters``: nominal values, and contacts.
        robot: Mass and place of P.
        tick_s: Period, s.

    Reference: Engelbrecht, Steyn and Djouani (2021), eq. 27 to 42; docs/trajectory.md
    has the errata.
    """

    FACTS = BlockFacts(
        "adaptation",
        "control",
        columns={
            "impedance": ("stiffness", "damping", "contact_stiffness"),
            "adaptation_active": ("adaptation_active",),
        },
        states=(
            "stiffness",
            "damping",
            "contact_stiffness",
            *(
                f"{part}_by_{gain}"
                for gain in ("stiffness", "damping", "contact_stiffness")
                for part in ("x", "y", "vx", "vy")
            ),
        ),
    )

    def __init__(
        self,
        *,
        parameters: AdaptationParameters | None = None,
        impedance: TrajectoryImpedanceParameters | None = None,
        robot: RobotParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        own = parameters or AdaptationParameters()
        law = impedance or TrajectoryImpedanceParameters()
        self.set_name("impedance_adaptation")
        numbers = adaptation_numbers(own, law, robot or RobotParameters(), tick_s)
        state: Sequence[float] = [*numbers.nominal, *[0.0] * 12]
        self.declare_step(
            float,
            Step(adaptation_step, numbers, state),
            (
                ("target_state", 4),
                ("reference_state", 4),
                ("pose_WB_estimated", 3),
                ("v_WP", 2),
                ("objects_W", OBJECT_SLOTS * OBJECT_SIZE),
            ),
            (("impedance", 3), ("adaptation_active", 1)),
            tick_s,
        )


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
