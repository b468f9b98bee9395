"""Robots that follow one another on a line: does a disturbance grow to the tail?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from analysis.linear.contact_mode import motion_chain
from analysis.linear.frequency_levels import frequency_grid
from analysis.trajectory.route_loop import contact_gains, route_law
from diagrams.scenario.scenario import Scenario
from systems.laws.trajectory.sampled_bounds import SampledMass, sampled_matrix

#: Numbers of robots in the chains that are looked at, the first one among them.
ROBOTS = tuple(range(2, 9))
#: Frequencies that are looked at besides the modes, from here to Nyquist's, rad/s.
_LOWEST, _POINTS = 1e-2, 600
#: A peak that is no more than this above 1 is none: at rest the response is 1.
_ROUNDING = 1e-6
_HALVINGS = 40
#: Zones between P and the disc before it in a chain without contacts.
_APART = 1.25
#: Dampings that are tried, N s/m.
_DAMPINGS = np.geomspace(0.05, 60.0, 80)


class ChainLinks(NamedTuple):
    """What joins a robot to its neighbours, for small motions along the line."""

    stiffness: float
    """K to the place behind the robot before it, N/m."""
    damping: float
    """D, N s/m."""
    feed_forward: float
    """Share of the velocity of the robot before it that its target has."""
    ahead: tuple[float, float] = (0.0, 0.0)
    """K_e, N/m, and felt D_e, N s/m, of the contact with the robot before it."""
    behind: tuple[float, float] = (0.0, 0.0)
    """The same with the robot after it."""
    late_ticks: int = 0
    """Age of what it knows of its neighbours."""


@dataclass(frozen=True)
class ChainPeak:
    """How much a chain amplifies what its first robot does."""

    feed_forward: float
    """Share of the velocity of the robot before that a target has."""
    spacing_m: float
    """That is asked for between P of neighbours, m."""
    peak: float
    """Largest amplification by a pair over frequency, 1 at rest; infinite, as the
    others, where they come to no rest."""
    omega: NDArray[np.float64]
    """(n,) rad/s."""
    gain: NDArray[np.float64]
    """(n, robots - 1) amplitude of each robot of the longest chain, of the first."""
    each: tuple[float, ...]
    """Largest of it over frequency, robot by robot."""
    tail: dict[int, float]
    """Largest amplification from the first to the last of so many robots."""
    frequency_rad_s: float
    """Where the last of the longest chain is amplified most."""

    @property
    def grows(self) -> bool:
        """Whether some robot ever swings more than the first."""
        return max(*self.each, *self.tail.values()) > 1.0 + _ROUNDING


@dataclass(frozen=True)
class RobotChain:
    """Chains of robots with a scenario's gains."""

    stiffness_n_m: float
    damping_n_s_m: float
    peaks: dict[str, ChainPeak]
    """With and without velocity feed-forward, apart and in contact."""
    least_damping_n_s_m: float
    """D from which, without feed-forward and apart, nothing grows at this K; infinite:
    from none that is tried."""
    least_damping_in_contact_n_s_m: float
    """The same in contact, in a chain of eight."""
    most_feed_forward: float
    """Share of the velocity up to which nothing grows at these gains; below 0: even
    without it does something grow."""
    dampings: NDArray[np.float64]
    """(n,) N s/m."""
    peaks_by_damping: NDArray[np.float64]
    """(n, 2) largest |G| with and without feed-forward at this K; infinite where a
    robot alone does not come to rest."""

    @property
    def time_headway_s(self) -> float:
        """D/K: without feed-forward the gap grows by so much times the speed, s."""
        return self.damping_n_s_m / self.stiffness_n_m


def robot_chain(scenario: Scenario) -> RobotChain:
    """Frequency responses of chains of robots like the scenario's.

    Each robot's target is the place of the one before it, less a fixed way, and that
    robot's velocity, all seen by the object sensor: velocities over the last tick.

    Args:
        scenario: Its law, mass, motors and tick are used.

    Returns:
        Responses and bounds.

    Raises:
        InputError: The law is none of a route, or the wheels can slip.
    """
    own = route_law(scenario)
    k, d = own.stiffness_n_m, own.damping_n_s_m
    apart, near = chain_spacings(scenario)
    kinds = {
        "with feed-forward": (1.0, apart),
        "without feed-forward": (0.0, apart),
        "in contact, with feed-forward": (1.0, near),
        "in contact, without feed-forward": (0.0, near),
    }
    if own.contact_stiffness_n_m == 0.0 and own.contact_damping_n_s_m == 0.0:
        kinds = dict(list(kinds.items())[:2])
    peaks = {name: chain_peak(scenario, *kind) for name, kind in kinds.items()}
    late = _late(scenario)
    plain = [
        [
            _stable_peak(scenario, [ChainLinks(k, each, share, late_ticks=late)])
            for share in (1.0, 0.0)
        ]
        for each in _DAMPINGS.tolist()
    ]
    return RobotChain(
        stiffness_n_m=k,
        damping_n_s_m=d,
        peaks=peaks,
        least_damping_n_s_m=least_damping(scenario, links_of(scenario, 0.0, apart, 2)),
        least_damping_in_contact_n_s_m=least_damping(
            scenario, links_of(scenario, 0.0, near, ROBOTS[-1])
        ),
        most_feed_forward=most_feed_forward(scenario, k, d),
        dampings=_DAMPINGS,
        peaks_by_damping=np.array(plain),
    )


def chain_spacings(scenario: Scenario) -> tuple[float, float]:
    """Ways between P of neighbours at which they are out of zones, and in them, m.

    What moves is seen as the disc that holds it.

    Args:
        scenario: Law and robot are used.

    Returns:
        1.25 zones, and half a zone, between P and the disc before it.
    """
    zone_m = route_law(scenario).security_zone_m
    offset = disc_offsets(scenario)[0]
    return _APART * zone_m + offset, 0.5 * zone_m + offset


def disc_offsets(scenario: Scenario) -> tuple[float, float]:
    """How much nearer than a neighbour's P its disc is, of one before and one behind.

    Args:
        scenario: Its robot is used.

    Returns:
        m: P is ahead of its axle, about which the disc is.
    """
    disc = 0.5 * math.hypot(scenario.only.robot.length_m, scenario.only.robot.width_m)
    epsilon = scenario.only.robot.control_point_m
    return disc + epsilon, disc - epsilon


def _late(scenario: Scenario) -> int:
    return round(scenario.router.objects.latency_s / scenario.tick_s)


def resting_gaps(
    scenario: Scenario, spacing_m: float, robots: int
) -> NDArray[np.float64]:
    """Ways between P of neighbours where the chain rests, m.

    Contacts push: the last robot is pushed back by one alone, and so on from there.

    Args:
        scenario: Law and robot are used.
        spacing_m: That is asked for, m.
        robots: How many, the first one among them.

    Returns:
        (robots - 1,) from the first to the last.
    """
    own = route_law(scenario)
    k, k_e, zone_m = own.stiffness_n_m, own.contact_stiffness_n_m, own.security_zone_m
    ahead, behind = disc_offsets(scenario)
    # Along the line a contact with what is ahead is k_e (d - S).
    gaps, pushed = np.empty(robots - 1), 0.0
    for i in reversed(range(robots - 1)):
        gap = spacing_m - pushed / k
        touching = (k * spacing_m - pushed + k_e * (zone_m + ahead)) / (k + k_e)
        if touching - ahead < zone_m:
            gap = touching
        gaps[i] = gap
        off = gap - behind
        pushed = k_e * (zone_m - off) if off < zone_m else 0.0
    return gaps


def links_of(
    scenario: Scenario, feed_forward: float, spacing_m: float, robots: int
) -> tuple[ChainLinks, ...]:
    """What joins the robots of a chain that rests in formation.

    Args:
        scenario: Law, robot and latency of objects are used.
        feed_forward: Share of the velocity of the robot before it.
        spacing_m: That is asked for between P of neighbours, m.
        robots: How many, the first one among them.

    Returns:
        Of each but the first; contacts only where a neighbour's disc is in the zone.
    """
    own = route_law(scenario)
    gaps = resting_gaps(scenario, spacing_m, robots)
    ahead, behind = disc_offsets(scenario)
    late, none = _late(scenario), (0.0, 0.0)
    return tuple(
        ChainLinks(
            own.stiffness_n_m,
            own.damping_n_s_m,
            feed_forward,
            ahead=contact_gains(own, gaps[i] - ahead),
            behind=contact_gains(own, gaps[i + 1] - behind)
            if i + 1 < len(gaps)
            else none,
            late_ticks=late,
        )
        for i in range(len(gaps))
    )


def chain_response(
    scenario: Scenario, links: Sequence[ChainLinks], omega: ArrayLike
) -> NDArray[np.complex128]:
    """From the place of the first robot to the places of all that follow.

    Each obeys M a = -K (p - p') - D (v - c v') and the springs and dampers of its
    contacts; the first one moves as it is made to. p = G_p a and v = G_v a are those of
    wheel command and plant.

    Args:
        scenario: Mass, motors and tick are used.
        links: Of each robot but the first.
        omega: (n,) rad/s.

    Returns:
        (n, len(links)) amplitudes, the first robot's being 1.
    """
    grid, count = np.asarray(omega, dtype=float), len(links)
    response = motion_chain(scenario).response(grid)
    G_p, G_v = response[0, 0], response[1, 0]
    own_speed, before = G_v / G_p, np.exp(-1j * grid * scenario.tick_s)
    matrix = np.zeros((len(grid), count, count), dtype=complex)
    force = np.zeros((len(grid), count, 1), dtype=complex)
    for i, link in enumerate(links):
        seen = before**link.late_ticks
        speed = seen * (1.0 - before) / scenario.tick_s
        (k_a, d_a), (k_b, d_b) = link.ahead, link.behind
        # A contact is with what was seen, and P is where it is.
        matrix[:, i, i] = (
            scenario.only.robot.mass_kg / G_p
            + (link.stiffness + k_a + k_b)
            + (link.damping + d_a + d_b) * own_speed
        )
        pull = link.stiffness * seen + link.damping * link.feed_forward * speed
        pull = pull + k_a * seen + d_a * speed
        if i == 0:
            force[:, 0, 0] = pull
        else:
            matrix[:, i, i - 1] = -pull
        if i + 1 < count:
            matrix[:, i, i + 1] = -(k_b * seen + d_b * speed)
    return np.asarray(np.linalg.solve(matrix, force)[..., 0])


def chain_peak(scenario: Scenario, feed_forward: float, spacing_m: float) -> ChainPeak:
    """Largest amplification by a pair, of each robot, and from head to tail.

    Args:
        scenario: Law, mass, motors, tick and latency of objects are used.
        feed_forward: Share of the velocity of the robot before it.
        spacing_m: That is asked for between P of neighbours, m.

    Returns:
        Over frequencies from 0.01 rad/s to Nyquist's.
    """
    most = ROBOTS[-1]
    links = {n: links_of(scenario, feed_forward, spacing_m, n) for n in ROBOTS}
    omega = _grid(scenario, links[most])
    tail = {n: _stable_peak(scenario, each) for n, each in links.items()}
    return ChainPeak(
        feed_forward=feed_forward,
        spacing_m=spacing_m,
        peak=tail[2],
        omega=omega,
        gain=np.abs(chain_response(scenario, links[most], omega)),
        each=tuple(_stable_peak(scenario, links[most], i) for i in range(most - 1)),
        tail=tail,
        frequency_rad_s=_peak(scenario, links[most])[1],
    )


def _grid(scenario: Scenario, links: Sequence[ChainLinks]) -> NDArray[np.float64]:
    """Frequencies that show every mode of the chain, however lightly damped."""
    poles = np.linalg.eigvals(chain_matrix(scenario, links)).astype(np.complex128)
    return frequency_grid(poles, scenario.tick_s, lowest=_LOWEST, points=_POINTS)


def _peak(
    scenario: Scenario, links: Sequence[ChainLinks], robot: int = -1
) -> tuple[float, float]:
    """Largest amplification of one of them, and its frequency, rad/s."""
    omega = _grid(scenario, links)

    def size(at: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(np.abs(chain_response(scenario, links, at)[:, robot]))

    values = size(omega)
    k = int(np.argmax(values))
    low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
    found = minimize_scalar(
        lambda w: -float(size([w])[0]), bounds=(low, high), method="bounded"
    )
    if -found.fun > values[k]:
        return float(-found.fun), float(found.x)
    return float(values[k]), float(omega[k])


def chain_matrix(
    scenario: Scenario, links: Sequence[ChainLinks]
) -> NDArray[np.float64]:
    """x+ = A x of the robots behind a first one that rests.

    Args:
        scenario: Mass, motors and tick are used.
        links: Of each robot but the first.

    Returns:
        (n, n); states of each robot are those of ``sampled_matrix``, then as many
        earlier places as its neighbours need.
    """
    tick_s, mass = scenario.tick_s, scenario.only.robot.mass_kg
    of = SampledMass(mass, scenario.only.plant.motor_lag_s, tick_s)
    free = sampled_matrix(0.0, 0.0, of)
    late = links[0].late_ticks
    size = 3 + late + 1
    # An acceleration moves v by T, and w and p as v moves them.
    moved = tick_s / mass * free[:, 2]
    matrix = np.zeros((size * len(links), size * len(links)))
    for i, link in enumerate(links):
        (k_a, d_a), (k_b, d_b) = link.ahead, link.behind
        force = np.zeros(len(matrix))
        own = size * i
        force[own] = -(link.stiffness + k_a + k_b)
        force[own + 2] = -(link.damping + d_a + d_b)
        front = link.stiffness + k_a, link.damping * link.feed_forward + d_a
        for at, (k, d) in ((i - 1, front), (i + 1, (k_b, d_b))):
            if 0 <= at < len(links):
                places = [size * at, *range(size * at + 3, size * (at + 1))]
                force[places[late]] += k + d / tick_s
                force[places[late + 1]] -= d / tick_s
        block = slice(own, own + 3)
        matrix[block, block] = free
        matrix[block] += np.outer(moved, force)
        matrix[own + 3, own] = 1.0
        for n in range(late):
            matrix[own + 4 + n, own + 3 + n] = 1.0
    return matrix


def _rests(scenario: Scenario, links: Sequence[ChainLinks]) -> bool:
    """Whether the robots come to rest behind one that rests."""
    matrix = chain_matrix(scenario, links)
    return bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0)


def _stable_peak(
    scenario: Scenario, links: Sequence[ChainLinks], robot: int = -1
) -> float:
    """Largest amplification of one of them; infinite where they come to no rest."""
    return _peak(scenario, links, robot)[0] if _rests(scenario, links) else math.inf


def least_damping(scenario: Scenario, links: Sequence[ChainLinks]) -> float:
    """D from which no robot of a chain swings more than the first, N s/m.

    Args:
        scenario: Mass, motors and tick are used.
        links: Of each robot but the first; their own D does not count.

    Returns:
        By bisection; infinite where no damping that is tried will do.
    """

    def calm(damping: float) -> bool:
        damped = [link._replace(damping=damping) for link in links]
        if not _rests(scenario, damped):
            return False
        peaks = (_peak(scenario, damped, i)[0] for i in range(len(damped)))
        return all(peak <= 1.0 + _ROUNDING for peak in peaks)

    tried = _DAMPINGS.tolist()
    first = next((n for n, each in enumerate(tried) if calm(each)), None)
    if first is None:
        return math.inf
    low, high = tried[max(first - 1, 0)], tried[first]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if calm(middle) else (middle, high)
    return high


def most_feed_forward(scenario: Scenario, stiffness: float, damping: float) -> float:
    """Share of the velocity of the one before up to which nothing grows, apart.

    Args:
        scenario: Mass, motors, tick and latency of objects are used.
        stiffness: K, N/m.
        damping: D, N s/m.

    Returns:
        By bisection, 0 to 1; -1 where something grows even without it.
    """
    late = _late(scenario)

    def calm(share: float) -> bool:
        links = ChainLinks(stiffness, damping, share, late_ticks=late)
        return _stable_peak(scenario, [links]) <= 1.0 + _ROUNDING

    if not calm(0.0):
        return -1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if calm(middle) else (low, middle)
    return low
