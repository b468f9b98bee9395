"""Simulates starts inside and outside a certified set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.energy.energy_certificate import EnergyCertificate
from analysis.loops.point_mass import PointMassRuns
from systems.framework.input_error import InputError

#: Number of starts per batch. The first batch depends only on the seed.
BATCH = 20_000
#: Most batches. If hardly any start is outside, fewer starts than wanted are found.
_MOST_BATCHES = 100


@dataclass(frozen=True, eq=False)
class CertificateTrials:
    """Simulations of the certificate's own model from random starts."""

    certificate: EnergyCertificate
    """The tested certificate."""
    inside: PointMassRuns
    """Runs from certified starts."""
    outside: PointMassRuns
    """Runs from starts that are not certified."""
    certified_share: float
    """Share of the drawn starts that are certified."""
    energy_share: float
    """Share of the drawn starts that the energy alone certifies, without the clamp."""

    @property
    def inside_collisions(self) -> int:
        """Number of collisions from certified starts; must be 0."""
        return int(np.count_nonzero(self.inside.collided))

    @property
    def outside_collisions(self) -> int:
        """Number of collisions from starts that are not certified."""
        return int(np.count_nonzero(self.outside.collided))

    @property
    def safe_share(self) -> float:
        """Share of all starts that do not collide, by simulation."""
        tried = len(self.outside.starts)
        hit = self.outside_collisions / tried if tried else 0.0
        return 1.0 - (1.0 - self.certified_share) * hit

    @property
    def ratio(self) -> float:
        """Share of certified starts over share of starts that do not collide."""
        return self.certified_share / self.safe_share

    @property
    def example(self) -> NDArray[np.float64] | None:
        """(4,) slowest start that collides, m and m/s; None if no start collides."""
        hit = self.outside.starts[self.outside.collided]
        return hit[np.argmin(np.hypot(*hit[:, 2:].T))] if len(hit) else None

    def to_dict(self) -> dict[str, Any]:
        """Converts the result to plain values for the JSON document."""
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

    Positions are uniform on the free floor. Velocities are uniform in the disc up to
    the top speed.

    Args:
        certificate: Certificate with the floor and the top speed.
        count: Number of drawn positions. Positions in contact are dropped.
        rng: Generator of the random numbers.

    Returns:
        (n, 4) x, y, vx, vy, m and m/s; n is at most ``count``.
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
        starts: Number of certified states, and number of states that are not certified.
            The second number may be smaller if hardly any such states exist.
        duration_s: Simulated time per state, s.

    Returns:
        Results of the runs, and the certified shares of the drawn states.

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
