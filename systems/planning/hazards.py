"""Tracks of moving bodies: a particle filter per body, fed with range readings.

A range sensor measures the distance of a body, but not its direction within the
aperture. Readings from several positions, and at the edges of apertures, exclude most
of the positions and velocities that were possible at first. Each track therefore has
200 particles. Each particle is one hypothesis about position and velocity.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.turning import wrapped
from systems.safety.free_space import FIRST_I, FIRST_J, ROLLED, FreeSpace

#: Number of tracks; particles per track; particles per track that are used to choose a
#: motion.
_TRACKS, _PARTICLES, _PICKED = 8, 200, 25
#: Indices in a particle: position, m; velocity, m/s; and its share of the track.
X, Y, VX, VY, WEIGHT = range(5)
#: Additional indices in a picked particle: time since its track was last seen, s, and
#: standard deviation of the velocity in its track, m/s.
AGE_S, SPREAD = 5, 6
#: Indices in a track: probability that the body exists, and when it was last seen, s.
EXISTS, SEEN_S = range(2)
#: Indices in the memory: state of the random generator, and when the last track began,
#: s.
RANDOM, MOVED_S = range(2)
#: Indices in a look, which is one reading of one sensor: range, m; whether there was an
#: echo; time, s; position of the sensor, m; and direction of its axis, rad.
R, HEARD, TIME, SX, SY, AXIS = range(6)
#: Number of looks per sensor that are kept.
_LOOKS = 3

#: Distance of a particle behind the surface that echoes, m.
_BEYOND_M = 0.02
#: A range does not fit a particle if it differs from the distance of the particle by
#: more than this, m.
_GATE_M = 0.10
#: A body may be in an aperture although its particle is up to this distance, m, outside
#: the edge.
_EDGE_M = 0.04
#: Factor for the weight of a particle that should have been seen but was not. Factor
#: for the weight of a particle that does not fit the echo of its track.
_UNSEEN, _ELSEWHERE = 0.1, 0.5
#: Standard deviation of the range of a particle with the right velocity, m, in addition
#: to the noise of the sensor. Least factor for the weight of a particle with a wrong
#: range.
_FIT_M, _LEAST_FIT = 0.01, 0.5
#: Share of a range error, per tick, that corrects the velocity.
_TO_VELOCITY = 0.1
#: Standard deviation of the first range rate of a track, m/s. It is large because the
#: nearest visible point jumps between corners when a body enters an aperture.
_RATE_M_S = 0.2
#: Noise that is added when particles are drawn again: share of the spread of the
#: velocity; least noise of the velocity, m/s; noise of the position, m.
_JITTER, _JITTER_M_S, _JITTER_M = 0.5, 0.01, 0.005
#: Share of bodies that stop per second.
_STOPS_HZ = 0.04
#: A track ends if its probability is below the first number. A track explains an echo
#: only if its probability, times the share of its particles near the echo, exceeds the
#: second number.
_LEAST_EXISTS, _LEAST_SHARE = 0.03, 0.03
#: Highest probability of a track. Share of the remaining doubt that one echo removes.
_CERTAIN, _SEEN_AGAIN = 0.98, 0.2
#: A track ends if it was not seen for this time, s, or is farther away than this, m.
_FORGET_S, _FAR_M = 12.0, 5.0
#: Spacing of the points at which an arc is checked, and how far behind the arc they
#: reach, both in cells.
_ARC_STEP, _BEHIND = 0.3, 0.6
#: ``find_movers`` lists a track if its probability is at least the first number and it
#: was seen within the second number, s. Echoes within the third number, m, of its
#: position come from the body.
_LIKELY, _LATELY_S, _BODY_M = 0.3, 3.0, 0.5
#: Largest number of draws for a particle that no sensor would have seen before.
_TRIES = 12
#: A range that changes faster than the first number, m/s, belongs to another body. A
#: look that is older than the second number, ticks, is not compared with the next look.
_FASTEST_M_S, _OLDEST_TICKS = 2.0, 4.5


class HazardSensors(NamedTuple):
    """Properties of sensors and bodies on which the tracks depend."""

    places: NDArray[np.float64]
    """(sensors, 2) position relative to the axle in B, m."""
    directions: NDArray[np.float64]
    """(sensors, 2) direction of the axis in B and half of the aperture, rad."""
    farthest_m: NDArray[np.float64]
    """(sensors,) greatest range, m."""
    margin_m: NDArray[np.float64]
    """(sensors,) largest error of a range, m."""
    noise_m: NDArray[np.float64]
    """(sensors,) standard deviation of a range, m."""
    top_speed_m_s: float
    """Largest speed of a body, m/s."""
    tick_s: float


class Hazards(NamedTuple):
    """The tracks of moving bodies. All arrays change."""

    tracks: NDArray[np.float64]
    """(tracks, 2) ``EXISTS`` and ``SEEN_S``."""
    particles: NDArray[np.float64]
    """(tracks, particles, 5) particles of each track; the weights of a track add up to
    1."""
    looks: NDArray[np.float64]
    """(3, sensors, 6) last looks of each sensor, most recent first."""
    memory: NDArray[np.float64]
    """(1, 2) ``RANDOM`` and ``MOVED_S``."""
    picked: NDArray[np.float64]
    """(n, 7) particles that ``pick_hazards`` has chosen as a sample of all particles.
    The weight of a picked particle is an expected number of bodies."""


def make_hazards(sensors: int) -> Hazards:
    """Returns a memory without tracks.

    Args:
        sensors: Number of range sensors.

    Returns:
        The empty memory.
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
    """Moves the tracks by one tick, and weighs them with the new readings.

    Each new reading passes through these steps:

    1. An echo near the target is attributed to the target, and not to a track.
    2. Any other echo is attributed to the track that explains it best.
    3. All tracks are weighed with the reading (``_weigh``). The track to which the echo
       is attributed becomes more probable.
    4. An echo that no track explains begins a new track on two conditions. The whole
       arc of the echo was seen free before, so no obstacle at rest can be there. The
       previous echo of the sensor fits the new one, so the range rate is known.

    Finally, improbable tracks end. If only few particles of a track have weight, its
    particles are drawn again.

    Args:
        hazards: Modified in place.
        time: Current time, s.
        pose: (x, y, theta) of the robot, m and rad.
        readings: Ranges, m; echoes, 0 or 1; and ages of the readings, s.
        space: Cells that were seen free.
        target: (x, y, radius) of the followed target, m. Echoes near the target belong
            to the target.
        sensors: Properties of the sensors.
    """
    ages, tick_s = readings[2], sensors.tick_s
    _move_on(hazards, tick_s)
    _remember_looks(hazards, time, pose, readings, sensors)
    for k in range(len(ages)):
        # The sensor has not fired in this tick.
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
            and _came_from_free(space, look, half, sensors.margin_m[k])
        ):
            _begin(hazards, k, time, sensors)
    _forget(hazards, time, pose)


@njit(cache=True)
def _move_on(hazards: Hazards, tick_s: float) -> None:  # pragma: no cover  (compiled)
    """Move all particles by one tick with their velocities."""
    for t in range(len(hazards.tracks)):
        if hazards.tracks[t, EXISTS] > 0.0:
            p = hazards.particles[t]
            for n in range(len(p)):
                p[n, X] += tick_s * p[n, VX]
                p[n, Y] += tick_s * p[n, VY]
            # Bodies stop sometimes. On average, the share ``_STOPS_HZ`` of the
            # particles stops per second.
            if _chance(hazards.memory) < _STOPS_HZ * tick_s * len(p):
                n = int(_chance(hazards.memory) * len(p))
                p[n, VX], p[n, VY] = 0.0, 0.0


@njit(cache=True)
def _best_track(
    hazards: Hazards, look: Any, half: float
) -> int:  # pragma: no cover  (compiled)
    """Return the track that explains an echo best; -1 if no track explains it."""
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
    """Return whether an echo fits the previous look of its sensor.

    If it does not fit, the range rate is unknown.
    """
    look, then = hazards.looks[0, k], hazards.looks[1, k]
    since = time - then[TIME]
    if then[HEARD] < 0.5 or since > _OLDEST_TICKS * sensors.tick_s:
        return False
    return abs(look[R] - then[R]) < _FASTEST_M_S * since


@njit(cache=True)
def _forget(
    hazards: Hazards, time: float, pose: Any
) -> None:  # pragma: no cover  (compiled)
    """End improbable, old and distant tracks, and resample the others."""
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
    """Return the next pseudorandom number from 0 to 1 (Park and Miller, 1988)."""
    memory[0, RANDOM] = (48271 * int(memory[0, RANDOM])) % 2147483647
    return memory[0, RANDOM] / 2147483647.0


@njit(cache=True)
def _normal(memory: Any) -> float:  # pragma: no cover  (compiled)
    """Return a roughly normal random number from -3 to 3: mean 0, deviation 1."""
    return 2.0 * (_chance(memory) + _chance(memory) + _chance(memory) - 1.5)


@njit(cache=True)
def _remember_looks(
    hazards: Hazards, time: float, pose: Any, readings: Any, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Store the new readings as looks, with position and direction of each sensor."""
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
    """Return the distance of a place, m, and its angle off the sensor's axis, rad."""
    dx, dy = x - look[SX], y - look[SY]
    return math.hypot(dx, dy), abs(wrapped(math.atan2(dy, dx) - look[AXIS]))


@njit(cache=True)
def _is_target(
    look: Any, half: float, target: Any
) -> bool:  # pragma: no cover  (compiled)
    """Return whether an echo may come from the followed target."""
    distance, off = _seen_from(look, target[0], target[1])
    beside = off - half < target[2] / max(distance, target[2])
    return beside and abs(distance - look[R]) < target[2]


@njit(cache=True)
def _share_at(p: Any, look: Any, half: float) -> float:  # pragma: no cover  (compiled)
    """Return the share of a track's particles, by weight, that fit an echo."""
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
    """Weigh the particles of a track with the newest look of sensor ``k``.

    ``best`` is the track to which the echo is attributed, or -1. If ``best`` is track
    ``t``, the track has echoed. For each particle, ``gap`` is the measured distance
    minus the distance of the particle. Without an echo, ``gap`` is infinite for
    particles within the greatest range, and 0 for the others. There are four cases:

    * The particle is outside the aperture. If its track has echoed, the particle loses
      weight.
    * The sensor has seen past the particle (large gap). The particle loses most of its
      weight, unless it is near the edge of the aperture.
    * The particle fits the echo of its track. Its weight depends on the gap, and the
      particle moves to the measured range.
    * The particle is behind the echo of its track. The particle loses weight.

    Other particles keep their weight, because a nearer object may hide them. If the
    track has not echoed, the lost weight lowers the probability of the track by Bayes'
    rule.
    """
    p, fit_m = hazards.particles[t], math.hypot(_FIT_M, sensors.noise_m[k])
    look, half, echoed = hazards.looks[0, k], sensors.directions[k, 1], t == best
    total = 0.0
    for n in range(len(p)):
        distance, off = _seen_from(look, p[n, X], p[n, Y])
        edge = _EDGE_M / max(distance, 0.1)
        gap = look[R] + _BEYOND_M - distance
        if look[HEARD] < 0.5:
            gap = np.inf if distance < sensors.farthest_m[k] - 0.05 else 0.0
        # Outside the aperture.
        if off > half + edge:
            if echoed:
                p[n, WEIGHT] *= _ELSEWHERE
        elif gap > _GATE_M:
            # The sensor has seen past the particle.
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
        # Bayes' rule: ``total`` is the likelihood of the look if the body exists.
        exists = min(exists, _CERTAIN)
        exists *= total / (exists * total + 1.0 - exists)
    hazards.tracks[t, EXISTS] = exists
    for n in range(len(p)):
        p[n, WEIGHT] /= total


@njit(cache=True)
def _pull(
    particle: Any, look: Any, distance: float, gap: float, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Move a particle to the measured range.

    A part of the range error also corrects the velocity of the particle.
    """
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
    """Return whether the whole arc of an echo was seen free before.

    The function checks points along the arc, over the width of the aperture. In depth,
    the points extend from the range minus its largest error to the range plus this
    error and a part of a cell. The cells of all points must still count as free.
    """
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
            # The position of a forgotten cell is no longer known.
            if space.free_until[i % cells, j % cells] < space.facts[0, ROLLED]:
                return False
    return True


@njit(cache=True)
def _begin(
    hazards: Hazards, k: int, time: float, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Begin a track that replaces the least probable one.

    The body may be anywhere on the arc of the newest echo of sensor ``k``. The radial
    speed of the body follows from the range rate and the motion of the sensor, with an
    error. The tangential speed is unknown. The function draws this speed uniformly from
    the values for which the total speed does not exceed the top speed. It repeats a
    draw if a sensor would have seen the drawn body in its oldest look. It omits this
    check if the oldest look of sensor ``k`` is too old. Each particle is drawn at most
    12 times.
    """
    tracks, memory, top = hazards.tracks, hazards.memory, sensors.top_speed_m_s
    look, then, half = (
        hazards.looks[0, k],
        hazards.looks[1, k],
        sensors.directions[k, 1],
    )
    # Find the least probable track.
    t = 0
    for other in range(len(tracks)):
        if tracks[other, EXISTS] < tracks[t, EXISTS]:
            t = other
    # Range rate, its error, and velocity of the sensor.
    p, since = hazards.particles[t], time - then[TIME]
    rate = (look[R] - then[R]) / since
    rate_error = math.hypot(_RATE_M_S, 1.5 * sensors.noise_m[k] / since)
    own_x, own_y = (look[SX] - then[SX]) / since, (look[SY] - then[SY]) / since
    ago = time - hazards.looks[2, k, TIME]
    at = look[R] + _BEYOND_M
    for n in range(len(p)):
        for _ in range(_TRIES):
            # Draw a direction within the aperture.
            angle = look[AXIS] + half * (2.0 * _chance(memory) - 1.0)
            ux, uy = math.cos(angle), math.sin(angle)
            # The range rate is the radial speed of the body minus that of the sensor.
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
    """Return whether the oldest looks contradict a particle.

    The function moves the particle back in time by ``ago`` seconds. A look contradicts
    the particle if two conditions hold. The particle was inside the aperture, at least
    3 cm from the edge. It was also at least 3 cm nearer than the reading. The sensor
    would have seen such a body, but did not.
    """
    x, y = particle[X] - ago * particle[VX], particle[Y] - ago * particle[VY]
    for k in range(hazards.looks.shape[1]):
        look, half = hazards.looks[_LOOKS - 1, k], sensors.directions[k, 1]
        distance, off = _seen_from(look, x, y)
        reach = look[R] if look[HEARD] > 0.5 else sensors.farthest_m[k]
        inside = off < half - 0.03 / max(distance, 0.1)
        if inside and distance + 0.03 < reach:
            return True
    return False


@njit(cache=True)
def _draw_anew(hazards: Hazards, t: int) -> None:  # pragma: no cover  (compiled)
    """Draw the particles of a track again in proportion to their weights.

    The function draws only if the effective number of particles is at most half of
    their number. The effective number is one over the sum of the squared weights. The
    draw is systematic: it takes particles at equal steps of the cumulative weight.
    Small noise then separates copies of the same particle.
    """
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
    """Return the unweighted standard deviation of one value over all particles."""
    mean, square = 0.0, 0.0
    for n in range(len(p)):
        mean += p[n, which] / len(p)
        square += p[n, which] ** 2 / len(p)
    return math.sqrt(max(square - mean**2, 0.0))


@njit(cache=True)
def find_movers(
    hazards: Hazards, time: float, places: Any
) -> int:  # pragma: no cover  (compiled)
    """Lists the positions of probable bodies that were seen recently.

    Args:
        hazards: The tracks.
        time: Current time, s.
        places: (n, 3) array that the function fills: mean position of each track, m,
            and radius within which echoes may come from the body, m.

    Returns:
        Number of bodies.
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
    """Picks a sample of the particles of all tracks near a robot.

    The function takes 25 particles of each track, at equal steps of the cumulative
    weight. Each picked particle gets an equal part of the probability of the track.

    Args:
        hazards: The tracks. The function writes ``picked``.
        time: Current time, s.
        pose: (x, y, theta) of the robot, m and rad.
        within_m: Distance from the robot, m. Tracks beyond it are left out.

    Returns:
        Number of picked particles.
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
