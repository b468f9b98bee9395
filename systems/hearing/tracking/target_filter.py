"""Kalman filter of a moving source, with front and back as two hypotheses.

A source moves at a velocity that fades and is driven by white acceleration
(an Ornstein-Uhlenbeck process): the same law at every speed that a source can
have, with a standard deviation that stays bounded however long it is silent.

A row of microphones gives two candidates, the one ahead and its mirror image.
Hypothesis 0 says that the source is ahead now, hypothesis 1 that it is behind;
each keeps the best of the two histories that lead to it (the Viterbi
recursion). A cost is half the sum of the squared normalised innovations and of
the logarithms of their covariances' determinants: minus a log-likelihood. When
the robot moves, the image runs, which no source does for nothing.

All of it is written for flat arrays and numbers alone, so that numba compiles
it for floats, and ``fold.py_func`` and ``expected.py_func`` run it on
AutoDiffXd. The functions change their first argument.

Layouts (m, s, in W):
- track, 16: age of its last estimate; position (2), velocity (2), covariance of
  the position (xx, xy, yy), of position and velocity (xx, xy, yx, yy), of the
  velocity (xx, xy, yy), all at the moment of that estimate; and the factor by
  which sightings scatter more than their covariances say, in variance
- hypothesis, 34: cost, number of outliers in a row that agree, track, and the
  track of these outliers
- memory: index of the chosen hypothesis, then one hypothesis, or two where
  front and back are open
- sighting, 10: position of the source (or, where there is no range, the unit
  vector to it), its covariance (xx, xy, yy), centre of the microphones (2), the
  normal of their row, ahead (2), and 1 where there is a range
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Names of a track's elements.
TRACK_NAMES = (
    *("age", "x", "y", "vx", "vy"),
    *("Axx", "Axy", "Ayy", "Cxx", "Cxy", "Cyx", "Cyy", "Vxx", "Vxy", "Vyy"),
    "scatter",
)
TRACK = len(TRACK_NAMES)
HYPOTHESIS = 2 + 2 * TRACK

#: Age of a track that was never fed, s: finite, and beyond every limit.
NEVER_HEARD_S = 1e6
#: Squared normalised innovation of two dimensions that chance exceeds in 1 %.
GATE = 9.21
#: Innovations are taken for what the covariances say up to this ratio, in
#: variance; above it ...
SCATTER_MARGIN = 1.5
#: ... this share of the excess is learnt from a sighting: a burst has 20.
SCATTER_RATE = 0.05
#: Nepers by which one sighting can speak against a hypothesis: a frame that is
#: off says little, whatever its covariance.
LARGEST_STEP = 1.0
#: The same for the first sighting after a silence of so many seconds, which owes
#: nothing to the ones before.
LARGEST_FRESH_STEP = 4.0
SILENCE_S = 0.5
#: Nepers by which the other hypothesis must lead before the choice turns over.
SWITCH_MARGIN = 3.0
#: Nepers beyond which a hypothesis becomes no less probable: what the model
#: gets wrong must not close the question for ever.
LARGEST_COST = 12.0


class FilterSettings(NamedTuple):
    """What is believed of sources and of estimates."""

    speed_std: float
    """Standard deviation of each component of the velocity, m/s."""
    velocity_fade: float
    """Time constant with which a velocity is forgotten, s."""
    floor: float
    """Standard deviation of what an estimate's covariance leaves out, m."""
    gate_floor: float
    """Standard deviation that the gate allows for in addition to the covariances, m."""
    believed_outliers: int
    """Number of outliers in a row after which they are accepted, if they agree."""
    assumed_range: float
    """Range of a target of which only the bearing is known, m."""
    measurement_age: float
    """From the moment a sighting is valid for to its arrival, s."""


def blank_memory(hypotheses: int) -> NDArray[np.float64]:
    """Nothing heard yet, for one or two hypotheses."""
    return NEVER_HEARD_S * ages(hypotheses)


def ages(hypotheses: int) -> NDArray[np.float64]:
    """A memory of zeros, but for ones where the tracks have their ages."""
    marks = np.zeros(1 + hypotheses * HYPOTHESIS)
    marks[3::HYPOTHESIS] = marks[3 + TRACK :: HYPOTHESIS] = 1.0
    return marks


@register_jitable
def chosen_track(memory: NDArray[Any]) -> NDArray[Any]:
    """The track that is believed, a view."""
    start = 3 if memory[0] <= 0.0 else 3 + HYPOTHESIS
    return memory[start : start + TRACK]


@register_jitable
def _hypothesis(memory: NDArray[Any], index: int) -> NDArray[Any]:
    """Hypothesis 0 (ahead) or 1 (behind), a view."""
    return memory[1 + index * HYPOTHESIS : 1 + (index + 1) * HYPOTHESIS]


@register_jitable
def _track(hypothesis: NDArray[Any]) -> NDArray[Any]:
    """The track of a hypothesis, a view."""
    return hypothesis[2 : 2 + TRACK]


@register_jitable
def _outliers(hypothesis: NDArray[Any]) -> NDArray[Any]:
    """The track of a hypothesis' outliers, a view."""
    return hypothesis[2 + TRACK :]


@register_jitable
def _copy(values: NDArray[Any], out: NDArray[Any]) -> None:
    """An assignment to a slice compiles words about shapes too: seconds of it."""
    for k in range(len(out)):
        out[k] = values[k]


@register_jitable
def _predict(track: NDArray[Any], seconds: Any, fade: float, speed_std: float) -> None:
    """Moves a track on in time; its age stays."""
    variance = speed_std**2
    kept = np.exp(-seconds / fade)
    lost = 1.0 - kept
    gain = fade * lost
    axx, axy, ayy, cxx, cxy, cyx, cyy, vxx, vxy, vyy = track[5:15]
    added = fade * (2.0 * seconds - 2.0 * gain - fade * lost * lost) * variance
    track[1] += gain * track[3]
    track[2] += gain * track[4]
    track[3] *= kept
    track[4] *= kept
    track[5] = axx + gain * (2.0 * cxx + gain * vxx) + added
    track[6] = axy + gain * (cxy + cyx + gain * vxy)
    track[7] = ayy + gain * (2.0 * cyy + gain * vyy) + added
    track[8] = kept * (cxx + gain * vxx) + gain * lost * variance
    track[9] = kept * (cxy + gain * vxy)
    track[10] = kept * (cyx + gain * vxy)
    track[11] = kept * (cyy + gain * vyy) + gain * lost * variance
    left = (1.0 - kept * kept) * variance
    track[12] = kept * kept * vxx + left
    track[13] = kept * kept * vxy
    track[14] = kept * kept * vyy + left


@register_jitable
def _innovation(
    track: NDArray[Any], sighting: NDArray[Any], floor: float, scale: Any, extra: float
) -> tuple[Any, ...]:
    """What a sighting says that the track did not.

    Args:
        track: At the sighting's moment.
        sighting: The sighting.
        floor: Standard deviation added to the sighting's, m.
        scale: Factor of the sighting's covariance.
        extra: Variance added to the innovation's, m^2.

    Returns:
        Innovation (2); the inverse of its covariance (xx, xy, yy), which has
        rank one where there is no range; its normalised square, infinite where
        the track lies opposite to a bearing; the logarithm of the covariance's
        determinant.
    """
    zx, zy, rxx, rxy, ryy, ox, oy, _, _, ranged = sighting
    _, x, y, _, _, axx, axy, ayy = track[:8]
    if ranged > 0.0:
        ex, ey = zx - x, zy - y
        sxx = axx + scale * (rxx + floor * floor) + extra
        sxy = axy + scale * rxy
        syy = ayy + scale * (ryy + floor * floor) + extra
        spread = sxx * syy - sxy * sxy
        wxx, wxy, wyy = syy / spread, -sxy / spread, sxx / spread
    else:
        dx, dy = x - ox, y - oy
        along, missed = zx * dx + zy * dy, zy * dx - zx * dy
        ex, ey = -zy * missed, zx * missed
        spread = zy * zy * axx - 2.0 * zx * zy * axy + zx * zx * ayy
        across = along * along * (rxx + ryy) + floor * floor
        spread += scale * across + extra
        wxx, wxy, wyy = zy * zy / spread, -zx * zy / spread, zx * zx / spread
        if along <= 0.0:
            return ex, ey, wxx, wxy, wyy, np.inf, 0.0
    squared = wxx * ex * ex + 2.0 * wxy * ex * ey + wyy * ey * ey
    return ex, ey, wxx, wxy, wyy, squared, np.log(spread)


@register_jitable
def _robust_innovation(
    track: NDArray[Any], sighting: NDArray[Any], settings: FilterSettings
) -> tuple[bool, Any, tuple[Any, ...]]:
    """The innovation as the filter uses it.

    One that chance would exceed in 1 % of the cases is not what the model
    says: its sighting counts less, so that its pull stays bounded (Huber's
    weight). Outside the gate that ``gate_floor`` widens it does not count.

    Returns:
        Whether it counts; its normalised square before the sighting's weight;
        the innovation.
    """
    floor, scale = settings.floor, track[15]
    found = _innovation(track, sighting, floor, scale, 0.0)
    squared = found[5]
    if squared <= GATE:
        return True, squared, found
    extra = settings.gate_floor**2
    if _innovation(track, sighting, floor, scale, extra)[5] > GATE:
        return False, squared, found
    scale *= np.sqrt(squared / GATE)
    return True, squared, _innovation(track, sighting, floor, scale, 0.0)


@register_jitable
def _learn_scatter(track: NDArray[Any], squared: Any, dimensions: Any) -> None:
    """Matches the sightings' covariance to their innovations.

    Reflections scatter estimates far beyond what noise does. Innovations that
    exceed their covariance by ``SCATTER_MARGIN`` raise the factor, others lower
    it, within some ``1 / SCATTER_RATE`` sightings.
    """
    excess = min(squared, GATE) / (dimensions * SCATTER_MARGIN)
    track[15] = max(1.0, track[15] * (1.0 + SCATTER_RATE * (excess - 1.0)))


@register_jitable
def _correct(track: NDArray[Any], found: tuple[Any, ...]) -> None:
    """The Kalman correction by an innovation."""
    ex, ey, wxx, wxy, wyy, _, _ = found
    axx, axy, ayy, cxx, cxy, cyx, cyy = track[5:12]
    # Gains: A W for the position, C^T W for the velocity.
    pxx, pxy = axx * wxx + axy * wxy, axx * wxy + axy * wyy
    pyx, pyy = axy * wxx + ayy * wxy, axy * wxy + ayy * wyy
    qxx, qxy = cxx * wxx + cyx * wxy, cxx * wxy + cyx * wyy
    qyx, qyy = cxy * wxx + cyy * wxy, cxy * wxy + cyy * wyy
    track[1] += pxx * ex + pxy * ey
    track[2] += pyx * ex + pyy * ey
    track[3] += qxx * ex + qxy * ey
    track[4] += qyx * ex + qyy * ey
    track[5] -= pxx * axx + pxy * axy
    track[6] -= pxx * axy + pxy * ayy
    track[7] -= pyx * axy + pyy * ayy
    track[8] -= pxx * cxx + pxy * cyx
    track[9] -= pxx * cxy + pxy * cyy
    track[10] -= pyx * cxx + pyy * cyx
    track[11] -= pyx * cxy + pyy * cyy
    track[12] -= qxx * cxx + qxy * cyx
    track[13] -= qxx * cxy + qxy * cyy
    track[14] -= qyx * cxy + qyy * cyy


@register_jitable
def _begin(
    track: NDArray[Any], sighting: NDArray[Any], settings: FilterSettings
) -> None:
    """Makes a track of a source that is heard for the first time."""
    zx, zy, rxx, rxy, ryy, ox, oy, _, _, ranged = sighting
    track[:] = 0.0
    track[0] = settings.measurement_age
    if ranged > 0.0:
        track[1], track[2] = zx, zy
        track[5], track[6], track[7] = rxx, rxy, ryy
    else:
        # From nothing to twice as far is within two standard deviations.
        distance, along = settings.assumed_range, settings.assumed_range**2 / 4.0
        track[1], track[2] = ox + distance * zx, oy + distance * zy
        track[5] = distance**2 * rxx + along * zx * zx
        track[6] = distance**2 * rxy + along * zx * zy
        track[7] = distance**2 * ryy + along * zy * zy
    track[5] += settings.floor**2
    track[7] += settings.floor**2
    track[12] = track[14] = settings.speed_std**2
    track[15] = 1.0


@register_jitable
def _follow(
    track: NDArray[Any], sighting: NDArray[Any], settings: FilterSettings
) -> tuple[bool, Any]:
    """Feeds one track; whether the sighting can belong to it (else: no change)."""
    moved = track.copy()
    seconds = track[0] - settings.measurement_age
    _predict(moved, seconds, settings.velocity_fade, settings.speed_std)
    counts, squared, found = _robust_innovation(moved, sighting, settings)
    if counts:
        _correct(moved, found)
        _learn_scatter(moved, squared, 1.0 + sighting[9])
        moved[0] = settings.measurement_age
        _copy(moved, track)
    return counts, 0.5 * (found[5] + found[6])


@register_jitable
def _mirrored(sighting: NDArray[Any]) -> NDArray[Any]:
    """The sighting behind the row that gives the same delays."""
    zx, zy, rxx, rxy, ryy, ox, oy, nx, ny, ranged = sighting
    image = sighting.copy()
    ahead = nx * (zx - ranged * ox) + ny * (zy - ranged * oy)
    image[0] = zx - 2.0 * ahead * nx
    image[1] = zy - 2.0 * ahead * ny
    mx, my = nx * rxx + ny * rxy, nx * rxy + ny * ryy
    both = nx * mx + ny * my
    image[2] = rxx - 4.0 * nx * mx + 4.0 * both * nx * nx
    image[3] = rxy - 2.0 * (nx * my + ny * mx) + 4.0 * both * nx * ny
    image[4] = ryy - 4.0 * ny * my + 4.0 * both * ny * ny
    return image


@register_jitable
def _inherit(
    memory: NDArray[Any],
    before: NDArray[Any],
    index: int,
    candidate: NDArray[Any],
    settings: FilterSettings,
) -> tuple[Any, Any, int]:
    """Continues the likelier of the histories that a hypothesis can have.

    Args:
        memory: Changed: the hypothesis.
        before: A copy of the memory of before.
        index: Of the hypothesis.
        candidate: The sighting as the hypothesis reads it.
        settings: ``FilterSettings``.

    Returns:
        Cost of the history, what the sighting adds to it (infinity where it is
        an outlier to every history), and the index of the history.
    """
    child = _hypothesis(memory, index)
    cost, step, history = child[0], np.inf, index
    for k in range(len(memory) // HYPOTHESIS):
        parent = _hypothesis(before, k).copy()
        counts, added = _follow(_track(parent), candidate, settings)
        if counts and parent[0] + added < cost + step:
            cost, step, history = parent[0], added, k
            _copy(parent, child)
    outliers = _outliers(child)
    if step == np.inf:
        if child[1] > 0.0 and _follow(outliers, candidate, settings)[0]:
            child[1] += 1.0
        else:
            _begin(outliers, candidate, settings)
            child[1] = 1.0
        if child[1] < settings.believed_outliers:
            return cost, step, history
        _copy(outliers, _track(child))
    child[1] = 0.0
    outliers[:] = 0.0
    outliers[0] = NEVER_HEARD_S
    return cost, step, history


@register_jitable
def _choose(
    memory: NDArray[Any],
    front: tuple[Any, Any, int],
    back: tuple[Any, Any, int],
    largest: float,
) -> None:
    """Updates costs and choice from what ``_inherit`` says of both hypotheses.

    Args:
        memory: Changed.
        front: Cost, step and history of hypothesis 0.
        back: The same of hypothesis 1.
        largest: By how much this sighting can speak against one of them, nepers.
    """
    lead = front[0] - back[0]
    least = min(front[1], back[1])
    if least < np.inf:
        lead += min(front[1] - least, largest)
        lead -= min(back[1] - least, largest)
    elif _hypothesis(memory, 0)[1] <= 0.0:
        lead = 0.0  # a target that jumped may have jumped over
    _hypothesis(memory, 0)[0] = min(max(lead, 0.0), LARGEST_COST)
    _hypothesis(memory, 1)[0] = min(max(-lead, 0.0), LARGEST_COST)
    behind = memory[0] > 0.0
    own, other = (back, front) if behind else (front, back)
    if own[1] == np.inf and other[1] < np.inf and other[2] == int(behind):
        # The other candidate alone continues the target: it crossed the line.
        memory[0] = 1.0 - memory[0]
    else:
        margin = -SWITCH_MARGIN if behind else SWITCH_MARGIN
        memory[0] = 1.0 if lead > margin else 0.0


@njit(cache=True)
def fold(
    memory: NDArray[Any], sighting: NDArray[Any], settings: FilterSettings
) -> bool:
    """Folds a sighting into the memory.

    Args:
        memory: (1 + HYPOTHESIS,) or (1 + 2 HYPOTHESIS,), changed; its ages are those
            of the moment the sighting arrives.
        sighting: (10,) see the module's docstring.
        settings: ``FilterSettings``.

    Returns:
        Whether the chosen track has taken it up.
    """
    both = len(memory) > 1 + HYPOTHESIS
    image = _mirrored(sighting)
    if chosen_track(memory)[0] >= NEVER_HEARD_S:
        _begin(_track(_hypothesis(memory, 0)), sighting, settings)
        if both:
            _begin(_track(_hypothesis(memory, 1)), image, settings)
        return True
    silence = chosen_track(memory)[0] - settings.measurement_age
    before = memory.copy()
    front = _inherit(memory, before, 0, sighting, settings)
    if both:
        back = _inherit(memory, before, 1, image, settings)
        largest = LARGEST_FRESH_STEP if silence > SILENCE_S else LARGEST_STEP
        _choose(memory, front, back, largest)
    return chosen_track(memory)[0] == settings.measurement_age


@njit(cache=True)
def expected(
    memory: NDArray[Any], velocity_fade: float, speed_std: float
) -> NDArray[Any]:
    """A copy of the chosen track as it is expected to be now.

    Args:
        memory: (1 + HYPOTHESIS,) or (1 + 2 HYPOTHESIS,); its ages are those of now.
        velocity_fade: See ``FilterSettings``, s.
        speed_std: The same, m/s.

    Returns:
        (TRACK,) elements as in TRACK_NAMES; of a track that never heard anything a
        mere copy.
    """
    track = chosen_track(memory).copy()
    if track[0] < NEVER_HEARD_S:
        _predict(track, track[0], velocity_fade, speed_std)
    return track
