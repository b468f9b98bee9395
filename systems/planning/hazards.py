"""Tracks of moving bodies: one particle filter per body, based on range readings.

A range sensor measures the distance of a body, but not its direction within the
aperture. Only several readings together exclude most of the possible positions and
velocities. Therefore each track of a body has 200 particles. A particle is one possible
position and velocity of the body.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.looks import (
    HazardSensors,
    Look,
    came_from_free,
    goes_on,
    is_target,
    look_of,
    make_looks,
    remember_looks,
    seen_from,
)
from systems.safety.free_space import FreeSpace

# ``_TRACKS``: number of tracks.
# ``_PARTICLES``: number of particles per track.
# ``_PICKED``: number of particles per track that are used to choose a motion.
_TRACKS, _PARTICLES, _PICKED = 8, 200, 25
#: Greatest speed of the bodies that are tracked, m/s.
TOP_SPEED_M_S = 0.6
#: Distance of a particle behind the surface that returns the echo, m.
_BEYOND_M = 0.02
#: A range fits a particle if the range differs from the distance of the particle by
#: less than this, m.
_GATE_M = 0.10
#: Distance of a particle outside the edge of an aperture, m. Up to this distance, a
#: part of the body may still be inside the aperture.
_EDGE_M = 0.04
# ``_UNSEEN``: factor for the weight of a particle that the sensor should have seen but
#   has not seen.
# ``_ELSEWHERE``: factor for the weight of a particle that does not fit the echo of its
#   track.
_UNSEEN, _ELSEWHERE = 0.1, 0.5
# ``_FIT_M``: standard deviation of the range error of a particle with the right
#   velocity, m. The noise of the sensor comes in addition.
# ``_LEAST_FIT``: least factor for the weight of a particle with a wrong range.
_FIT_M, _LEAST_FIT = 0.01, 0.5
#: Share of the range error per tick that corrects the velocity of a particle.
_TO_VELOCITY = 0.1
#: Standard deviation of the first range rate of a track, m/s. The value is large,
#: because the nearest visible point jumps between corners when a body enters an
#: aperture.
_RATE_M_S = 0.2
# Noise is added to particles that are drawn again.
# ``_JITTER``: noise of the velocity as a share of the spread of the velocity.
# ``_JITTER_M_S``: least noise of the velocity, m/s.
# ``_JITTER_M``: noise of the position, m.
_JITTER, _JITTER_M_S, _JITTER_M = 0.5, 0.01, 0.005
#: Share of bodies that stop per second.
_STOPS_HZ = 0.04
# ``_LEAST_EXISTS``: a track ends if its probability is below this value.
# ``_LEAST_SHARE``: a track explains an echo only if its probability, times the share of
#   its particles near the echo, exceeds this value.
_LEAST_EXISTS, _LEAST_SHARE = 0.03, 0.03
# ``_CERTAIN``: highest probability of a track.
# ``_SEEN_AGAIN``: share of the remaining doubt that one echo removes.
_CERTAIN, _SEEN_AGAIN = 0.98, 0.2
# ``_FORGET_S``: a track ends if no sensor has seen the body for this time, s.
# ``_FAR_M``: a track ends if it is farther away than this distance, m.
_FORGET_S, _FAR_M = 12.0, 5.0
# ``_LIKELY``: least probability of a track that ``find_movers`` lists.
# ``_LATELY_S``: longest time since a sensor has seen the body of such a track, s.
# ``_BODY_M``: distance from the track within which echoes come from the body, m.
_LIKELY, _LATELY_S, _BODY_M = 0.3, 3.0, 0.5
#: Largest number of draws of a new particle. The draw is repeated if a sensor would
#: have seen the particle before.
_TRIES = 12
#: Largest age of a look (a reading of a sensor) that is compared with a new particle.
#: The age is a multiple of the time between the last two looks.
_TOO_OLD = 10.0


class Particles(NamedTuple):
    """Possible positions and velocities of moving bodies.

    In ``Hazards``, each array has the shape (tracks, particles). A function that works
    on one track gets one row of each array, with the shape (particles,).
    """

    x: NDArray[np.float64]
    """Position, x in the world frame W, m."""
    y: NDArray[np.float64]
    """Position, y in W, m."""
    vx: NDArray[np.float64]
    """Velocity, x in W, m/s."""
    vy: NDArray[np.float64]
    """Velocity, y in W, m/s."""
    weight: NDArray[np.float64]
    """Share of the particle in its track. The weights of a track add up to 1."""


class Hazards(NamedTuple):
    """The tracks of all moving bodies. All arrays change."""

    exists: NDArray[np.float64]
    """(tracks,) probability that the body exists; 0 for an unused track."""
    seen_s: NDArray[np.float64]
    """(tracks,) time at which the body was last seen, s."""
    particles: Particles
    looks: Look
    """Last readings of all sensors."""
    random: NDArray[np.int64]
    """(1,) state of the random generator."""
    moved_s: NDArray[np.float64]
    """(1,) time at which the last track began, s."""


class Sample(NamedTuple):
    """Selected particles of several tracks. Each array has the shape (n,)."""

    x: NDArray[np.float64]
    """Position, x in the world frame W, m."""
    y: NDArray[np.float64]
    """Position, y in W, m."""
    vx: NDArray[np.float64]
    """Velocity, x in W, m/s."""
    vy: NDArray[np.float64]
    """Velocity, y in W, m/s."""
    weight: NDArray[np.float64]
    """Expected number of bodies that the particle represents."""
    age_s: NDArray[np.float64]
    """Time since the track was last seen, s."""
    spread_m_s: NDArray[np.float64]
    """Standard deviation of the velocity in the track, m/s."""


def make_hazards(sensors: int) -> Hazards:
    """Makes a memory of moving bodies without any tracks.

    ``sensors`` is the number of range sensors.
    """
    grid = _TRACKS, _PARTICLES
    return Hazards(
        np.zeros(_TRACKS),
        np.zeros(_TRACKS),
        Particles(*(np.zeros(grid) for _ in Particles._fields)),
        make_looks(sensors),
        np.ones(1, dtype=np.int64),
        np.full(1, -np.inf),
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
    """Predicts the tracks of moving bodies by one control period and updates them.

    A track is a particle filter: its particles are possible positions and velocities of
    one body. Each new reading of a sensor passes through these steps:

    1. An echo near the target belongs to the target.
    2. Any other echo belongs to the track that explains it best.
    3. The reading changes the weights of the particles of all tracks (``_weigh``). The
       track to which the echo belongs becomes more probable.
    4. An echo that no track explains begins a new track on two conditions. First, the
       whole arc of the echo was seen free before, so that no obstacle at rest can be
       there. Second, the previous echo of the sensor fits the new echo, so that the
       range rate is known.

    Finally, the function ends improbable tracks. If only few particles of a track have
    weight, it draws the particles of this track again.

    Args:
        hazards: Tracks of moving bodies. The function changes the tracks in place.
        time: Current time, s.
        pose: Pose (x, y, theta) of the robot, m and rad.
        readings: Three values per sensor: range, m; echo, 0 or 1; and age of the
            reading, s.
        space: Cells that were seen free.
        target: Position (x, y) and radius of the followed target, m.
        sensors: Properties of the sensors.
    """
    ages, tick_s = readings[2], sensors.tick_s
    _move_on(hazards, tick_s)
    remember_looks(hazards.looks, time, pose, readings, sensors)
    for k in range(len(ages)):
        # The sensor has not fired in this tick.
        if ages[k] > 0.5 * tick_s:
            continue
        look, half = look_of(hazards.looks, 0, k), sensors.directions[k, 1]
        unknown = look.heard > 0.5 and not is_target(look, half, target)
        best = _best_track(hazards, look, half) if unknown else -1
        for t in range(len(hazards.exists)):
            if hazards.exists[t] > 0.0:
                _weigh(hazards, t, k, best, sensors)
        if best >= 0:
            hazards.seen_s[best] = time
            doubt = _CERTAIN - hazards.exists[best]
            hazards.exists[best] += _SEEN_AGAIN * doubt
        elif (
            unknown
            and goes_on(look, look_of(hazards.looks, 1, k), tick_s)
            and came_from_free(space, look, half, sensors.margin_m[k])
        ):
            _begin(hazards, k, sensors)
    _forget(hazards, time, pose)


@njit(cache=True)
def _particles_of(
    hazards: Hazards, t: int
) -> Particles:  # pragma: no cover  (compiled)
    """Returns the particles of a track. Changes of these particles change the track."""
    p = hazards.particles
    return Particles(p.x[t], p.y[t], p.vx[t], p.vy[t], p.weight[t])


@njit(cache=True)
def _move_on(hazards: Hazards, tick_s: float) -> None:  # pragma: no cover  (compiled)
    """Moves all particles by one control period with their velocities."""
    for t in range(len(hazards.exists)):
        if hazards.exists[t] > 0.0:
            p = _particles_of(hazards, t)
            for n in range(len(p.x)):
                p.x[n] += tick_s * p.vx[n]
                p.y[n] += tick_s * p.vy[n]
            # Bodies stop sometimes. On average, the share ``_STOPS_HZ`` of the
            # particles stops per second.
            if _chance(hazards.random) < _STOPS_HZ * tick_s * len(p.x):
                n = int(_chance(hazards.random) * len(p.x))
                p.vx[n], p.vy[n] = 0.0, 0.0


@njit(cache=True)
def _best_track(
    hazards: Hazards, look: Look, half: float
) -> int:  # pragma: no cover  (compiled)
    """Returns the track that explains an echo best, or -1 if there is no such track."""
    best, most = -1, _LEAST_SHARE
    for t in range(len(hazards.exists)):
        exists = hazards.exists[t]
        if exists > 0.0:
            share = exists * _share_at(_particles_of(hazards, t), look, half)
            if share > most:
                best, most = t, share
    return best


@njit(cache=True)
def _forget(
    hazards: Hazards, time: float, pose: Any
) -> None:  # pragma: no cover  (compiled)
    """Ends improbable, old, and distant tracks, and resamples the other tracks."""
    for t in range(len(hazards.exists)):
        exists = hazards.exists[t]
        if exists <= 0.0:
            continue
        p = _particles_of(hazards, t)
        far = math.hypot(p.x[0] - pose[0], p.y[0] - pose[1]) > _FAR_M
        if exists < _LEAST_EXISTS or far or time - hazards.seen_s[t] > _FORGET_S:
            hazards.exists[t] = 0.0
        else:
            _draw_anew(p, hazards.random)


@njit(cache=True)
def _chance(random: Any) -> float:  # pragma: no cover  (compiled)
    """Returns the next pseudorandom number from 0 to 1 (Park and Miller, 1988)."""
    random[0] = (48271 * random[0]) % 2147483647
    return random[0] / 2147483647.0


@njit(cache=True)
def _normal(random: Any) -> float:  # pragma: no cover  (compiled)
    """Returns a roughly normal random number from -3 to 3 (mean 0, deviation 1)."""
    return 2.0 * (_chance(random) + _chance(random) + _chance(random) - 1.5)


@njit(cache=True)
def _share_at(
    p: Particles, look: Look, half: float
) -> float:  # pragma: no cover  (compiled)
    """Returns the share of a track's particles, by weight, that fit an echo."""
    share = 0.0
    for n in range(len(p.x)):
        distance, off = seen_from(look, p.x[n], p.y[n])
        if (
            off < half + _EDGE_M / max(distance, 0.1)
            and abs(distance - look.range_m - _BEYOND_M) < _GATE_M
        ):
            share += p.weight[n]
    return share


@njit(cache=True)
def _weigh(
    hazards: Hazards, t: int, k: int, best: int, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Updates the weights of the particles of track ``t`` with a new reading.

    The reading is from sensor ``k``. ``best`` is the number of the track to which the
    echo belongs, or -1. If ``best`` is ``t``, the track has echoed.

    By Bayes' rule, the function multiplies each weight by the likelihood of the
    reading, assuming that the body is at the particle. The likelihood depends on the
    gap: the measured distance minus the distance of the particle. Without an echo, the
    gap is infinite for particles within the greatest range, and 0 for the others. There
    are four cases:

    - The particle is outside the aperture. If the track has echoed, the particle loses
      weight.
    - The gap is large: the sensor has seen past the particle. The particle loses most
      of its weight, unless it is near the edge of the aperture.
    - The track has echoed, and the gap is small. The particle's weight changes by a
      Gaussian factor of the gap. The particle moves to the measured range.
    - The track has echoed, and the particle is behind the echo. The particle loses
      weight.

    All other particles keep their weight, because a nearer object may hide them. The
    sum of the new weights is the likelihood of the reading if the body exists. If the
    track has not echoed, this sum lowers the probability that the body exists.
    """
    p, fit_m = _particles_of(hazards, t), math.hypot(_FIT_M, sensors.noise_m[k])
    look, half = look_of(hazards.looks, 0, k), sensors.directions[k, 1]
    echoed, total = t == best, 0.0
    for n in range(len(p.x)):
        distance, off = seen_from(look, p.x[n], p.y[n])
        edge = _EDGE_M / max(distance, 0.1)
        gap = look.range_m + _BEYOND_M - distance
        if look.heard < 0.5:
            gap = np.inf if distance < sensors.farthest_m[k] - 0.05 else 0.0
        # Outside the aperture.
        if off > half + edge:
            if echoed:
                p.weight[n] *= _ELSEWHERE
        elif gap > _GATE_M:
            # The sensor has seen past the particle.
            if off < half - 0.5 * edge:
                p.weight[n] *= _UNSEEN
        elif echoed and gap > -_GATE_M:
            p.weight[n] *= max(math.exp(-0.5 * (gap / fit_m) ** 2), _LEAST_FIT)
            _pull(p, n, look, distance, gap, sensors.tick_s)
        elif echoed:
            p.weight[n] *= _ELSEWHERE
        total += p.weight[n]
    exists = hazards.exists[t]
    if total < 1e-9:
        hazards.exists[t] = 0.0
        return
    if not echoed:
        exists = min(exists, _CERTAIN)
        exists *= total / (exists * total + 1.0 - exists)
    hazards.exists[t] = exists
    for n in range(len(p.x)):
        p.weight[n] /= total


@njit(cache=True)
def _pull(
    p: Particles, n: int, look: Look, distance: float, gap: float, tick_s: float
) -> None:  # pragma: no cover  (compiled)
    """Moves particle ``n`` to the measured range, which is ``gap`` farther away.

    The gap per control period, times a small factor, also changes the velocity of the
    particle.
    """
    ux = (p.x[n] - look.x) / max(distance, 1e-6)
    uy = (p.y[n] - look.y) / max(distance, 1e-6)
    p.x[n] += gap * ux
    p.y[n] += gap * uy
    change = min(max(_TO_VELOCITY * gap / tick_s, -0.1), 0.1)
    p.vx[n] += change * ux
    p.vy[n] += change * uy
    speed = math.hypot(p.vx[n], p.vy[n])
    if speed > TOP_SPEED_M_S:
        p.vx[n] *= TOP_SPEED_M_S / speed
        p.vy[n] *= TOP_SPEED_M_S / speed


@njit(cache=True)
def _begin(
    hazards: Hazards, k: int, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Begins a track of a moving body with the newest echo of sensor ``k``.

    The new track replaces the least probable track. The function draws each particle in
    these steps:

    1. The direction is anywhere within the aperture, and the distance is the range.
    2. The radial speed is the range rate plus the sensor's own speed in this direction,
       with a random error.
    3. The tangential speed is unknown. It is uniformly distributed over all values with
       which the total speed does not exceed ``TOP_SPEED_M_S``.
    4. A body that begins to echo was out of view shortly before. If a sensor would have
       seen the particle earlier (``_was_visible``), draw the particle again, up to 12
       times.
    """
    random, top = hazards.random, TOP_SPEED_M_S
    look, then = look_of(hazards.looks, 0, k), look_of(hazards.looks, 1, k)
    half, since = sensors.directions[k, 1], look.time_s - then.time_s
    rate = (look.range_m - then.range_m) / since
    rate_error = math.hypot(_RATE_M_S, 1.5 * sensors.noise_m[k] / since)
    own_x, own_y = (look.x - then.x) / since, (look.y - then.y) / since
    at = look.range_m + _BEYOND_M
    t = int(np.argmin(hazards.exists))
    p = _particles_of(hazards, t)
    for n in range(len(p.x)):
        for _ in range(_TRIES):
            angle = look.axis_rad + half * (2.0 * _chance(random) - 1.0)
            ux, uy = math.cos(angle), math.sin(angle)
            radial = rate + own_x * ux + own_y * uy + rate_error * _normal(random)
            radial = min(max(radial, -top), top)
            across = math.sqrt(max(top * top - radial * radial, 0.0))
            across *= 2.0 * _chance(random) - 1.0
            p.x[n], p.y[n] = look.x + at * ux, look.y + at * uy
            p.vx[n] = radial * ux - across * uy
            p.vy[n] = radial * uy + across * ux
            if not _was_visible(hazards, p, n, look.time_s, _TOO_OLD * since, sensors):
                break
        p.weight[n] = 1.0 / len(p.x)
    hazards.exists[t], hazards.seen_s[t] = _CERTAIN, look.time_s
    hazards.moved_s[0] = look.time_s


@njit(cache=True)
def _was_visible(
    hazards: Hazards,
    p: Particles,
    n: int,
    time: float,
    oldest_s: float,
    sensors: HazardSensors,
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a sensor would have seen a body at particle ``n`` earlier.

    For each sensor, the function moves the particle back to the time of the oldest
    stored reading. The sensor would have seen the particle if it was at least 3 cm
    inside the aperture, and at least 3 cm nearer than the reading. Readings older than
    ``oldest_s`` do not count.
    """
    for k in range(len(sensors.directions)):
        look, half = look_of(hazards.looks, 2, k), sensors.directions[k, 1]
        ago = time - look.time_s
        if ago > oldest_s:
            continue
        distance, off = seen_from(look, p.x[n] - ago * p.vx[n], p.y[n] - ago * p.vy[n])
        reach = look.range_m if look.heard > 0.5 else sensors.farthest_m[k]
        inside = off < half - 0.03 / max(distance, 0.1)
        if inside and distance + 0.03 < reach:
            return True
    return False


@njit(cache=True)
def _draw_anew(p: Particles, random: Any) -> None:  # pragma: no cover  (compiled)
    """Draws the particles of a track again in proportion to their weights.

    The function does so only if the effective number of particles, 1/(sum of the
    squared weights), is at most half of their number. The draw is systematic: it takes
    particles at equal steps of the cumulative weight. Small noise separates copies of
    one particle.
    """
    count, squares = len(p.x), 0.0
    for n in range(count):
        squares += p.weight[n] ** 2
    if squares * count < 2.0:
        return
    by_x = max(_JITTER * _spread(p.vx), _JITTER_M_S)
    by_y = max(_JITTER * _spread(p.vy), _JITTER_M_S)
    drawn = _at_equal_steps(p.weight, count)
    x, y, vx, vy = p.x[drawn], p.y[drawn], p.vx[drawn], p.vy[drawn]
    for n in range(count):
        p.x[n] = x[n] + _JITTER_M * _normal(random)
        p.y[n] = y[n] + _JITTER_M * _normal(random)
        p.vx[n] = vx[n] + by_x * _normal(random)
        p.vy[n] = vy[n] + by_y * _normal(random)
        p.weight[n] = 1.0 / count


@njit(cache=True)
def _at_equal_steps(
    weight: Any, count: int
) -> NDArray[np.int64]:  # pragma: no cover  (compiled)
    """Returns the indices of particles at equal steps of the cumulative weight."""
    found = np.empty(count, dtype=np.int64)
    passed, m = weight[0], 0
    for n in range(count):
        while passed < (n + 0.5) / count and m < len(weight) - 1:
            m += 1
            passed += weight[m]
        found[n] = m
    return found


@njit(cache=True)
def _spread(values: Any) -> float:  # pragma: no cover  (compiled)
    """Returns the unweighted standard deviation of one value over all particles."""
    mean, square = 0.0, 0.0
    for n in range(len(values)):
        mean += values[n] / len(values)
        square += values[n] ** 2 / len(values)
    return math.sqrt(max(square - mean**2, 0.0))


@njit(cache=True)
def find_movers(
    hazards: Hazards, time: float, places: Any
) -> int:  # pragma: no cover  (compiled)
    """Lists the positions of probable moving bodies that were seen recently.

    Args:
        hazards: Tracks of moving bodies.
        time: Current time, s.
        places: (n, 3) array that the function fills, one row per body: mean position
            (x, y) of the track, m, and the radius within which echoes may come from the
            body, m.

    Returns:
        Number of listed bodies.
    """
    count = 0
    for t in range(len(hazards.exists)):
        if hazards.exists[t] < _LIKELY or time - hazards.seen_s[t] > _LATELY_S:
            continue
        p, x, y = _particles_of(hazards, t), 0.0, 0.0
        for n in range(len(p.x)):
            x += p.weight[n] * p.x[n]
            y += p.weight[n] * p.y[n]
        places[count, 0], places[count, 1], places[count, 2] = x, y, _BODY_M
        count += 1
    return count


@njit(cache=True)
def pick_hazards(
    hazards: Hazards, time: float, pose: Any, within_m: float
) -> Sample:  # pragma: no cover  (compiled)
    """Picks a sample of the particles of all tracks near the robot.

    The function takes 25 particles of each track, at equal steps of the cumulative
    weight. The probability of the track is divided equally among them.

    Args:
        hazards: Tracks of moving bodies.
        time: Current time, s.
        pose: Pose (x, y, theta) of the robot, m and rad.
        within_m: Largest distance of a track from the robot, m.

    Returns:
        Picked particles; empty arrays if no track is near.
    """
    picked, count = np.empty((7, len(hazards.exists) * _PICKED)), 0
    for t in range(len(hazards.exists)):
        exists, p = hazards.exists[t], _particles_of(hazards, t)
        if exists < _LEAST_EXISTS:
            continue
        if math.hypot(p.x[0] - pose[0], p.y[0] - pose[1]) > within_m:
            continue
        spread = math.hypot(_spread(p.vx), _spread(p.vy))
        for m in _at_equal_steps(p.weight, _PICKED):
            picked[0, count], picked[1, count] = p.x[m], p.y[m]
            picked[2, count], picked[3, count] = p.vx[m], p.vy[m]
            picked[4, count] = exists / _PICKED
            picked[5, count] = time - hazards.seen_s[t]
            picked[6, count] = spread
            count += 1
    some = picked[:, :count]
    return Sample(some[0], some[1], some[2], some[3], some[4], some[5], some[6])
