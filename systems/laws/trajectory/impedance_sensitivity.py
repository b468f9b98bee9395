"""How the motion of P depends on its impedance: eq. 28 to 41, with time."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.laws.trajectory.trajectory_impedance import ContactNumbers


class Impedance(NamedTuple):
    """What may adapt."""

    stiffness: Any
    """K, N/m."""
    damping: Any
    """D, N s/m."""
    contact_stiffness: Any
    """K_e, N/m."""


class Sensitivities(NamedTuple):
    """Accelerations per unit of K, D and K_e, all else equal; (x, y) each."""

    stiffness: tuple[Any, Any]
    damping: tuple[Any, Any]
    contact_stiffness: tuple[Any, Any]


@register_jitable
def sensitivity_sources(
    p_WP: Any, v_WP: Any, target: Any, contacts: Any, mass: Any
) -> Any:
    """The last terms of eq. 34: what dA/dp X + dB/dp u are (eq. 35 to 41).

    Args:
        p_WP: (x, y) m.
        v_WP: (x, y) m/s.
        target: p_d and v_d, four numbers, m and m/s.
        contacts: From ``contacts_of_objects``.
        mass: M, kg.

    Returns:
        ``Sensitivities``: -(p - p_d)/M, -(v - v_d)/M and the sum of (S - d) n/M.
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


class SensitivityNumbers(NamedTuple):
    """The loop whose sensitivities are wanted, at one tick."""

    impedance: Impedance
    contact_damping: float
    """D_e, N s/m."""
    contacts: ContactNumbers
    mass: float
    """M, kg."""
    tick_s: float


@register_jitable
def advance_sensitivity(
    state: Any, begin: Any, source: Any, contacts: Any, loop: Any
) -> None:
    """A tick of d/dt S = A S + source (eq. 34 with its left side and A S restored).

    A is that of the exact linearisation: a contact with a point is stiff by K_e along n
    and by -K_e (S - d)/d across, and damping that fades with the distance adds
    -(D_e/S) (v - v_j) n'. Velocity first, then place, as the virtual mass moves.

    Args:
        state: Changed from ``begin`` on: dp/dq, x and y, and dv/dq, x and y.
        begin: First place.
        source: (x, y) of ``sensitivity_sources``.
        contacts: From ``contacts_of_objects``.
        loop: ``SensitivityNumbers``.
    """
    impedance, tick_s = loop.impedance, loop.tick_s
    px, py = state[begin], state[begin + 1]
    vx, vy = state[begin + 2], state[begin + 3]
    fx = -impedance.stiffness * px - impedance.damping * vx
    fy = -impedance.stiffness * py - impedance.damping * vy
    for contact in contacts:
        nx, ny = contact.n
        along = nx * px + ny * py
        across = contact.overlap_m / contact.distance_m
        k = impedance.contact_stiffness
        damper = loop.contact_damping * contact.share
        fx = fx + k * (across * (px - along * nx) - along * nx) - damper * vx
        fy = fy + k * (across * (py - along * ny) - along * ny) - damper * vy
        if loop.contacts.fades:
            slope = loop.contact_damping / loop.contacts.begins_m * along
            fx = fx + slope * contact.v_relative[0]
            fy = fy + slope * contact.v_relative[1]
    vx = vx + tick_s * (fx / loop.mass + source[0])
    vy = vy + tick_s * (fy / loop.mass + source[1])
    state[begin], state[begin + 1] = px + tick_s * vx, py + tick_s * vy
    state[begin + 2], state[begin + 3] = vx, vy


@register_jitable
def penalty_gradient(contacts: Any, security_m: Any, penalty: Any) -> Any:
    """-sum of lambda h(d) n, the gradient of lambda/2 h(d)^2, h = max(0, d_sec - d).

    The hinge stands for the safety term of eq. 27, lambda/2 (d_sec^2 - d^2).

    Args:
        contacts: From ``contacts_of_objects``.
        security_m: d_sec, m.
        penalty: lambda.

    Returns:
        (x, y): the derivative of the penalty by the place of P, m.
    """
    gx = gy = 0.0
    for contact in contacts:
        hinge = max(security_m - contact.distance_m, 0.0)
        gx = gx - penalty * hinge * contact.n[0]
        gy = gy - penalty * hinge * contact.n[1]
    return gx, gy
