"""Sensitivities of the motion of P to the gains K, D, and K_e (eq. 28 to 41).

The equations are those of Engelbrecht, Steyn and Djouani (2021). P is the control point
of the robot. K is the stiffness to the target, D is the damping, and K_e is the
stiffness of contacts.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable


class Sensitivities(NamedTuple):
    """Partial derivatives (x, y) of the acceleration with respect to K, D, and K_e."""

    stiffness: tuple[Any, Any]
    damping: tuple[Any, Any]
    contact_stiffness: tuple[Any, Any]


@register_jitable
def sensitivity_sources(
    p_WP: Any, v_WP: Any, target: Any, contacts: Any, mass: Any
) -> Any:
    """Computes the source terms of the sensitivities to the gains K, D, and K_e.

    K is the stiffness to the target, D is the damping, and K_e is the stiffness of
    contacts. The model of the motion is X' = A X + B u with the state X and the input
    u. For a gain q, the source term is dA/dq X + dB/dq u (Engelbrecht 2021, eq. 34).
    Eq. 35 to 41 give it for the three gains:

    - K: -(p - p_d)/M
    - D: -(v - v_d)/M
    - K_e: sum of (S - d) n/M over all contacts

    S - d is the overlap of a contact. n is the unit vector from the object to P.

    Args:
        p_WP: Position p (x, y) of the control point P in the world frame W, m.
        v_WP: Velocity v (x, y) of P in W, m/s.
        target: Position p_d (x, y), m, and velocity v_d (x, y), m/s, of the target in
            W.
        contacts: Result of ``contacts_of_objects``.
        mass: Virtual mass M, kg.

    Returns:
        ``Sensitivities`` with the three terms.
    """
    ex = ey = 0.0
    for contact in contacts:
        ex = ex + contact.overlap_m * contact.n[0]
        ey = ey + contact.overlap_m * contact.n[1]
    return Sensitivities(
        ((target[0] - p_WP[0]) / mass, (target[1] - p_WP[1]) / mass),
        ((target[2] - v_WP[0]) / mass, (target[3] - v_WP[1]) / mass),
        (ex / mass, ey / mass),
    )


@register_jitable
def advance_sensitivity(
    state: Any, begin: Any, source: Any, contacts: Any, gains: Any, numbers: Any
) -> None:
    """Integrates the sensitivity X_q to one gain q over one control period.

    X_q consists of dp/dq and dv/dq, where p and v are the position and velocity of the
    control point P. The equation is d/dt X_q = A X_q + source. It is eq. 34 of
    Engelbrecht 2021 with two corrections: the left side is a time derivative, and the
    right side contains A X_q.

    A is the exact linearization of the motion. Besides the gains K and D, it contains
    these terms for each contact:

    - the stiffness K_e along n, the unit vector from the object to P
    - the stiffness -K_e (S - d)/d across n, where d is the distance of the object, and
      contacts begin at the distance S
    - the damping D_e, which fades with d
    - the matrix -(D_e/S) (v - v_j) n^T, because the damping fades; v and v_j are the
      velocities of P and of the object

    The function first updates dv/dq. It then updates dp/dq with the new dv/dq, because
    the model of the virtual mass updates v and p in the same order.

    Args:
        state: State of the block. The function changes four numbers: dp/dq (x and y)
            and dv/dq (x and y).
        begin: Index of the first of these four numbers.
        source: Source term (x, y) from ``sensitivity_sources``.
        contacts: Result of ``contacts_of_objects`` for damping that fades.
        gains: Stiffness K, N/m, damping D, N s/m, and contact stiffness K_e, N/m.
        numbers: ``AdaptationNumbers``.
    """
    tick_s = numbers.tick_s
    stiffness, damping, contact_stiffness = gains
    px, py = state[begin], state[begin + 1]
    vx, vy = state[begin + 2], state[begin + 3]
    # Spring and damper to the target.
    fx = -stiffness * px - damping * vx
    fy = -stiffness * py - damping * vy
    # Spring and damper of each contact.
    for contact in contacts:
        nx, ny = contact.n
        along = nx * px + ny * py
        across = contact.overlap_m / contact.distance_m
        k = contact_stiffness
        damper = numbers.contact_damping * contact.share
        fx = fx + k * (across * (px - along * nx) - along * nx) - damper * vx
        fy = fy + k * (across * (py - along * ny) - along * ny) - damper * vy
        slope = numbers.contact_damping / numbers.contacts.begins_m * along
        fx = fx + slope * contact.v_relative[0]
        fy = fy + slope * contact.v_relative[1]
    # Velocity, then position.
    vx = vx + tick_s * (fx / numbers.mass + source[0])
    vy = vy + tick_s * (fy / numbers.mass + source[1])
    state[begin], state[begin + 1] = px + tick_s * vx, py + tick_s * vy
    state[begin + 2], state[begin + 3] = vx, vy


@register_jitable
def penalty_gradient(contacts: Any, security_m: Any, penalty: Any) -> Any:
    """Computes the gradient of the penalty for small distances from objects.

    For an object at the distance d, the penalty is lambda/2 h^2. h is the larger of 0
    and d_sec - d. The gradient is the sum of -lambda h n over all objects. n is the
    unit vector from the object to the control point P. The penalty replaces the safety
    term lambda/2 (d_sec^2 - d^2) of Engelbrecht 2021, eq. 27.

    Args:
        contacts: Result of ``contacts_of_objects``.
        security_m: Distance d_sec below which the penalty acts, m.
        penalty: Weight lambda.

    Returns:
        Derivatives (x, y) of the penalty with respect to the position of P, m.
    """
    gx = gy = 0.0
    for contact in contacts:
        hinge = max(security_m - contact.distance_m, 0.0)
        gx = gx - penalty * hinge * contact.n[0]
        gy = gy - penalty * hinge * contact.n[1]
    return gx, gy
