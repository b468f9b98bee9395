"""Whether the gains of a robot on a route are within what sampling permits."""

from __future__ import annotations

import math

from diagrams.participants import FollowerParameters
from systems.laws.catalogue import LAWS
from systems.laws.trajectory.parameters import (
    AdaptationParameters,
    TrajectoryImpedanceParameters,
)
from systems.laws.trajectory.sampled_bounds import (
    SampledMass,
    damping_bound,
    pull_through_m,
    rate_bound,
    stiffness_bound,
)
from systems.ranging.parameters import OBJECT_SLOTS

__all__ = ["route_notes"]


def route_notes(prefix: str, robot: FollowerParameters, tick_s: float) -> list[str]:
    """What a user should know of gains with which a robot does not come to rest.

    Args:
        prefix: What the robot's fields begin with in a message.
        robot: The robot; without a route nothing is asked.
        tick_s: Period of control, s.

    Returns:
        A line for each bound that is passed, which it names.
    """
    law = LAWS.get(robot.law)
    if robot.route is None or law is None or not law.on_route:
        return []
    own = getattr(robot.repulsion, robot.law)
    of = SampledMass(robot.robot.mass_kg, robot.plant.motor_lag_s, tick_s)
    field = f"{prefix}repulsion.{robot.law}"
    notes = _damping_notes(field, own, of) or _stiffness_notes(field, own, of)
    adaptation = getattr(own, "adaptation", None)
    if adaptation is not None and adaptation.rule != "none":
        amplitude = pull_through_m(own)
        notes += _adaptation_notes(f"{field}.adaptation", adaptation, amplitude, of)
    return notes


def _damping_notes(
    field: str, own: TrajectoryImpedanceParameters, of: SampledMass
) -> list[str]:
    bound, damping = damping_bound(of), own.damping_n_s_m
    if damping >= bound:
        note = (
            f"{field}.damping_n_s_m is {damping:g}, but from 2 M/T, {bound:g}, on the "
            "robot does not come to rest; lower it"
        )
        return [note]
    each = own.contact_damping_n_s_m
    if each == 0.0 or own.reading == "printed_force":
        return []
    contacts = math.ceil((bound - damping) / each) - 1
    if contacts >= OBJECT_SLOTS:
        return []
    note = (
        f"{field}.contact_damping_n_s_m is {each:g}: with more than {contacts} "
        f"contacts at once all dampers reach 2 M/T, {bound:g} N s/m, from which on the "
        "robot does not come to rest; lower it"
    )
    return [note]


def _stiffness_notes(
    field: str, own: TrajectoryImpedanceParameters, of: SampledMass
) -> list[str]:
    bound = stiffness_bound(own.damping_n_s_m, of)
    total = own.stiffness_n_m + own.contact_stiffness_n_m
    if total < bound:
        return []
    what, value = "stiffness_n_m", own.stiffness_n_m
    if value < bound:
        what, value = "stiffness_n_m and contact_stiffness_n_m together", total
    note = (
        f"{field}: {what}, {value:g} N/m, is beyond {bound:.3g}, from which on a robot "
        f"with damping_n_s_m {own.damping_n_s_m:g} does not come to rest; lower it"
    )
    return [note]


def _adaptation_notes(
    field: str, own: AdaptationParameters, amplitude_m: float, of: SampledMass
) -> list[str]:
    if own.projected:
        least, most = own.damping_box_n_s_m[0], own.stiffness_box_n_m[1]
        bound = stiffness_bound(least, of)
        note = (
            f"{field}.stiffness_box_n_m ends at {most:g} N/m, but from {bound:.3g} on "
            f"a robot with the least of damping_box_n_s_m, {least:g}, does not come to "
            "rest; end it lower"
        )
        return [note] if most >= bound else []
    bound = rate_bound(own.rule, amplitude_m, of)
    note = (
        f"{field}.rate is {own.rate:g}, but from about {bound:.3g} on K and D run away "
        f"where the target is {amplitude_m:.3g} m ahead; lower it, or set projected"
    )
    return [note] if own.rate >= bound and own.normalisation is None else []
