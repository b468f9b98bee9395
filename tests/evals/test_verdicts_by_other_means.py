"""Every verdict of the stability report by other means than the report's own.

Hand-made polynomials and potentials, responses of unreduced models, and runs.
``tests/analysis/stability/test_criteria.py`` says which number a criterion reads;
here the numbers themselves are found again.
"""

from __future__ import annotations

import heapq
import itertools
import math
from types import SimpleNamespace as Made

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.optimize import brentq

from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import certify_energy
from analysis.loops import linearization
from analysis.loops.burst_cycle import burst_cycle
from analysis.loops.delay_margin import DELAY_PLACES, delay_margin
from analysis.loops.equilibria import find_equilibria
from analysis.loops.open_loops import closed, cut_model
from analysis.loops.robustness import (
    contact_poles,
    contact_uncertainty,
    following_poles,
    following_uncertainty,
    pole_cloud,
)
from analysis.stability.law_analysis import Study, analyze_law
from analysis.stability.linear_parts import count_jams
from analysis.stability.report_parts import SOUND_PARTS
from analysis.stability.robustness_parts import LoopRobustness
from analysis.stability.sampling_parts import SampledLoop, contact_growth
from diagrams import load_scenario

T = 0.025
LAWS = ("conventional", "active", "active2017")
PARTS = ("equilibria", "linear_models", "small_step", "margins", "energy_balance")


@pytest.fixture(scope="module")
def studies():
    """Of each law, the parts of the report that take little time."""
    wanted = [part for part in SOUND_PARTS if part.key in PARTS]
    found = {}
    for law in LAWS:
        scenario = load_scenario("default", [f"law={law}"])
        analysis = analyze_law(scenario, wanted)
        found[law] = Study(scenario, found=analysis.found)
    return found


def read(name, data):
    """The number that the criterion of this name reads from the data of its part."""
    (criterion,) = (
        each for part in SOUND_PARTS for each in part.criteria if each.name == name
    )
    return criterion.read(data)


def push(scenario, c, s=0.0):
    """f(c, s) in N, from docs/results_laws.md."""
    gains = scenario.follower.laws
    if scenario.only.law == "conventional":
        own = gains.conventional
        near = c < own.reach_m
        spring = own.stiffness_n_m * (own.reach_m - c) + own.damping_n_s_m * s
        return np.where(near, spring, 0.0)
    if scenario.only.law == "active":
        own = gains.active
        alpha = own.reach_m / (
            2.0 * math.log(own.reference_stiffness_n_m / own.matched_stiffness_n_m)
        )
        mu = own.speed_limit_m_s
        beta = mu / (
            2.0 * math.log(own.matched_damping_n_s_m / own.reference_damping_n_s_m)
        )
        slow = own.reference_damping_n_s_m * np.exp(s / beta) * np.maximum(mu - s, 0.0)
        return own.reference_stiffness_n_m * c * np.exp(-c / alpha) + slow
    own = gains.active2017
    speed = np.minimum(s, own.saturation_speed_m_s)
    far = np.maximum(c, own.saturation_distance_m)
    return own.distance_gain_j / far + own.damping_n_s_m * speed


def motion(scenario, share=1.0):
    """Polynomials in z: what acceleration does to v and p, over one denominator.

    v+ = v + T a, w+ = e w + (1 - e) v+, p+ = p + share (b w + (T - b) v+) with the
    motor's e = exp(-T/lag) and b = lag (1 - e).
    """
    lag = scenario.only.plant.motor_lag_s
    e = math.exp(-T / lag)
    b, z = lag * (1.0 - e), np.poly1d([1.0, 0.0])
    moved = share * T * z * ((T - b) * (z - e) + b * (1.0 - e))
    return T * (z - 1.0) * (z - e), moved, (z - 1.0) ** 2 * (z - e)


def growth_with(scenario, stiffness, *, ticks=0, share=1.0, values=None):
    """ln|z|/T of a mass between springs that act ``ticks`` late."""
    robot, attraction = scenario.only.robot, scenario.follower.attraction
    mass, damping = values or (robot.mass_kg, attraction.damping_n_s_m)
    v, p, whole = motion(scenario, share)
    late = np.poly1d([1.0] + [0.0] * ticks)
    z = ((whole + damping / mass * v) * late + stiffness / mass * p).roots
    return math.log(np.abs(z).max()) / T


@pytest.mark.parametrize("law", ["conventional", "active"])
def test_growth_at_rest_is_that_of_simulated_steps(studies, law):
    """Central differences of simulated ticks, each state in turn, no AutoDiff."""
    at = studies[law].found["equilibria"].at
    loop, h = at.loop, 1e-6
    matrix = np.zeros((len(at.state), len(at.state)))
    for k, name in enumerate(loop.state_names):
        # Covariances of exact hearing are zero, and cannot be stepped down.
        if linearization._can_step(name):
            sides = []
            for sign in (1.0, -1.0):
                moved = at.state.copy()
                moved[k] += sign * h
                sides.append(loop.period_map(moved, at.time_s))
            matrix[:, k] = (sides[0] - sides[1]) / (2.0 * h)
    z = np.linalg.eigvals(matrix)
    z = z[np.abs(z - 1.0) > 1e-3]  # the heading, wheel angles and odometry are free
    growth = math.log(np.abs(z).max()) / T
    assert read("growth at rest", studies[law].found["equilibria"]) == pytest.approx(
        growth, abs=1e-3
    )


def extremes(time, x):
    """Times and values of the turning points, by parabolas through three samples."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    left, middle, right = x[turns - 1], x[turns], x[turns + 1]
    part = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return time[turns] + part * T, middle - 0.25 * (left - right) * part


@pytest.mark.parametrize(("law", "share"), [("conventional", 0.005), ("active", 0.03)])
def test_damping_and_prediction_are_those_of_a_simulated_step(studies, law, share):
    """The decrement of turning points; |dC/dt| leaves the active law's 1 % off."""
    study = studies[law]
    step = study.found["small_step"]
    later = step.time_s > 2.0
    times, values = extremes(step.time_s[later], step.ideal_m[later])
    swings = np.abs(np.diff(values))
    decrement = np.log(swings[:-1] / swings[1:]).mean()
    ratio = decrement / math.hypot(math.pi, decrement)
    found = read("damping ratio at rest", study.found["equilibria"])
    assert found == pytest.approx(ratio, rel=share)
    natural = math.pi / np.diff(times).mean() / math.sqrt(1.0 - ratio**2)
    off = 100.0 * max(
        abs(step.predicted.frequency_rad_s / natural - 1.0),
        abs(step.predicted.damping_ratio / ratio - 1.0),
    )
    found = read("error of the linear prediction of a small step", step)
    assert found == pytest.approx(off, abs=100.0 * share)


@pytest.mark.parametrize("law", LAWS)
def test_offset_is_where_the_forces_balance(studies, law):
    """K_r (r - d_f) = f(r - half the source's length, 0), by bisection."""
    scenario = studies[law].scenario
    attraction, half = scenario.follower.attraction, 0.5 * scenario.source.length_m

    def left(r):
        pull = attraction.stiffness_n_m * (r - attraction.follow_distance_m)
        return float(push(scenario, r - half)) - pull

    rest = brentq(left, attraction.follow_distance_m - 1e-3, 3.0, xtol=1e-12)
    expected = rest - attraction.follow_distance_m
    found = studies[law].found["equilibria"]
    offset = read("offset from the follow point at rest", found)
    assert offset == pytest.approx(expected, abs=1e-6)


def largest_stable(polynomial, change, most):
    """x at which a root of polynomial(change(x)) leaves the unit circle; or none."""

    def excess(x):
        return np.abs(polynomial(change(x)).roots).max() - 1.0

    tried = np.linspace(1e-6, most, 400)
    high = next((x for x in tried if excess(x) > 1e-10), None)
    return high and brentq(excess, high - (tried[1] - tried[0]), high, xtol=1e-10)


def test_margins_of_the_conventional_law_are_those_of_polynomials(studies):
    """No push about rest: the attraction's difference equation, cut by hand."""
    study = studies["conventional"]
    scenario = study.scenario
    mass = scenario.only.robot.mass_kg
    K, D = (
        scenario.follower.attraction.stiffness_n_m / mass,
        scenario.follower.attraction.damping_n_s_m / mass,
    )
    v, p, whole = motion(scenario)
    # Numerator and denominator of L at the sensor and at the actuator.
    loops = [(K * p, whole + D * v), (K * p + D * v, whole)]
    gains, turns, peaks, disks = [], [], [], []
    z = np.exp(1j * T * np.geomspace(1e-2, math.pi / T, 20_000))
    for top, bottom in loops:
        for sign in (1.0, -1.0):
            x = largest_stable(
                lambda k, top=top, bottom=bottom: bottom + k * top,
                lambda x, sign=sign: math.exp(sign * x),
                6.0,
            )
            gains += [] if x is None else [20.0 / math.log(10.0) * x]
        turn = largest_stable(
            lambda k, top=top, bottom=bottom: bottom + k * top,
            lambda x: np.exp(-1j * x),
            math.pi,
        )
        turns.append(math.degrees(turn))
        S = bottom(z) / (bottom(z) + top(z))
        peaks.append(np.abs(S).max())
        disks.append(1.0 / np.abs(S - 0.5).max())
    expected = {
        "least gain margin": (min(gains), 0.1),
        "least phase margin": (min(turns), 0.01),
        "largest sensitivity peak": (max(peaks), 0.01),
        "least disk margin": (min(disks), 1e-3),
    }
    for name, (value, off) in expected.items():
        assert read(name, study.found["margins"]) == pytest.approx(value, abs=off), name


@pytest.mark.parametrize("law", ["active", "active2017"])
def test_margins_of_active_laws_are_those_of_unreduced_models(studies, law):
    """The response of all 72 states on a fixed grid, every cut and direction.

    The gain margin is closed: bearings that shrink, to r/(r + epsilon).
    """
    study = studies[law]
    at = study.found["equilibria"].at
    omega = np.geomspace(0.15, 3.0, 250)
    phases, peaks, disks = [], [], []
    for place in ("sensor", "actuator", "wheels"):
        whole = cut_model(at, place)
        for own, other in itertools.permutations(whole.input_names):
            one = closed(whole, (other,)).part([own], [own])
            L = np.array(
                [
                    -(one.C @ np.linalg.solve(z * np.eye(len(one.A)) - one.A, one.B))
                    - one.D
                    for z in np.exp(1j * omega * T)
                ]
            )[:, 0, 0]
            size = np.log(np.abs(L))
            for k in np.flatnonzero(size[:-1] * size[1:] < 0.0):
                part = size[k] / (size[k] - size[k + 1])
                phases.append(abs(np.angle(-L[k] - part * (L[k + 1] - L[k]))))
            peaks.append(np.abs(1.0 / (1.0 + L)).max())
            disks.append(1.0 / np.abs(1.0 / (1.0 + L) - 0.5).max())
    epsilon, r = study.scenario.only.robot.control_point_m, at.source_distance_m
    expected = {
        "least gain margin": 20.0 * math.log10((r + epsilon) / r),
        "least phase margin": math.degrees(min(phases)),
        "largest sensitivity peak": max(peaks),
        "least disk margin": min(disks),
    }
    for name, value in expected.items():
        assert read(name, study.found["margins"]) == pytest.approx(value, rel=5e-3), (
            name
        )


def radius_with_delay(model, ticks):
    """Largest |z| with the cut wire closed again, whole ticks late; neutral apart."""
    count = len(model.A)
    assert not model.D.any()
    A = np.zeros((count + ticks, count + ticks))
    A[:count, :count] = model.A
    if ticks:
        A[:count, -1:] = model.B
        A[count, :count] = model.C[0]
        A[count + 1 :, count:-1] = np.eye(ticks - 1)
    else:
        A = A + model.B @ model.C
    z = np.linalg.eigvals(A)
    return np.abs(z[np.abs(z - 1.0) > 1e-4]).max()


@pytest.mark.parametrize("law", ["conventional", "active2017"])
def test_delay_margin_lies_between_two_whole_ticks(studies, law):
    """A wire that is longer by whole ticks, in the unreduced model.

    ``test_delay_margin_simulated`` runs the diagram below and above.
    """
    study = studies[law]
    at = study.found["equilibria"].at
    existing = {(m.at, m.direction) for m in study.found["margins"].implemented}
    exact, whole = [], []
    for place in DELAY_PLACES:
        cut = cut_model(at, place)
        for direction in ("along", "across"):
            if (place, direction) not in existing:
                continue
            exact.append(delay_margin(at, place, direction))
            own = f"{place}_{direction}"
            (other,) = set(cut.input_names) - {own}
            one = closed(cut, (other,)).part([own], [own])
            ticks = range(40)
            late = (n for n in ticks if radius_with_delay(one, n) > 1.0)
            whole.append(next(late, math.inf))
    sampled = SampledLoop(T, np.array([]), tuple(exact), None)
    found = read("least delay margin", sampled)
    assert T * (min(whole) - 1) <= found < T * min(whole)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("ticks", [0, 1])
def test_contact_growth_is_a_root_of_a_polynomial(law, ticks):
    """K_0; k_ref/e^2, at 2 alpha; K_0/rho_1^2: on an echo some ticks old."""
    scenario = load_scenario("default", [f"law={law}"])
    own = getattr(scenario.follower.laws, law)
    steepest = {
        "conventional": lambda: own.stiffness_n_m,
        "active": lambda: own.reference_stiffness_n_m / math.e**2,
        "active2017": lambda: own.distance_gain_j / own.saturation_distance_m**2,
    }[law]()
    total = scenario.follower.attraction.stiffness_n_m + steepest
    growth = growth_with(scenario, total, ticks=ticks)
    # The table of the law has steps of 0.2 mm.
    assert contact_growth(scenario, ticks) == pytest.approx(growth, abs=5e-3)


def test_burst_cycle_forgets_the_silence(studies):
    """A target that goes on in W closes the loop by odometry: 2 s of the same decay.

    ``test_burst_cycle`` has a model on a line and simulated cycles for other holds.
    """
    study = studies["conventional"]
    scenario, at = study.scenario, study.found["equilibria"].at
    hold = scenario.follower.tracker.hold
    assert hold == "motion"
    cycles = Made(today=hold, cycles=[burst_cycle(scenario, hold, point=at)])
    left = math.exp(
        2.0 * growth_with(scenario, scenario.follower.attraction.stiffness_n_m)
    )
    found = read("deviation remaining after a burst cycle", cycles)
    assert found == pytest.approx(left, abs=1e-3)


def corners(parameters):
    names = [p.name for p in parameters]
    for ends in itertools.product(*((p.low, p.high) for p in parameters)):
        yield dict(zip(names, ends, strict=True))


@pytest.mark.parametrize("contact", [False, True])
def test_worst_cases_are_those_of_all_corners(studies, contact):
    """All corners of the box by the polynomial, the conventional law."""
    study = studies["conventional"]
    scenario = study.scenario
    if contact:
        poles, box = contact_poles(scenario), contact_uncertainty(scenario)
    else:
        poles = following_poles(study.found["equilibria"].at)
        box = following_uncertainty(scenario)
    cloud = pole_cloud(poles, box, period=T, samples=1, seed=1)
    found = []
    for values in corners(box):
        lag_s = values["plant.motor_lag_s"]
        plant = scenario.only.plant.model_copy(update={"motor_lag_s": lag_s})
        other = scenario.with_robot(plant=plant)
        stiffness = values["attraction.stiffness_n_m"]
        # A range that is read with the wrong speed of sound.
        speed = values.get("sound_speed_m_s")
        stiffness *= 1.0 if speed is None else stretch(scenario, speed)
        found.append(
            growth_with(
                other,
                stiffness + values.get("law_stiffness_n_m", 0.0),
                ticks=round(values.get("extra_ticks", 0.0)),
                share=values["wheel_radius_share"],
                values=(values["robot.mass_kg"], values["attraction.damping_n_s_m"]),
            )
        )
    without_bound = LoopRobustness(cloud, (), "a test")
    worst = read("growth at rest, worst parameters", without_bound)
    assert worst == pytest.approx(max(found), abs=3e-3)


def stretch(scenario, true_speed):
    """Slope of the range that two delays give, by differences of the geometry.

    A source on the row's axis of symmetry: the outer microphones hear it later by
    (h - R)/c_true, which is read with c.
    """
    half = max(abs(y) for _, y in scenario.only.robot.microphones_m)
    k = scenario.sound_speed_m_s / true_speed

    def read(R):
        path = k * (math.hypot(R, half) - R)
        return (half**2 - path**2) / (2.0 * path)

    d = scenario.follower.attraction.follow_distance_m
    return (read(d + 1e-4) - read(d - 1e-4)) / 2e-4


@pytest.mark.parametrize("law", LAWS)
def test_power_of_the_velocity_term_by_search(studies, law):
    """Largest |f(c, s) - f(c, 0)|/s over distances and speeds, by D_r."""
    scenario = studies[law].scenario
    c, s = np.meshgrid(np.linspace(0.01, 3.0, 300), np.linspace(0.004, 1.4, 700))
    slopes = (push(scenario, c, s) - push(scenario, c, 0.0)) / s
    expected = np.abs(slopes).max() / scenario.follower.attraction.damping_n_s_m
    found = studies[law].found["energy_balance"]
    share = read("largest power of the velocity term", found)
    assert share == pytest.approx(expected, rel=3e-3)


def bodies(scenario):
    """(n, 4) x and y of center, half extents in x and y; none stands askew."""
    found = []
    for x, y, theta, length, width, _ in (
        body.rectangles(0.0)[0] for body in scenario.bodies().values()
    ):
        assert abs(math.sin(2.0 * theta)) < 1e-9
        turned = abs(math.sin(theta)) > 0.5
        sizes = (width, length) if turned else (length, width)
        found.append((x, y, 0.5 * sizes[0], 0.5 * sizes[1]))
    return np.array(found)


def gaps(scenario, points):
    """(n, bodies, 2) from the nearest point of each body."""
    rectangles = bodies(scenario)
    delta = points[:, None] - rectangles[:, :2]
    return delta - np.clip(delta, -rectangles[:, 2:], rectangles[:, 2:])


def away(scenario, points):
    """Distance of the nearest body and the direction away from it, (n,), (n, 2)."""
    gap = gaps(scenario, points)
    size = np.linalg.norm(gap, axis=2)
    nearest = size.argmin(axis=1)
    rows = np.arange(len(points))
    c = size[rows, nearest]
    return c, gap[rows, nearest] / np.maximum(c, 1e-12)[:, None]


def fly(scenario, states, duration_s, h=0.01):
    """Ends and least distances of a point mass under the law, semi-implicit steps."""
    attraction, robot = scenario.follower.attraction, scenario.only.robot
    source = bodies(scenario)[-1, :2]
    p, v = states[:, :2].copy(), states[:, 2:].copy()
    closest = away(scenario, p)[0]
    for _ in range(round(duration_s / h)):
        c, u = away(scenario, p)
        e = p - source
        r = np.linalg.norm(e, axis=1)[:, None]
        speed = np.abs(np.sum(u * v, axis=1))  # about a flat face and past a corner
        out = np.where(c < 3.0, push(scenario, c, speed), 0.0)
        force = -attraction.stiffness_n_m * (1.0 - attraction.follow_distance_m / r) * e
        v = v + h / robot.mass_kg * (
            force - attraction.damping_n_s_m * v + out[:, None] * u
        )
        fast = np.linalg.norm(v, axis=1)[:, None]
        v *= np.minimum(1.0, robot.top_speed_m_s / np.maximum(fast, 1e-12))
        p = p + h * v
        closest = np.minimum(closest, away(scenario, p)[0])
    return np.column_stack([p, v]), closest


def test_places_to_jam_are_where_runs_end():
    """A wall of 1 m across the way: runs from all over the floor end at the sinks."""
    wall = "obstacles=[{name: wall, size_m: [0.1, 1.0], waypoints_m: [[2.0, 0.0]]}]"
    scenario = load_scenario(
        "two_static_obstacles", ["law=conventional", wall, "source.waypoints_m=[[5,0]]"]
    )
    search = find_equilibria(scenario)
    jams = count_jams(scenario, search)
    starts = np.zeros((60, 4))
    starts[:, :2] = np.random.default_rng(3).uniform((0.0, -1.5), (1.5, 1.5), (60, 2))
    ends, _ = fly(scenario, starts, 80.0, h=0.02)
    rest = ends[np.linalg.norm(ends[:, 2:], axis=1) < 1e-3]
    behind = np.linalg.norm(rest[:, :2] - bodies(scenario)[-1, :2], axis=1)
    far = rest[
        behind
        > scenario.follower.attraction.follow_distance_m + scenario.stop.goal_margin_m
    ]
    assert jams == len(np.unique(np.round(far[:, :2], 1), axis=0)) == 1
    assert len(far) < len(ends)


def potential(scenario, points, c):
    """K_r (r - d_f)^2/2 + K_0 (rho_0 - c)^2/2, J: the conventional law's."""
    own, attraction = scenario.follower.laws.conventional, scenario.follower.attraction
    r = np.linalg.norm(points - bodies(scenario)[-1, :2], axis=1)
    spring = 0.5 * own.stiffness_n_m * np.maximum(own.reach_m - c, 0.0) ** 2
    pull = 0.5 * attraction.stiffness_n_m * (r - attraction.follow_distance_m) ** 2
    return pull + spring


def levels(W, touch):
    """Lowest level over which each place reaches a touch: largest instead of sum."""
    level = np.where(touch, W, np.inf)
    heap = [(level[a, b], a, b) for a, b in zip(*np.nonzero(touch), strict=True)]
    heapq.heapify(heap)
    while heap:
        height, a, b = heapq.heappop(heap)
        for m, n in itertools.product((a - 1, a, a + 1), (b - 1, b, b + 1)):
            inside = 0 <= m < W.shape[0] and 0 <= n < W.shape[1]
            if inside and max(height, W[m, n]) < level[m, n]:
                level[m, n] = max(height, W[m, n])
                heapq.heappush(heap, (level[m, n], m, n))
    return level


def flooded(scenario, h=0.05):
    """Whether energy or the top speed keeps the start from each body: own grid."""
    start = np.array(scenario.only.start.position_m)
    start[0] += scenario.only.robot.control_point_m
    x, y = np.arange(-1.5, 6.5, h) + start[0], np.arange(-2.5, 2.5, h)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    distances = np.linalg.norm(gaps(scenario, points), axis=2)
    energy = potential(scenario, points, distances.min(axis=1)).reshape(len(x), len(y))
    i, j = np.abs(x - start[0]).argmin(), np.abs(y - start[1]).argmin()
    top = 0.5 * scenario.only.robot.mass_kg * scenario.only.robot.top_speed_m_s**2
    for distance in distances.T:
        touch = (
            distance.reshape(energy.shape)
            <= scenario.follower.ultrasonic.minimum_range_m + h / 2
        )
        slow, _ = label(energy <= energy[i, j], np.ones((3, 3)))
        fast, _ = label(levels(energy, touch) - energy <= top, np.ones((3, 3)))
        # Energy, or else the top speed: a place off all islands is label 0.
        if slow[i, j] in slow[touch] and fast[i, j] in set(fast[touch]) - {0}:
            return False
    return True


@pytest.mark.parametrize("spring_n_m", [0.01, 4.0, 20.0, 1000.0])
def test_certified_starts_are_those_of_an_own_flood(spring_n_m):
    """Points of a grid where the certificate takes bounds over cells."""
    scenario = load_scenario(
        "two_static_obstacles",
        [
            "law=conventional",
            f"laws.conventional.stiffness_n_m={spring_n_m}",
            "laws.conventional.damping_n_s_m=0.001",
        ],
    )
    certified = Made(certificate=certify_energy(scenario, cell_m=0.03))
    start = read("start certified", certified)
    assert start == float(flooded(scenario)) == float(spring_n_m > 10.0)


def test_collisions_from_certified_starts_by_an_own_integration():
    """None of the certified starts, and the same of the others as the trials say."""
    scenario = load_scenario("two_static_obstacles", ["law=conventional", "seed=5"])
    certificate = certify_energy(scenario, cell_m=0.03)
    trials = try_certificate(certificate, starts=80, duration_s=15.0)
    _, closest = fly(scenario, trials.inside.starts, 15.0)
    touched = np.count_nonzero(closest <= certificate.contact_m)
    found = read("collisions from certified starts", Made(trials=trials))
    assert found == touched == 0
    _, closest = fly(scenario, trials.outside.starts, 15.0)
    hit = closest <= certificate.contact_m
    clear = np.abs(closest - certificate.contact_m) > 0.02
    np.testing.assert_array_equal(hit[clear], trials.outside.collided[clear])


def test_difference_of_two_routes_shows_an_error_in_one(studies, monkeypatch):
    """Rounding; and an error of 1e-6 put into one route is what the verdict reads."""
    study = studies["conventional"]
    name = "difference between two computations of the model"
    assert read(name, study.found["linear_models"]) < 1e-12
    true = linearization.blockwise_model

    def wrong(point):
        model = true(point)
        model.A[3, 2] += 1e-6
        return model

    monkeypatch.setattr(linearization, "blockwise_model", wrong)
    routes = linearization.compare_routes(study.found["equilibria"].at)
    assert read(name, Made(routes=routes)) == pytest.approx(1e-6, rel=1e-3)
