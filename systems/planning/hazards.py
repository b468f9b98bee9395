"""Bodies that move: a track each, of particles that fit what range sensors have read.

A range sensor tells how far, not where in its aperture. What it reads of a body over
time, from other places and at the apertures' edges, leaves few of the places and
velocities that were possible at first.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.turning import wrapped
from systems.safety.free_space import FIRST_I, FIRST_J, ROLLED, FreeSpace

#: Tracks, particles of each, and how many of these are looked at to choose a motion.
_TRACKS, _PARTICLES, _PICKED = 8, 200, 25
#: Places in a particle: m, m/s, and its share of the track.
X, Y, VX, VY, WEIGHT = range(5)
#: Places in a picked particle besides: of its track, for how long it was not seen, s,
#: and by how much its velocity is not known, m/s.
AGE_S, SPREAD = 5, 6
#: Places in a track: probability that the body is there, and when it was last seen, s.
EXISTS, SEEN_S = range(2)
#: Places in the memory: state of the random numbers, and when a body was last found.
RANDOM, MOVED_S = range(2)
#: Places in a look: range, m, whether there was an echo, time, s, and where from:
#: place, m, and direction, rad.
R, HEARD, TIME, SX, SY, AXIS = range(6)
#: Looks of each sensor that are kept.
_LOOKS = 3

#: A particle is in a body, so far behind the surface that echoes, m.
_BEYOND_M = 0.02
#: A range that is farther off than this is not that of the particle, m.
_GATE_M = 0.10
#: Half of a body may reach so far into an aperture, m.
_EDGE_M = 0.04
#: What a look leaves of a particle that should have been seen and was not, and of one
#: that did not echo where its track did.
_UNSEEN, _ELSEWHERE = 0.1, 0.5
#: Standard deviation of a particle's range when its velocity is right, m, besides the
#: sensor's, and what a wrong range leaves of it at least.
_FIT_M, _LEAST_FIT = 0.01, 0.5
#: Share of an error of the range that goes to the velocity, each tick.
_TO_VELOCITY = 0.1
#: Standard deviation of the first rate of a range, m/s: as a body comes into an
#: aperture, its nearest visible point jumps from one corner to another.
_RATE_M_S = 0.2
#: Particles that are drawn anew differ by this share of their spread, and by so much
#: at least, m/s, and in place, m.
_JITTER, _JITTER_M_S, _JITTER_M = 0.5, 0.01, 0.005
#: Share of bodies that stop, each second.
_STOPS_HZ = 0.04
#: Less of a track than this is none, and of its particles near an echo, no reason.
_LEAST_EXISTS, _LEAST_SHARE = 0.03, 0.03
#: No body is certain, and of the doubt an echo takes away a share.
_CERTAIN, _SEEN_AGAIN = 0.98, 0.2
#: A track that was not seen for so long, s, or is so far off, m, is forgotten.
_FORGET_S, _FAR_M = 12.0, 5.0
#: Of an arc, and behind it, places at this distance are looked at, cells, and so far
#: behind it, cells.
_ARC_STEP, _BEHIND = 0.3, 0.6
#: A body that is so likely, and was seen so lately, s, is where its track says; its
#: echoes come from within this, m.
_LIKELY, _LATELY_S, _BODY_M = 0.3, 3.0, 0.5
#: How often a place is drawn that was not visible before.
_TRIES = 12
#: A range that changes faster is that of another body, m/s; one older than so many
#: ticks is not compared with.
_FASTEST_M_S, _OLDEST_TICKS = 2.0, 4.5


class HazardSensors(NamedTuple):
    """What the tracks need to know of the sensors and the bodies."""

    places: NDArray[np.float64]
    """(sensors, 2) from the axle in B, m."""
    directions: NDArray[np.float64]
    """(sensors, 2) axis in B and half of the aperture, rad."""
    farthest_m: float
    """Greatest range, m."""
    margin_m: float
    """What ranges may be off, m."""
    noise_m: float
    """Standard deviation of a range, m."""
    top_speed_m_s: float
    """Of bodies, m/s."""
    tick_s: float


class Hazards(NamedTuple):
    """What moves, as far as it is known. All arrays change."""

    tracks: NDArray[np.float64]
    """(tracks, 2) ``EXISTS`` and ``SEEN_S``."""
    particles: NDArray[np.float64]
    """(tracks, particles, 5) of each track; weights add up to 1."""
    looks: NDArray[np.float64]
    """(3, sensors, 6) the last looks of each sensor, the newest first."""
    memory: NDArray[np.float64]
    """(1, 2) ``RANDOM`` and ``MOVED_S``."""
    picked: NDArray[np.float64]
    """(n, 7) particles that stand for all, from ``pick_hazards``; their weights are
    numbers of bodies."""


def make_hazards(sensors: int) -> Hazards:
    """Nothing that moves.

    Args:
        sensors: Number of range sensors.

    Returns:
        No tracks.
    """
    memory = np.array([[1.0, -np.inf]])
    looks = np.zeros((_LOOKS, sensors, 6))
    looks[:, :, TIME] = -np.inf
    return Hazards(
        np.zeros((_TRACKS, 2)),
        np.zeros((_TRACKS, _PARTICLES, 5)),
        looks,
        memory,
        np.zeros((_TRACKS * _PICKED, 7)),
    )


@njit(cache=True)
def track_hazards(
    hazards: Hazards,
    time: float,
    pose: Any,
    readings: Any,
    space: FreeSpace,
    target: Any,
    sensors: HazardSensors,
) -> None:  # pragma: no cover  (compiled)
    """Moves the tracks on by a tick, and weighs them by what the sensors read.

    An echo that no track explains begins one if it came from floor that was seen free
    all along its arc: what rests is never there. Particles of a new track are drawn
    along the arc, where the body was not visible a look before, with the rate of the
    range and any speed across up to the top speed.

    Args:
        hazards: Changed.
        time: s.
        pose: (x, y, theta) of the robot, m and rad.
        readings: Ranges, m, echoes, 0 or 1, and for how long each was held, s.
        space: What was seen free.
        target: (x, y, radius) of what is followed, m: it explains its own echoes.
        sensors: The sensors.
    """
    ages, tick_s = readings[2], sensors.tick_s
    _move_on(hazards, tick_s)
    _remember_looks(hazards, time, pose, readings, sensors)
    for k in range(len(ages)):
        if ages[k] > 0.5 * tick_s:
            continue
        look, half = hazards.looks[0, k], sensors.directions[k, 1]
        unknown = look[HEARD] > 0.5 and not _is_target(look, half, target)
        best = _best_track(hazards, look, half) if unknown else -1
        for t in range(len(hazards.tracks)):
            if hazards.tracks[t, EXISTS] > 0.0:
                _weigh(hazards, t, k, best, sensors)
        if best >= 0:
            hazards.tracks[best, SEEN_S] = time
            doubt = _CERTAIN - hazards.tracks[best, EXISTS]
            hazards.tracks[best, EXISTS] += _SEEN_AGAIN * doubt
        elif (
            unknown
            and _goes_on(hazards, k, time, sensors)
            and _came_from_free(space, look, half, sensors.margin_m)
        ):
            _begin(hazards, k, time, sensors)
    _forget(hazards, time, pose)


@njit(cache=True)
def _move_on(hazards: Hazards, tick_s: float) -> None:  # pragma: no cover  (compiled)
    for t in range(len(hazards.tracks)):
        if hazards.tracks[t, EXISTS] > 0.0:
            p = hazards.particles[t]
            for n in range(len(p)):
                p[n, X] += tick_s * p[n, VX]
                p[n, Y] += tick_s * p[n, VY]
            # Now and then a particle stops, as bodies do.
            if _chance(hazards.memory) < _STOPS_HZ * tick_s * len(p):
                n = int(_chance(hazards.memory) * len(p))
                p[n, VX], p[n, VY] = 0.0, 0.0


@njit(cache=True)
def _best_track(
    hazards: Hazards, look: Any, half: float
) -> int:  # pragma: no cover  (compiled)
    """The track that explains an echo best; -1: none does."""
    best, most = -1, _LEAST_SHARE
    for t in range(len(hazards.tracks)):
        exists = hazards.tracks[t, EXISTS]
        if exists > 0.0:
            share = exists * _share_at(hazards.particles[t], look, half)
            if share > most:
                best, most = t, share
    return best


@njit(cache=True)
def _goes_on(
    hazards: Hazards, k: int, time: float, sensors: HazardSensors
) -> bool:  # pragma: no cover  (compiled)
    """Whether an echo is of what echoed a look ago, so that its rate is known."""
    look, then = hazards.looks[0, k], hazards.looks[1, k]
    since = time - then[TIME]
    if then[HEARD] < 0.5 or since > _OLDEST_TICKS * sensors.tick_s:
        return False
    return abs(look[R] - then[R]) < _FASTEST_M_S * since


@njit(cache=True)
def _forget(
    hazards: Hazards, time: float, pose: Any
) -> None:  # pragma: no cover  (compiled)
    """Ends tracks of what is not likely, old or far; draws the others anew."""
    for t in range(len(hazards.tracks)):
        exists, seen_s = hazards.tracks[t, EXISTS], hazards.tracks[t, SEEN_S]
        if exists <= 0.0:
            continue
        first = hazards.particles[t, 0]
        far = math.hypot(first[X] - pose[0], first[Y] - pose[1]) > _FAR_M
        if exists < _LEAST_EXISTS or far or time - seen_s > _FORGET_S:
            hazards.tracks[t, EXISTS] = 0.0
        else:
            _draw_anew(hazards, t)


@njit(cache=True)
def _chance(memory: Any) -> float:  # pragma: no cover  (compiled)
    """The next of a fixed sequence of numbers from 0 to 1 (Park and Miller, 1988)."""
    memory[0, RANDOM] = (48271 * int(memory[0, RANDOM])) % 2147483647
    return memory[0, RANDOM] / 2147483647.0


@njit(cache=True)
def _normal(memory: Any) -> float:  # pragma: no cover  (compiled)
    """About normal: mean 0, deviation 1, never beyond 3."""
    return 2.0 * (_chance(memory) + _chance(memory) + _chance(memory) - 1.5)


@njit(cache=True)
def _remember_looks(
    hazards: Hazards, time: float, pose: Any, readings: Any, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    ranges, echo, ages = readings
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(ranges)):
        if ages[k] > 0.5 * sensors.tick_s:
            continue
        for age in range(_LOOKS - 1, 0, -1):
            for i in range(6):
                hazards.looks[age, k, i] = hazards.looks[age - 1, k, i]
        ahead, aside = sensors.places[k]
        look = hazards.looks[0, k]
        look[R], look[HEARD], look[TIME] = ranges[k], echo[k], time
        look[SX] = pose[0] + c * ahead - s * aside
        look[SY] = pose[1] + s * ahead + c * aside
        look[AXIS] = pose[2] + sensors.directions[k, 0]


@njit(cache=True)
def _seen_from(
    look: Any, x: float, y: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Distance of a place, m, and angle off the sensor's axis, rad."""
    dx, dy = x - look[SX], y - look[SY]
    return math.hypot(dx, dy), abs(wrapped(math.atan2(dy, dx) - look[AXIS]))


@njit(cache=True)
def _is_target(
    look: Any, half: float, target: Any
) -> bool:  # pragma: no cover  (compiled)
    distance, off = _seen_from(look, target[0], target[1])
    beside = off - half < target[2] / max(distance, target[2])
    return beside and abs(distance - look[R]) < target[2]


@njit(cache=True)
def _share_at(p: Any, look: Any, half: float) -> float:  # pragma: no cover  (compiled)
    """Share of a track that may be what has echoed."""
    share = 0.0
    for n in range(len(p)):
        distance, off = _seen_from(look, p[n, X], p[n, Y])
        if (
            off < half + _EDGE_M / max(distance, 0.1)
            and abs(distance - look[R] - _BEYOND_M) < _GATE_M
        ):
            share += p[n, WEIGHT]
    return share


@njit(cache=True)
def _weigh(
    hazards: Hazards, t: int, k: int, best: int, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Weighs a track by a look; the best one has echoed, and is pulled to the range."""
    p, fit_m = hazards.particles[t], math.hypot(_FIT_M, sensors.noise_m)
    look, half, echoed = hazards.looks[0, k], sensors.directions[k, 1], t == best
    total = 0.0
    for n in range(len(p)):
        distance, off = _seen_from(look, p[n, X], p[n, Y])
        edge = _EDGE_M / max(distance, 0.1)
        gap = look[R] + _BEYOND_M - distance
        if look[HEARD] < 0.5:
            gap = np.inf if distance < sensors.farthest_m - 0.05 else 0.0
        if off > half + edge:
            if echoed:
                p[n, WEIGHT] *= _ELSEWHERE
        elif gap > _GATE_M:
            if off < half - 0.5 * edge:
                p[n, WEIGHT] *= _UNSEEN
        elif echoed and gap > -_GATE_M:
            p[n, WEIGHT] *= max(math.exp(-0.5 * (gap / fit_m) ** 2), _LEAST_FIT)
            _pull(p[n], look, distance, gap, sensors)
        elif echoed:
            p[n, WEIGHT] *= _ELSEWHERE
        total += p[n, WEIGHT]
    exists = hazards.tracks[t, EXISTS]
    if total < 1e-9:
        hazards.tracks[t, EXISTS] = 0.0
        return
    if not echoed:
        exists = min(exists, _CERTAIN)
        exists *= total / (exists * total + 1.0 - exists)
    hazards.tracks[t, EXISTS] = exists
    for n in range(len(p)):
        p[n, WEIGHT] /= total


@njit(cache=True)
def _pull(
    particle: Any, look: Any, distance: float, gap: float, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Moves a particle by what its range is off, and its velocity by a part of it."""
    ux = (particle[X] - look[SX]) / max(distance, 1e-6)
    uy = (particle[Y] - look[SY]) / max(distance, 1e-6)
    particle[X] += gap * ux
    particle[Y] += gap * uy
    change = min(max(_TO_VELOCITY * gap / sensors.tick_s, -0.1), 0.1)
    particle[VX] += change * ux
    particle[VY] += change * uy
    speed = math.hypot(particle[VX], particle[VY])
    if speed > sensors.top_speed_m_s:
        particle[VX] *= sensors.top_speed_m_s / speed
        particle[VY] *= sensors.top_speed_m_s / speed


@njit(cache=True)
def _came_from_free(
    space: FreeSpace, look: Any, half: float, margin_m: float
) -> bool:  # pragma: no cover  (compiled)
    """Whether all of an echo's arc was seen free before, as far as it may be off."""
    cells, cell = space.hits.shape[0], space.cell_m
    step_m = _ARC_STEP * cell
    across = max(8, math.ceil(2.0 * half * look[R] / step_m))
    along = math.ceil((2.0 * margin_m + _BEHIND * cell) / step_m)
    for one in range(across + 1):
        angle = look[AXIS] + half * (2.0 * one / across - 1.0)
        for other in range(along + 1):
            at = look[R] - margin_m + other * step_m
            i = math.floor((look[SX] + at * math.cos(angle)) / cell)
            j = math.floor((look[SY] + at * math.sin(angle)) / cell)
            di, dj = i - space.facts[0, FIRST_I], j - space.facts[0, FIRST_J]
            if not (0 <= di < cells and 0 <= dj < cells):
                return False
            # Of a cell that is forgotten nobody knows any more where it is.
            if space.free_until[i % cells, j % cells] < space.facts[0, ROLLED]:
                return False
    return True


@njit(cache=True)
def _begin(
    hazards: Hazards, k: int, time: float, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Begins a track, in the place of the least likely one."""
    tracks, memory, top = hazards.tracks, hazards.memory, sensors.top_speed_m_s
    look, then, half = (
        hazards.looks[0, k],
        hazards.looks[1, k],
        sensors.directions[k, 1],
    )
    t = 0
    for other in range(len(tracks)):
        if tracks[other, EXISTS] < tracks[t, EXISTS]:
            t = other
    p, since = hazards.particles[t], time - then[TIME]
    rate = (look[R] - then[R]) / since
    rate_error = math.hypot(_RATE_M_S, 1.5 * sensors.noise_m / since)
    own_x, own_y = (look[SX] - then[SX]) / since, (look[SY] - then[SY]) / since
    ago = time - hazards.looks[2, k, TIME]
    at = look[R] + _BEYOND_M
    for n in range(len(p)):
        for _ in range(_TRIES):
            angle = look[AXIS] + half * (2.0 * _chance(memory) - 1.0)
            ux, uy = math.cos(angle), math.sin(angle)
            # Of the body: the range grows by its speed less the sensor's.
            radial = rate + own_x * ux + own_y * uy + rate_error * _normal(memory)
            radial = min(max(radial, -top), top)
            across = math.sqrt(max(top * top - radial * radial, 0.0))
            across *= 2.0 * _chance(memory) - 1.0
            p[n, X], p[n, Y] = look[SX] + at * ux, look[SY] + at * uy
            p[n, VX] = radial * ux - across * uy
            p[n, VY] = radial * uy + across * ux
            if ago > 10.0 * since or not _was_visible(hazards, p[n], ago, sensors):
                break
        p[n, WEIGHT] = 1.0 / len(p)
    tracks[t, EXISTS], tracks[t, SEEN_S] = _CERTAIN, time
    memory[0, MOVED_S] = time


@njit(cache=True)
def _was_visible(
    hazards: Hazards, particle: Any, ago: float, sensors: HazardSensors
) -> bool:  # pragma: no cover  (compiled)
    """Whether a sensor would have seen a particle at its oldest look, and did not."""
    x, y = particle[X] - ago * particle[VX], particle[Y] - ago * particle[VY]
    for k in range(hazards.looks.shape[1]):
        look, half = hazards.looks[_LOOKS - 1, k], sensors.directions[k, 1]
        distance, off = _seen_from(look, x, y)
        reach = look[R] if look[HEARD] > 0.5 else sensors.farthest_m
        inside = off < half - 0.03 / max(distance, 0.1)
        if inside and distance + 0.03 < reach:
            return True
    return False


@njit(cache=True)
def _draw_anew(hazards: Hazards, t: int) -> None:  # pragma: no cover  (compiled)
    """Draws a track's particles by their weights, once few of them count."""
    p, memory = hazards.particles[t], hazards.memory
    squares = 0.0
    for n in range(len(p)):
        squares += p[n, WEIGHT] ** 2
    if squares * len(p) < 2.0:
        return
    old = np.copy(p)
    by_x = max(_JITTER * _spread(p, VX), _JITTER_M_S)
    by_y = max(_JITTER * _spread(p, VY), _JITTER_M_S)
    passed, m = old[0, WEIGHT], 0
    for n in range(len(p)):
        while passed < (n + 0.5) / len(p) and m < len(p) - 1:
            m += 1
            passed += old[m, WEIGHT]
        p[n, X] = old[m, X] + _JITTER_M * _normal(memory)
        p[n, Y] = old[m, Y] + _JITTER_M * _normal(memory)
        p[n, VX] = old[m, VX] + by_x * _normal(memory)
        p[n, VY] = old[m, VY] + by_y * _normal(memory)
        p[n, WEIGHT] = 1.0 / len(p)


@njit(cache=True)
def _spread(p: Any, which: int) -> float:  # pragma: no cover  (compiled)
    """Standard deviation of a value of all particles, whatever their weights."""
    mean, square = 0.0, 0.0
    for n in range(len(p)):
        mean += p[n, which] / len(p)
        square += p[n, which] ** 2 / len(p)
    return math.sqrt(max(square - mean**2, 0.0))


@njit(cache=True)
def find_movers(
    hazards: Hazards, time: float, places: Any
) -> int:  # pragma: no cover  (compiled)
    """Where the bodies are that were seen lately.

    Args:
        hazards: The tracks.
        time: s.
        places: (n, 3) filled: middle of a track, m, and how far its echoes may be from
            there, m.

    Returns:
        How many there are.
    """
    count = 0
    for t in range(len(hazards.tracks)):
        exists, seen_s = hazards.tracks[t, EXISTS], hazards.tracks[t, SEEN_S]
        if exists < _LIKELY or time - seen_s > _LATELY_S:
            continue
        p, x, y = hazards.particles[t], 0.0, 0.0
        for n in range(len(p)):
            x += p[n, WEIGHT] * p[n, X]
            y += p[n, WEIGHT] * p[n, Y]
        places[count, 0], places[count, 1], places[count, 2] = x, y, _BODY_M
        count += 1
    return count


@njit(cache=True)
def pick_hazards(
    hazards: Hazards, time: float, pose: Any, within_m: float
) -> int:  # pragma: no cover  (compiled)
    """Picks particles of the tracks near a robot, which stand for all of them.

    Args:
        hazards: ``picked`` changes.
        time: s.
        pose: (x, y, theta) of the robot, m and rad.
        within_m: Tracks that are farther away are left out, m.

    Returns:
        How many there are.
    """
    picked, count = hazards.picked, 0
    for t in range(len(hazards.tracks)):
        exists, p = hazards.tracks[t, EXISTS], hazards.particles[t]
        if exists < _LEAST_EXISTS:
            continue
        if math.hypot(p[0, X] - pose[0], p[0, Y] - pose[1]) > within_m:
            continue
        spread = math.hypot(_spread(p, VX), _spread(p, VY))
        passed, m = p[0, WEIGHT], 0
        for n in range(_PICKED):
            while passed < (n + 0.5) / _PICKED and m < len(p) - 1:
                m += 1
                passed += p[m, WEIGHT]
            for i in range(4):
                picked[count, i] = p[m, i]
            picked[count, WEIGHT] = exists / _PICKED
            picked[count, AGE_S] = time - hazards.tracks[t, SEEN_S]
            picked[count, SPREAD] = spread
            count += 1
    return count
