"""Head-on approach with motor lag, as a polynomial model.

With x = c - c_eq, v of the virtual mass and w of P:

    x' = w,   M v' = -h(x) x - D_r v,   lag w' = v - w

h is the law's secant stiffness at rest: a polynomial that stays within an error
of the law on a domain of x.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.certificates.exact_polynomials import Exponents, Polynomial
from analysis.laws.head_on import HeadOn, head_on
from diagrams import Scenario

#: Degree of h, and how far it may be off, as a share of h(0).
_DEGREE, _TOLERANCE = 4, 0.01
#: Farthest that the domain reaches beyond the equilibrium, m.
_FARTHEST_M = 0.5


@dataclass(frozen=True, eq=False)
class LagModel:
    """The polynomial model and its domain."""

    contact: HeadOn
    """The approach."""
    lag_s: float
    """Time constant of the motors, s."""
    domain_m: tuple[float, float]
    """Least and largest x = c - c_eq, m."""
    coefficients: NDArray[np.float64]
    """(degree + 1,) of h in x / scale, N/m."""
    error_n_m: float
    """Largest |h of the law - h| on the domain, N/m."""

    @property
    def scales(self) -> NDArray[np.float64]:
        """(3,) y = (x, v, w) / scales, m and m/s."""
        top = self.contact.scenario.only.robot.top_speed_m_s
        return np.array([max(map(abs, self.domain_m)), top, top])

    def rates(self, sign: float) -> list[Polynomial]:
        """y' as polynomials of y, with h off by ``sign`` times its error."""
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
        """Whether starts touch, by the law itself.

        Runge-Kutta with a tenth of the lag; the clamp acts on v.

        Args:
            starts: (n, 3) x = c - c_eq, m, v and w, m/s.
            contact_m: P nearer to the face is contact, m.
            duration_s: Simulated time, s.

        Returns:
            (n,) True where contact was made within that time.
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
    """The polynomial model on the widest domain that it fits.

    Args:
        scenario: Law, gains and motor lag.
        to_go_m: See ``head_on``, m.

    Returns:
        The model; its h is off by at most 1 % of h at the equilibrium.

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
        # The side where the law is farther off gives way.
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
    """Coefficients of h in x / scale, and how far the law is off, N/m."""
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
    # Centred, and with a margin for what lies between the points.
    middle = 0.5 * (miss.max() + miss.min())
    coefficients = np.array(fitted.coef, dtype=float)
    coefficients[0] += middle
    between = float(np.abs(np.diff(miss)).max())
    return coefficients, 0.5 * float(miss.max() - miss.min()) + between
