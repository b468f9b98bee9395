"""Polynomial model of a robot with motor lag that approaches an obstacle head-on.

The states are the distance error x = c - c_eq from the equilibrium distance, the
velocity v of the virtual mass M, and the velocity w of the robot's control point:

    x' = w,   M v' = -h(x) x - D_r v,   lag w' = v - w

h is a polynomial that approximates the law's secant stiffness at rest. The error of h
is bounded on a domain of x.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams import Scenario
from studies.nonlinear.head_on import HeadOn, head_on
from studies.proofs.exact_polynomials import Exponents, Polynomial

# Degree of the polynomial h, and largest error of h as a share of h(0).
_DEGREE, _TOLERANCE = 4, 0.01
# Largest extent of the domain beyond the equilibrium, m.
_FARTHEST_M = 0.5


@dataclass(frozen=True, eq=False)
class LagModel:
    """Polynomial model of a head-on approach, valid on a domain of x.

    The states are the distance error x = c - c_eq, the velocity v of the virtual mass,
    and the velocity w of the robot's control point. h(x) is the stiffness.
    """

    contact: HeadOn
    """The head-on approach without motor lag."""
    lag_s: float
    """Time constant of the motors, s."""
    domain_m: tuple[float, float]
    """Least and largest x = c - c_eq, m."""
    coefficients: NDArray[np.float64]
    """(degree + 1,) coefficients of h as a polynomial of x / scale, N/m."""
    error_n_m: float
    """Largest error of h on the domain, N/m."""

    @property
    def scales(self) -> NDArray[np.float64]:
        """(3,) scales of the scaled state y = (x, v, w) / scales, m and m/s."""
        top = self.contact.scenario.only.robot.top_speed_m_s
        return np.array([max(map(abs, self.domain_m)), top, top])

    def rates(self, sign: float) -> list[Polynomial]:
        """Polynomials y' of y, with ``sign`` times the error of h added to h."""
        scenario = self.contact.scenario
        mass, damping = (
            scenario.only.robot.mass_kg,
            scenario.follower.attraction.damping_n_s_m,
        )
        a, b = float(self.scales[0]), float(self.scales[1])
        h = self.coefficients.copy()
        h[0] += sign * self.error_n_m
        push: dict[Exponents, Any] = {
            (k + 1, 0, 0): -a * float(value) / (mass * b) for k, value in enumerate(h)
        }
        push[0, 1, 0] = -damping / mass
        return [
            Polynomial({(0, 0, 1): b / a}),
            Polynomial(push),
            Polynomial({(0, 1, 0): 1.0 / self.lag_s, (0, 0, 1): -1.0 / self.lag_s}),
        ]

    def simulate(
        self, starts: NDArray[np.float64], *, contact_m: float, duration_s: float = 40.0
    ) -> NDArray[np.bool_]:
        """Simulates head-on approaches with the original law, and detects contacts.

        The Runge-Kutta step is 0.4 times the motor lag, but at most 20 ms. The velocity
        v of the virtual mass is limited to the top speed.

        Args:
            starts: (n, 3) distance error x, m, velocity v of the virtual mass, m/s, and
                velocity w of the control point, m/s.
            contact_m: Distance from the obstacle that counts as contact, m.
            duration_s: Simulated time, s.

        Returns:
            (n,) True if contact was made within that time.
        """
        scenario, law = self.contact.scenario, self.contact.law
        mass, damping = (
            scenario.only.robot.mass_kg,
            scenario.follower.attraction.damping_n_s_m,
        )
        top, stiffness = (
            scenario.only.robot.top_speed_m_s,
            scenario.follower.attraction.stiffness_n_m,
        )
        rest, to_go = self.contact.equilibrium_m, self.contact.to_go_m
        step = min(0.02, 0.4 * self.lag_s)

        def slope(y: NDArray[np.float64]) -> NDArray[np.float64]:
            c = rest + y[0]
            f = law.at_rest(c)
            pull = stiffness * (to_go + c)
            return np.array(
                [y[2], (f - pull - damping * y[1]) / mass, (y[1] - y[2]) / self.lag_s]
            )

        y = starts.T.copy()
        touched = np.zeros(len(starts), dtype=bool)
        for _ in range(round(duration_s / step)):
            k1 = slope(y)
            k2 = slope(y + 0.5 * step * k1)
            k3 = slope(y + 0.5 * step * k2)
            k4 = slope(y + step * k3)
            y += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            y[1] = np.clip(y[1], -top, top)
            touched |= rest + y[0] <= contact_m
        return touched


def lag_model(scenario: Scenario, *, to_go_m: float | None = None) -> LagModel:
    """Computes the polynomial model of a head-on approach on the largest domain.

    Args:
        scenario: Scenario with the law, gains and motor lag.
        to_go_m: Distance from the obstacle's face to the follow point behind it, m.
            None: chosen by ``head_on``.

    Returns:
        The model. The error of its stiffness h is at most 1 % of h at the equilibrium.

    Raises:
        InputError: The law is not known.
        ValueError: There is no contact equilibrium.
    """
    contact = head_on(scenario, to_go_m=to_go_m)
    nearest = scenario.follower.ultrasonic.minimum_range_m - contact.equilibrium_m
    far, near = _FARTHEST_M, nearest
    while True:
        coefficients, error = _fit(contact, (near, far))
        if error <= _TOLERANCE * abs(coefficients[0]):
            break
        # Shortens the domain on the side with the larger error.
        _, far_error = _fit(contact, (0.5 * near, far))
        _, near_error = _fit(contact, (near, 0.5 * far))
        if far_error >= near_error:
            far *= 0.9
        else:
            near *= 0.9
    return LagModel(
        contact, scenario.only.plant.motor_lag_s, (near, far), coefficients, error
    )


def _fit(
    contact: HeadOn, domain: tuple[float, float]
) -> tuple[NDArray[np.float64], float]:
    """Fits the coefficients of h in x / scale, and bounds the error of h, N/m."""
    x = np.arange(domain[0], domain[1], 2e-4)
    x = x[np.abs(x) > 1e-3]
    c = contact.equilibrium_m + x
    f = contact.law.at_rest(c)
    pull = contact.scenario.follower.attraction.stiffness_n_m * (contact.to_go_m + c)
    h = -(f - pull) / x
    scale = max(map(abs, domain))
    fitted = np.polynomial.Polynomial.fit(
        x / scale, h, _DEGREE, domain=[-1.0, 1.0], window=[-1.0, 1.0]
    )
    miss = h - fitted(x / scale)
    # Centers the error, and adds a margin for values between the points.
    middle = 0.5 * (miss.max() + miss.min())
    coefficients = np.array(fitted.coef, dtype=float)
    coefficients[0] += middle
    between = float(np.abs(np.diff(miss)).max())
    return coefficients, 0.5 * float(miss.max() - miss.min()) + between
