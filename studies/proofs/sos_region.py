"""Computes a region of attraction with motor lag, by sums of squares.

The energy certificate cannot cover motor lag. The model is a head-on approach to an
obstacle. The states are the distance error x = c - c_eq, the velocity v of the virtual
mass M, and the velocity w of the robot's control point:

    x' = w,   M v' = -h(x) x - D_r v,   lag w' = v - w

h is a polynomial. On the domain of x, h is within +-e of the law's secant stiffness at
rest. V = y' P y is a quadratic function of the scaled state y. V decreases on the
region V <= 1, which excludes contact and speeds v beyond the limit. Starts in the
region therefore never collide. The conditions for both signs of e are:

    -V' - sigma (1 - V) is a sum of squares, and sigma is a sum of squares.

The solver Clarabel alternately finds P and the multipliers sigma. The solver CSDP
repeats the last step. Rational arithmetic then checks the result exactly
(``studies.proofs.exact_polynomials``). The solver SCS is not used, because its
tolerance is too large for a proof.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import ClarabelSolver, CsdpSolver

from diagrams import Scenario
from studies.nonlinear.phase_portrait import certified_speeds, head_on_model
from studies.proofs.lag_model import LagModel, lag_model
from studies.proofs.sos_program import (
    box,
    feasibility,
    find_multipliers,
    first_region,
    is_proved,
    larger_region,
    solve,
)

#: Number of alternations between finding P and finding multipliers.
_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class SosRegion:
    """A region of attraction, with its checks and simulated trials."""

    model: LagModel
    """Polynomial model that the region applies to."""
    contact_m: float
    """Distance from control point P to the face that counts as contact, m."""
    P: NDArray[np.float64]
    """(3, 3) matrix of V = y' P y. The region is V <= 1."""
    solvers: dict[str, bool]
    """Whether each solver finds the last step feasible."""
    exact: bool
    """Whether rational arithmetic confirms the region."""
    region_share: float
    """Share of the model's state box that the region of attraction covers.

    The box is the domain of x, with |v| and |w| up to the top speed.
    """
    safe_share: float
    """Share of simulated starts in the box that do not collide."""
    starts: int
    """Number of simulated starts in the region."""
    collisions: int
    """Number of starts in the region that collide; must be 0."""
    energy_starts: int
    """Number of starts, with w = v, that the energy certifies without motor lag."""
    energy_collisions: int
    """Number of these starts that collide with motor lag."""

    @property
    def certified(self) -> bool:
        """Whether both solvers and rational arithmetic confirm the region."""
        return self.exact and all(self.solvers.values())

    def extent(self) -> NDArray[np.float64]:
        """(3,) half extents of the region in x, v and w, m and m/s."""
        return self.model.scales * np.sqrt(np.diag(np.linalg.inv(self.P)))

    def to_dict(self) -> dict[str, Any]:
        """Converts the result to an entry of ``certificates`` in the JSON document."""
        return {
            "kind": "sum_of_squares",
            "law": self.model.contact.law.name,
            "model": "head-on, motor lag, continuous time, no velocity term",
            "motor_lag_s": self.model.lag_s,
            "equilibrium_m": self.model.contact.equilibrium_m,
            "domain_m": self.model.domain_m,
            "error_n_m": self.model.error_n_m,
            "P": self.P,
            "scales": self.model.scales,
            "half_extents": self.extent(),
            "solvers": self.solvers,
            "exact": self.exact,
            "certified": self.certified,
            "region_share": self.region_share,
            "safe_share": self.safe_share,
            "ratio": self.region_share / self.safe_share,
            "inside_starts": self.starts,
            "inside_collisions": self.collisions,
            "energy_starts": self.energy_starts,
            "energy_collisions": self.energy_collisions,
        }


def sos_region(
    scenario: Scenario, *, to_go_m: float | None = None, starts: int = 1000
) -> SosRegion:
    """Computes, proves and tests a region of attraction of a head-on approach.

    Args:
        scenario: Scenario with the law, gains and motor lag.
        to_go_m: Distance from the obstacle's face to the follow point behind it, m.
            None: chosen by ``head_on``.
        starts: Number of simulated starts in the region, and in the whole domain.

    Returns:
        The region, whether it is proved, and the results of its simulated starts.

    Raises:
        InputError: The law is not known.
        ValueError: There is no contact equilibrium, or the motor lag makes the
            equilibrium unstable.
    """
    model = lag_model(scenario, to_go_m=to_go_m)
    P, multipliers = first_region(model)
    for k in range(_ROUNDS):
        P = larger_region(model, P, multipliers)
        if k < _ROUNDS - 1:
            multipliers = find_multipliers(model, P) or multipliers
    # A slightly smaller region leaves a margin for the exact check.
    P = 1.02 * P
    solved = feasibility(model, P)
    results = {
        name: solve(solver, solved.program)
        for name, solver in (("clarabel", ClarabelSolver()), ("csdp", CsdpSolver()))
    }
    contact = scenario.follower.ultrasonic.minimum_range_m
    rng = np.random.default_rng(scenario.seed)
    inside = _draw_inside(model, P, starts, rng)
    low, high = np.array(box(model)).T
    anywhere = rng.uniform(low, high, (starts, 3)) * model.scales
    by_energy = _energy_starts(model, contact, starts, rng)
    return SosRegion(
        model=model,
        contact_m=contact,
        P=P,
        solvers={name: result is not None for name, result in results.items()},
        exact=is_proved(model, P, solved, results["clarabel"]),
        region_share=float(np.mean(_inside(model, P, anywhere))),
        safe_share=float(np.mean(~model.simulate(anywhere, contact_m=contact))),
        starts=starts,
        collisions=int(model.simulate(inside, contact_m=contact).sum()),
        energy_starts=len(by_energy),
        energy_collisions=int(model.simulate(by_energy, contact_m=contact).sum()),
    )


def _energy_starts(
    model: LagModel, contact_m: float, count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(n, 3) random starts in the domain with w = v that the energy certifies."""
    rest, top = model.contact.equilibrium_m, model.scales[1]
    x = rng.uniform(*model.domain_m, count)
    v = rng.uniform(-top, top, count)
    order = np.argsort(x)
    x, v = x[order], v[order]
    limit = certified_speeds(head_on_model(model.contact), rest + x, contact_m)
    safe = np.abs(v) < np.nan_to_num(limit, nan=-1.0)
    return np.column_stack([x, v, v])[safe]


def _inside(
    model: LagModel, P: NDArray[np.float64], states: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(n,) whether V <= 1 at the (n, 3) states."""
    y = states / model.scales
    return np.einsum("ni,ij,nj->n", y, P, y) <= 1.0


def _draw_inside(
    model: LagModel, P: NDArray[np.float64], count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(n, 3) x, v, w, uniform in the region, with |w| up to the top speed."""
    # With P = R R', the state y = R^-T ball has y' P y = |ball|^2.
    root = np.linalg.cholesky(P).T
    kept = np.zeros((0, 3))
    while len(kept) < count:
        ball = rng.standard_normal((2 * count, 3))
        radius = rng.uniform(size=2 * count) ** (1.0 / 3.0)
        ball *= (radius / np.linalg.norm(ball, axis=1))[:, None]
        y = np.linalg.solve(root, ball.T).T
        kept = np.concatenate([kept, y[np.abs(y[:, 2]) <= 1.0]])
    return kept[:count] * model.scales
