"""Forces on the control point P from a moving target and from objects near P."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.ranging.objects import THERE, VX, VY, X, Y
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import safe_norm

#: An object counts as at rest below this speed, m/s.
_AT_REST_M_S = 0.05


class ContactNumbers(NamedTuple):
    """Constants of the contact force.

    The laws in this package set ``begins_m`` and ``rest_m`` to S, the width of the
    security zone. docs/errata.md lists other readings of the paper, in which these two
    distances differ.
    """

    begins_m: float
    """Distance at which a contact begins, m."""
    rest_m: float
    """Distance at which the spring of a contact has no force, m."""
    fades: bool
    """Whether the damping is 0 at the distance ``begins_m`` and grows toward the
    object.
    """
    narrowed_m: float = math.inf
    """Largest ``begins_m`` and ``rest_m`` for objects at rest, m."""


class Contact(NamedTuple):
    """An object that pushes P at one instant.

    P is the control point of the robot. All vectors have the axes of the world frame W.
    """

    n: tuple[Any, Any]
    """Unit vector from the object to P."""
    distance_m: Any
    """Distance of P from the object, m."""
    overlap_m: Any
    """Compression of the spring, m."""
    v_relative: tuple[Any, Any]
    """Velocity of P relative to the object, m/s."""
    share: Any
    """Share of the damping that acts, 0 to 1."""


def contact_numbers(own: TrajectoryImpedanceParameters) -> ContactNumbers:
    """Computes the constants of the contact force from the parameters of a law."""
    zone_m = own.security_zone_m
    return ContactNumbers(zone_m, zone_m, own.damping_fades)


@register_jitable
def target_force(
    p_WP: Any, v_WP: Any, target: Any, stiffness: Any, damping: Any
) -> Any:
    """Computes the force toward the target, -K (p - p_d) - D (v - v_d).

    This force is eq. 2 of Engelbrecht 2021.

    Args:
        p_WP: Position p (x, y) of the control point P in the world frame W, m; floats
            or AutoDiffXd.
        v_WP: Velocity v (x, y) of P in W, m/s.
        target: Position p_d (x, y), m, and velocity v_d (x, y), m/s, of the target in
            W.
        stiffness: Stiffness K, N/m.
        damping: Damping D, N s/m.

    Returns:
        Force (Ux, Uy) in W, N.
    """
    return (
        stiffness * (target[0] - p_WP[0]) + damping * (target[2] - v_WP[0]),
        stiffness * (target[1] - p_WP[1]) + damping * (target[3] - v_WP[1]),
    )


@register_jitable
def contacts_of_objects(objects: Any, v_WP: Any, numbers: Any) -> Any:
    """Lists the objects within the distance ``numbers.begins_m`` of P.

    P is the control point of the robot.

    Args:
        objects: Vector of the port ``objects_W``. Positions are relative to P.
        v_WP: Velocity (x, y) of P in the world frame W, m/s; floats or AutoDiffXd.
        numbers: ``ContactNumbers``.

    Returns:
        List of ``Contact``.
    """
    found = []
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + THERE] < 0.5:
            continue
        x, y = objects[at + X], objects[at + Y]
        distance = safe_norm(x, y)
        begins_m, rest_m = numbers.begins_m, numbers.rest_m
        if safe_norm(objects[at + VX], objects[at + VY]) < _AT_REST_M_S:
            begins_m = min(begins_m, numbers.narrowed_m)
            rest_m = min(rest_m, numbers.narrowed_m)
        if distance >= begins_m:
            continue
        v_relative = v_WP[0] - objects[at + VX], v_WP[1] - objects[at + VY]
        share = 1.0 + 0.0 * distance
        if numbers.fades:
            share = 1.0 - distance / begins_m
        n = -x / distance, -y / distance
        overlap = rest_m - distance
        found.append(Contact(n, distance, overlap, v_relative, share))
    return found


@register_jitable
def contact_force(contacts: Any, stiffness: Any, damping: Any) -> Any:
    """Computes the force of all contacts (Engelbrecht 2021, eq. 4 and 5).

    Each contact has a spring and a damper. The force is the sum over all contacts of::

        K_e (S - d) n - D_e (v - v_j)

    S - d is the compression of the spring. n is the unit vector from the object to the
    control point P. v - v_j is the velocity of P relative to the object. If the damping
    fades, only a part of D_e acts. The paper prints other signs (docs/errata.md).

    Args:
        contacts: Result of ``contacts_of_objects``.
        stiffness: Contact stiffness K_e, N/m.
        damping: Contact damping D_e, N s/m.

    Returns:
        Force (Vx, Vy) in the world frame W, N.
    """
    fx = fy = 0.0
    for contact in contacts:
        spring = stiffness * contact.overlap_m
        damper = damping * contact.share
        fx = fx + spring * contact.n[0] - damper * contact.v_relative[0]
        fy = fy + spring * contact.n[1] - damper * contact.v_relative[1]
    return fx, fy


@register_jitable
def step_is_blocked(objects: Any, step: Any, block_m: Any) -> Any:
    """Checks whether eq. 6 of Engelbrecht 2021 forbids a step of the control point P.

    Eq. 6 forbids a step that ends within the distance L_block of an object. This
    function makes one exception: it allows a step that leads away from the object.
    Otherwise a robot within L_block could never leave. A robot can get there, because
    it needs a distance of up to v (T + motor lag) to stop from the speed v. T is the
    control period.

    Args:
        objects: Vector of the port ``objects_W``, with the present positions.
        step: Vector (x, y) from P to its next position in the world frame W, m; floats
            or AutoDiffXd.
        block_m: Distance L_block, m.

    Returns:
        True if the step is forbidden.
    """
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + THERE] < 0.5:
            continue
        x, y = objects[at + X], objects[at + Y]
        after = safe_norm(x - step[0], y - step[1])
        if after <= block_m and after <= safe_norm(x, y):
            return True
    return False
