"""Impedance of P to a moving target and to objects near P."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.ranging.objects import THERE, VX, VY, X, Y
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import safe_norm


class ContactNumbers(NamedTuple):
    """Constants of the contact force.

    The laws of the package set both distances to S. Other values are other readings of
    the paper, see docs/errata.md.
    """

    begins_m: float
    """Distance at which a contact begins, m."""
    rest_m: float
    """Distance at which the spring of a contact has no force, m."""
    fades: bool
    """Whether the damping is 0 at the distance ``begins_m`` and grows toward the
    object."""


class Contact(NamedTuple):
    """An object that pushes P at one instant. Vectors have the axes of W."""

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
    """Computes the constants of the contact force from the parameters.

    Args:
        own: Parameters of the law.

    Returns:
        The constants.
    """
    zone_m = own.security_zone_m
    return ContactNumbers(zone_m, zone_m, own.damping_fades)


@register_jitable
def target_force(
    p_WP: Any, v_WP: Any, target: Any, stiffness: Any, damping: Any
) -> Any:
    """Computes the force to the target, U = -K (p - p_d) - D (v - v_d) (eq. 2).

    Args:
        p_WP: Position (x, y) of P in W, m; floats or AutoDiffXd.
        v_WP: Velocity (x, y) of P in W, m/s.
        target: p_d and v_d, four numbers in W, m and m/s.
        stiffness: Stiffness K, N/m.
        damping: Damping D, N s/m.

    Returns:
        (Ux, Uy) in W, N.
    """
    return (
        stiffness * (target[0] - p_WP[0]) + damping * (target[2] - v_WP[0]),
        stiffness * (target[1] - p_WP[1]) + damping * (target[3] - v_WP[1]),
    )


@register_jitable
def contacts_of_objects(objects: Any, v_WP: Any, numbers: Any) -> Any:
    """Lists the contacts, which are the objects whose zone contains P.

    Args:
        objects: Vector of the port ``objects_W``. Positions are relative to P.
        v_WP: Velocity (x, y) of P in W, m/s; floats or AutoDiffXd.
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
        if distance >= numbers.begins_m:
            continue
        v_relative = v_WP[0] - objects[at + VX], v_WP[1] - objects[at + VY]
        share = 1.0 + 0.0 * distance
        if numbers.fades:
            share = 1.0 - distance / numbers.begins_m
        n = -x / distance, -y / distance
        overlap = numbers.rest_m - distance
        found.append(Contact(n, distance, overlap, v_relative, share))
    return found


@register_jitable
def contact_force(contacts: Any, stiffness: Any, damping: Any) -> Any:
    """Computes the force of all contacts, V = sum of K_e overlap n - D_e (v - v_j).

    This is the force of eq. 4 and 5 with restored signs.

    Args:
        contacts: Result of ``contacts_of_objects``.
        stiffness: Stiffness K_e, N/m.
        damping: Damping D_e, N s/m.

    Returns:
        (Vx, Vy) in W, N.
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
    """Returns whether eq. 6 refuses a step of P.

    Eq. 6 allows a new position if its distance from every object is greater than
    L_block. Otherwise the robot stays at its position. This function also allows a step
    that ends within L_block but leads away from the object. A robot with momentum comes
    to rest up to v (T + motor lag) farther on, so it may rest within L_block. Without
    the exception it could never leave such a position.

    Args:
        objects: Vector of the port ``objects_W``, with the present positions.
        step: Vector (x, y) from P to its next position in W, m; floats or AutoDiffXd.
        block_m: Distance L_block, m.

    Returns:
        True if the step is refused.
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
