"""Simulates initial states inside and outside a certified set.

A start is an initial state of the robot's control point: position and velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.energy.energy_certificate import EnergyCertificate
from analysis.loops.point_mass import PointMassRuns
from systems.framework.input_error import InputError

#: Number of positions per batch. The seed alone determines the first batch.
BATCH = 20_000
#: Largest number of batches. If hardly any starts are inside or outside the certified
#: set, this number of batches contains fewer of them than requested.
_MOST_BATCHES = 100


@dataclass(frozen=True, eq=False)
class CertificateTrials:
    """Simulations of the certificate's point-mass model from random starts."""

    certificate: EnergyCertificate
    """The tested certificate."""
    inside: PointMassRuns
    """Runs from certified starts."""
    outside: PointMassRuns
    """Runs from starts that are not certified."""
    certified_share: float
    """Share of the drawn starts that are certified, 0 to 1."""
    energy_share: float
    """Share of the drawn starts that are certified without use of the speed limit."""

    @property
    def inside_collisions(self) -> int:
        """Number of collisions from certified starts. A correct certificate gives 0."""
        return int(np.count_nonzero(self.inside.collided))

    @property
    def outside_collisions(self) -> int:
        """Number of collisions from starts that are not certified."""
        return int(np.count_nonzero(self.outside.collided))

    @property
    def safe_share(self) -> float:
        """Estimated share of all starts that do not collide, 0 to 1.

        Certified starts count as safe. The simulations give the share of the others.
        """
        tried = len(self.outside.starts)
        hit = self.outside_collisions / tried if tried else 0.0
        return 1.0 - (1.0 - self.certified_share) * hit

    @property
    def ratio(self) -> float:
        """``certified_share`` divided by ``safe_share``."""
        return self.certified_share / self.safe_share

    @property
    def example(self) -> NDArray[np.float64] | None:
        """(4,) x, y, vx, vy of the slowest start that collides, m and m/s; or None."""
        hit = self.outside.starts[self.outside.collided]
        return hit[np.argmin(np.hypot(*hit[:, 2:].T))] if len(hit) else None

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        rises = np.append(self.inside.energy_rises_j, self.outside.energy_rises_j)
        return {
            "inside_starts": len(self.inside.starts),
            "inside_collisions": self.inside_collisions,
            "outside_starts": len(self.outside.starts),
            "outside_collisions": self.outside_collisions,
            "certified_share": self.certified_share,
            "energy_alone_share": self.energy_share,
            "safe_share": self.safe_share,
            "ratio": self.ratio,
            "closest_inside_m": self.inside.closest_m.min(initial=np.inf),
            "largest_energy_rise_j": rises.max(initial=0.0),
            "colliding_start": self.example,
        }


def draw_starts(
    certificate: EnergyCertificate, count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Draws random starts on the free floor.

    Positions are uniform on the free floor. Velocities are uniform in a disc whose
    radius is the top speed.

    Args:
        certificate: Certificate with the floor and the top speed.
        count: Number of drawn positions. Positions in contact are dropped.
        rng: Generator of the random numbers.

    Returns:
        (n, 4) x, y, vx, vy in W, m and m/s; n is at most ``count``.
    """
    half = 0.5 * certificate.cell_m
    x, y = certificate.x_m, certificate.y_m
    low = [x[0] - half, y[0] - half]
    high = [x[-1] + half, y[-1] + half]
    points = rng.uniform(low, high, (count, 2))
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    speed = certificate.model.top_speed_m_s * np.sqrt(rng.uniform(size=count))
    velocity = speed * np.array([np.cos(angle), np.sin(angle)])
    states = np.column_stack([points, velocity.T])
    return states[certificate.model.clearances(points) > certificate.contact_m]


def try_certificate(
    certificate: EnergyCertificate, *, starts: int = 300, duration_s: float = 40.0
) -> CertificateTrials:
    """Simulates certified initial states, and as many that are not certified.

    Args:
        certificate: Certificate to test.
        starts: Number of certified states to simulate, and number of other states. If
            hardly any states of a kind exist, fewer of this kind are simulated.
        duration_s: Simulated time per state, s.

    Returns:
        Results of the runs, and the share of the drawn states that are certified.

    Raises:
        InputError: ``starts`` is below 1.
    """
    if starts < 1:
        raise InputError("starts", f"{starts} must be at least 1")
    rng = np.random.default_rng(certificate.scenario.seed)
    inside: list[NDArray[np.float64]] = []
    outside: list[NDArray[np.float64]] = []
    drawn = certified = by_energy = 0
    for _ in range(_MOST_BATCHES):
        states = draw_starts(certificate, BATCH, rng)
        safe = certificate.certified(states)
        drawn, certified = drawn + len(states), certified + int(safe.sum())
        by_energy += int(certificate.certified(states, clamp=False).sum())
        inside.append(states[safe][:starts])
        outside.append(states[~safe][:starts])
        if min(sum(map(len, part)) for part in (inside, outside)) >= starts:
            break
    runs = [
        certificate.model.run(
            np.concatenate(part)[:starts],
            contact_m=certificate.contact_m,
            duration_s=duration_s,
            term=certificate.term,
        )
        for part in (inside, outside)
    ]
    return CertificateTrials(
        certificate=certificate,
        inside=runs[0],
        outside=runs[1],
        certified_share=certified / drawn,
        energy_share=by_energy / drawn,
    )
