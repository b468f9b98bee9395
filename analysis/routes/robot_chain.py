"""Computes whether disturbances grow along a line of robots (chain).

Each robot of the chain follows the robot ahead. The first robot moves on its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from analysis.loops.contact_mode import motion_chain
from analysis.loops.frequency_levels import frequency_grid
from analysis.loops.linear_models import LinearModel
from analysis.routes.route_loop import contact_gains, route_law
from diagrams.scenario.scenario import Scenario
from systems.laws.trajectory.sampled_bounds import SampledMass, sampled_matrix

#: Numbers of robots in the analyzed chains, including the first robot.
ROBOTS = tuple(range(2, 9))
# Grid of frequencies up to the Nyquist frequency. ``_LOWEST``: lowest frequency, rad/s.
# ``_POINTS``: number of frequencies, without those that are added near the modes.
_LOWEST, _POINTS = 1e-2, 600
# An amplification counts as above 1 only if it exceeds 1 by more than this value. At
# zero frequency, it is 1 up to rounding.
_ROUNDING = 1e-6
_HALVINGS = 40
# Distance from P to the disc of the robot ahead in a chain without contacts, as a
# multiple of the radius of the security zone.
_APART = 1.25
# Values of the damping D that are tried, N s/m.
_DAMPINGS = np.geomspace(0.05, 60.0, 80)


class ChainLinks(NamedTuple):
    """Springs and dampers between a robot and its neighbors, for small motions.

    The target of the robot is the desired position behind the robot ahead.
    """

    stiffness: float
    """Stiffness K between the position of the robot and that of its target, N/m."""
    damping: float
    """Damping D between the velocity of the robot and that of its target, N s/m."""
    feed_forward: float
    """Velocity of the target divided by the velocity of the robot ahead."""
    ahead: tuple[float, float] = (0.0, 0.0)
    """Stiffness, N/m, and damping, N s/m, of the contact with the robot ahead."""
    behind: tuple[float, float] = (0.0, 0.0)
    """Stiffness, N/m, and damping, N s/m, of the contact with the robot behind."""
    late_ticks: int = 0
    """Latency of the observed neighbors, in control periods."""


@dataclass(frozen=True)
class ChainPeak:
    """How much chains of 2 to 8 robots amplify the motion of their first robot.

    The amplification of a robot is its amplitude divided by that of the first robot. A
    peak is the largest amplification over all frequencies. If a chain is unstable, its
    peaks are infinite.
    """

    feed_forward: float
    """Velocity of a robot's target divided by the velocity of the robot ahead."""
    spacing_m: float
    """Desired distance between the control points P of neighbors, m."""
    peak: float
    """Peak of the second robot in a chain of two robots."""
    omega: NDArray[np.float64]
    """(n,) frequencies, rad/s."""
    gain: NDArray[np.float64]
    """(n, 7) amplification of each robot after the first, in a chain of eight."""
    each: tuple[float, ...]
    """(7,) peak of each robot after the first, in a chain of eight."""
    tail: dict[int, float]
    """Peak of the last robot of a chain, by the number of robots in the chain."""
    frequency_rad_s: float
    """Frequency of the peak of the last robot in a chain of eight, rad/s."""

    @property
    def grows(self) -> bool:
        """Whether any robot oscillates more than the first robot at any frequency."""
        return max(*self.each, *self.tail.values()) > 1.0 + _ROUNDING


@dataclass(frozen=True)
class RobotChain:
    """Amplification of motions in lines of robots that follow one another (chains).

    All robots have the scenario's gains. Spacing and feed-forward differ between
    chains. A chain is "apart" if the robots are outside each other's security zones.
    Otherwise, the chain is "in contact". With feed-forward, the target of a robot has
    the velocity of the robot ahead. Without feed-forward, it has the velocity 0.
    """

    stiffness_n_m: float
    damping_n_s_m: float
    peaks: dict[str, ChainPeak]
    """Amplifications of each kind of chain, by name of the kind."""
    least_damping_n_s_m: float
    """Least damping D with which a chain of two robots does not amplify motions, N s/m.
    The chain is apart and has no feed-forward. Infinite if no tried D suffices."""
    least_damping_in_contact_n_s_m: float
    """The same for eight robots in contact, N s/m."""
    most_feed_forward: float
    """Largest feed-forward with which a chain of two robots that is apart does not
    amplify motions: velocity of the target divided by that of the robot ahead. -1 if
    the chain amplifies motions even without feed-forward."""
    dampings: NDArray[np.float64]
    """(n,) tried values of D, N s/m."""
    peaks_by_damping: NDArray[np.float64]
    """(n, 2) largest amplification over all frequencies by a chain of two robots that
    is apart, for each tried D: with feed-forward, and without. Infinite if the chain is
    unstable."""

    @property
    def time_headway_s(self) -> float:
        """Time headway D/K without feed-forward, s.

        At a constant speed, each gap is larger than at rest by the speed multiplied by
        this time.
        """
        return self.damping_n_s_m / self.stiffness_n_m


def robot_chain(scenario: Scenario) -> RobotChain:
    """Computes frequency responses of lines of robots that follow one another.

    All robots are like the scenario's robot. Each robot's target is a fixed distance
    behind the robot ahead. With feed-forward, the target has the velocity of the robot
    ahead; without, it has the velocity 0. The object sensor measures the position of
    the robot ahead. The velocity of the robot ahead is computed from the last two
    measured positions. The function raises an InputError if the law is not for a route,
    or if the wheels can slip.
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
    """Computes two distances between neighboring robots, m: without and with contacts.

    The distances are between the control points P. Other robots observe a moving robot
    as the disc that encloses it. The distance from P to the disc of the robot ahead is
    1.25 times the radius S of the security zone for the first result, and S/2 for the
    second.
    """
    zone_m = route_law(scenario).security_zone_m
    offset = disc_offsets(scenario)[0]
    return _APART * zone_m + offset, 0.5 * zone_m + offset


def disc_offsets(scenario: Scenario) -> tuple[float, float]:
    """Computes how much nearer a neighbor's disc is than its control point P, m.

    Other robots observe a moving robot as the disc that encloses it. The disc has its
    center at the axle, and P is ahead of the axle. Each result is the distance between
    the points P of two neighbors, minus the distance from one of these points to the
    disc of the other robot. In the first result, the other robot is ahead. In the
    second, it is behind.
    """
    disc = 0.5 * math.hypot(scenario.only.robot.length_m, scenario.only.robot.width_m)
    epsilon = scenario.only.robot.control_point_m
    return disc + epsilon, disc - epsilon


def _late(scenario: Scenario) -> int:
    return round(scenario.router.objects.latency_s / scenario.tick_s)


def resting_gaps(
    scenario: Scenario, spacing_m: float, robots: int
) -> NDArray[np.float64]:
    """Computes the distances between the control points P of a chain at rest, m.

    The result has the shape (robots - 1,). Its first distance is between the first and
    the second robot. ``spacing_m`` is the desired distance. Contacts push the robots
    apart. The computation starts at the last robot, which has a contact only with the
    robot ahead.
    """
    own = route_law(scenario)
    k, k_e, zone_m = own.stiffness_n_m, own.contact_stiffness_n_m, own.security_zone_m
    ahead, behind = disc_offsets(scenario)
    # A contact with the robot ahead at the distance d exerts the force k_e (d - S)
    # along the line. S is the radius of the security zone.
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
    """Computes the springs and dampers of each robot of a chain, except the first.

    They are those of small motions about the chain at rest. If the disc of a neighbor
    is outside the security zone, its contact has no stiffness and no damping.
    ``feed_forward`` and ``spacing_m`` are those of ``ChainPeak``.
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
    """Computes the frequency response from the first robot to the robots behind it.

    The input is the position of the first robot. The outputs are the positions of the
    other robots, one for each of ``links``. Each of these robots obeys this law, plus
    the forces of its contacts::

        M a = -K (p - p') - D (v - c v')

    p and v are the deviations of the robot's position and velocity from the formation.
    p' and v' are the observed deviations of the robot ahead, and c is the feed-forward.
    Wheel command and plant give p = G_p a and v = G_v a. ``omega`` are (n,)
    frequencies, rad/s. The result has the shape (n, len(links)).
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
        # Contacts use the neighbor's delayed position, and the present position of P.
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
    """Computes how much chains of 2 to 8 robots amplify their first robot's motion.

    The frequencies range from 0.01 rad/s to the Nyquist frequency. ``feed_forward`` is
    the velocity of a robot's target divided by the velocity of the robot ahead.
    ``spacing_m`` is the desired distance between the control points P of neighbors, m.
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
    """Returns frequencies that resolve the peaks of lightly damped modes, rad/s."""
    model = chain_model(scenario, links)
    return frequency_grid(model.poles, model.period_s, lowest=_LOWEST, points=_POINTS)


def _peak(
    scenario: Scenario, links: Sequence[ChainLinks], robot: int = -1
) -> tuple[float, float]:
    """Returns the largest amplification of one robot, and its frequency, rad/s.

    ``robot`` is an index into ``links``.
    """
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


def chain_model(scenario: Scenario, links: Sequence[ChainLinks]) -> LinearModel:
    """Returns the sampled model of the robots behind a first robot at rest.

    The model has no inputs. The outputs are the positions of the robots, m. Each robot
    has the three states of ``sampled_matrix`` (position, wheel speed, and velocity of
    the virtual mass), and then the earlier positions that its neighbors observe.
    """
    tick_s, mass = scenario.tick_s, scenario.only.robot.mass_kg
    of = SampledMass(mass, scenario.only.plant.motor_lag_s, tick_s)
    free = sampled_matrix(0.0, 0.0, of)
    late = links[0].late_ticks
    size = 3 + late + 1
    # A force changes the velocity v of the virtual mass. This change also acts on the
    # wheel speed w and on the position p in the same period.
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
    return LinearModel(
        name="chain of robots",
        A=matrix,
        B=np.zeros((len(matrix), 0)),
        C=np.eye(len(matrix))[::size],
        D=np.zeros((len(links), 0)),
        state_names=tuple(f"chain_{k}" for k in range(len(matrix))),
        input_names=(),
        output_names=tuple(f"p_{i + 2}" for i in range(len(links))),
        period_s=tick_s,
    )


def _stable_peak(
    scenario: Scenario, links: Sequence[ChainLinks], robot: int = -1
) -> float:
    """Returns the amplification of ``_peak``, or infinity for an unstable chain."""
    if not chain_model(scenario, links).stable:
        return math.inf
    return _peak(scenario, links, robot)[0]


def least_damping(scenario: Scenario, links: Sequence[ChainLinks]) -> float:
    """Computes the least damping D with which no motion is amplified, N s/m.

    With this D, no robot oscillates more than the first robot at any frequency. D
    replaces the damping of all ``links``. If no D up to 60 N s/m suffices, the result
    is infinite.
    """

    def calm(damping: float) -> bool:
        damped = [link._replace(damping=damping) for link in links]
        if not chain_model(scenario, damped).stable:
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
    """Computes the largest feed-forward with which a robot does not amplify motions.

    Feed-forward is the velocity of the robot's target divided by the velocity of the
    robot ahead. The robot has no contacts. ``stiffness`` is K to the target, N/m, and
    ``damping`` is D to the target, N s/m. The result is from 0 to 1, by bisection. If
    the robot amplifies motions even without feed-forward, the result is -1.
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
