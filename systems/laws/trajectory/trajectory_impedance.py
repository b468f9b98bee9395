"""Impedance of P to a moving target, and to what is near it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.laws.trajectory.parameters import TrajectoryImpedanceParameters
from systems.ranging.objects import THERE, VX, VY, X, Y
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import safe_norm


class ContactNumbers(NamedTuple):
    """What the force of a contact depends on."""

    begins_m: float
    """Distance at which it begins, m."""
    rest_m: float
    """Distance at which its spring has no force, m."""
    fades: bool
    spring_sign: float
    damper_sign: float


class Contact(NamedTuple):
    """An object that pushes, at one instant; axes of W."""

    n: tuple[Any, Any]
    """Unit vector from it to P."""
    distance_m: Any
    """Of P from it, m."""
    overlap_m: Any
    """Of its spring, m."""
    v_relative: tuple[Any, Any]
    """Velocity of P less its own, m/s."""
    share: Any
    """Of the damping that is felt, 0 to 1."""


def contact_numbers(own: TrajectoryImpedanceParameters) -> ContactNumbers:
    """How contacts are read.

    Args:
        own: The law's parameters.

    Returns:
        The numbers.
    """
    security, horizon = own.security_zone_m, own.horizon_m
    begins, rest = {
        "security": (security, security),
        "envelope": (horizon, horizon),
        "jump": (security, horizon),
    }[own.zone]
    return ContactNumbers(
        begins,
        rest,
        own.damping_fades,
        -1.0 if own.reading == "printed_state" else 1.0,
        -1.0 if own.reading == "printed_force" else 1.0,
    )


@register_jitable
def target_force(
    p_WP: Any, v_WP: Any, target: Any, stiffness: Any, damping: Any
) -> Any:
    """U = -K (p - p_d) - D (v - v_d), eq. 2.

    Args:
        p_WP: (x, y) m; floats or AutoDiffXd.
        v_WP: (x, y) m/s.
        target: p_d and v_d, four numbers in W, m and m/s.
        stiffness: K, N/m.
        damping: D, N s/m.

    Returns:
        (x, y) N.
    """
    return (
        stiffness * (target[0] - p_WP[0]) + damping * (target[2] - v_WP[0]),
        stiffness * (target[1] - p_WP[1]) + damping * (target[3] - v_WP[1]),
    )


@register_jitable
def contacts_of_objects(objects: Any, v_WP: Any, numbers: Any) -> Any:
    """The objects whose zone P is in.

    Args:
        objects: As of the port ``objects_W``.
        v_WP: (x, y) m/s; floats or AutoDiffXd.
        numbers: ``ContactNumbers``.

    Returns:
        ``Contact`` of each.
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
        # Eq. 10 has the obstacle itself in the place of the envelope point.
        attracts = numbers.spring_sign < 0.0
        overlap = distance if attracts else numbers.rest_m - distance
        found.append(Contact(n, distance, overlap, v_relative, share))
    return found


@register_jitable
def contact_force(contacts: Any, stiffness: Any, damping: Any, numbers: Any) -> Any:
    """V = sum of K_e overlap n - D_e (v - v_j), eq. 4 and 5 with the signs restored.

    Args:
        contacts: From ``contacts_of_objects``.
        stiffness: K_e, N/m.
        damping: D_e, N s/m.
        numbers: ``ContactNumbers``.

    Returns:
        (x, y) N.
    """
    fx = fy = 0.0
    for contact in contacts:
        spring = numbers.spring_sign * stiffness * contact.overlap_m
        damper = numbers.damper_sign * damping * contact.share
        fx = fx + spring * contact.n[0] - damper * contact.v_relative[0]
        fy = fy + spring * contact.n[1] - damper * contact.v_relative[1]
    return fx, fy


@register_jitable
def step_is_blocked(objects: Any, step: Any, block_m: Any) -> Any:
    """Whether eq. 6 refuses a step of P.

    Eq. 6 allows a new position if its distance d from every object is greater than
    L_block, and leaves the robot where it is otherwise. A step that ends within
    L_block but leads away from the object is allowed here: a robot with momentum
    comes to rest up to v (T + motor lag) farther on, and would stay there for ever.

    Args:
        objects: As of the port ``objects_W``.
        step: (x, y) from P to its next position, m; floats or AutoDiffXd.
        block_m: L_block, m.

    Returns:
        True where it is refused. Objects count where they are now.
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


def state_matrices(
    mass: float,
    target: tuple[float, float],
    contacts: list[tuple[float, float]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[NDArray[np.float64]]]:
    """A, B1 and B2j of eq. 11 to 14, for one axis, signs restored.

    The state is (p, v); u_d = (p_d, v_d), and X_j = (x_e, v_e) is the envelope point
    of object j, S before it, and its velocity.

    Args:
        mass: M, kg.
        target: K, N/m, and D, N s/m.
        contacts: K_e and D_e of each object.

    Returns:
        (2, 2) each.
    """
    sums = np.sum([target, *contacts], axis=0)
    a = np.array([[0.0, 1.0], [-sums[0] / mass, -sums[1] / mass]])
    inputs = [np.array([[0.0, 0.0], [k / mass, d / mass]]) for k, d in contacts]
    return a, np.array([[0.0, 0.0], [target[0] / mass, target[1] / mass]]), inputs
