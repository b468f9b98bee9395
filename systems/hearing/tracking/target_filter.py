"""Tracks a moving source by a Kalman filter, with front and back as two hypotheses.

The velocity of the source fades and is driven by white acceleration (an
Ornstein-Uhlenbeck process). The same model is used at every speed of the source. The
standard deviation of the velocity stays bounded, however long the source is silent.

A row of microphones gives two candidates for the position: the position ahead and its
mirror image behind the row. Hypothesis 0 says that the source is ahead now. Hypothesis
1 says that it is behind. Each hypothesis keeps the better of the two histories that
lead to it (the Viterbi recursion). When the robot moves, the mirror image moves too,
which is unlikely for a source.

The cost of a hypothesis is a negative log-likelihood. The innovation is the difference
between an estimate and its prediction. Each innovation adds half of the sum of two
terms: the squared normalized innovation, and the logarithm of the determinant of its
covariance.

All functions use only flat arrays and numbers. numba therefore compiles them for
floats, and ``fold.py_func`` and ``expected.py_func`` run them with AutoDiffXd. ``fold``
and its helper functions change arrays in place.

The arrays have these layouts, in m and s, in the world frame W. The number of elements
is in parentheses.

A track (16) has these elements:

- age of the last estimate (1);
- position (2), velocity (2), covariance of the position (xx, xy, yy), covariance of
  position and velocity (xx, xy, yx, yy), and covariance of the velocity (xx, xy, yy),
  all at the moment of the last estimate;
- scatter (1), the ratio of the actual variance of estimates to their stated covariance.

A hypothesis (34) has these elements:

- cost (1);
- number of consecutive outliers that agree (1);
- track (16), and track of these outliers (16).

A memory has these elements:

- index of the chosen hypothesis (1);
- one hypothesis, or two hypotheses if front and back are to be distinguished.

A sighting (10) is an estimate of the position from one audio frame. It has these
elements:

- position of the source, or the unit vector to the source if there is no range (2);
- covariance of this position (xx, xy, yy);
- center of the microphones (2);
- unit normal of the row of microphones, which points ahead (2);
- 1 if there is a range, otherwise 0 (1).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit

#: Names of the elements of a track.
TRACK_NAMES = (
    *("age", "x", "y", "vx", "vy"),
    *("Axx", "Axy", "Ayy", "Cxx", "Cxy", "Cyx", "Cyy", "Vxx", "Vxy", "Vyy"),
    "scatter",
)
TRACK = len(TRACK_NAMES)
HYPOTHESIS = 2 + 2 * TRACK

#: Age of a track that never had a sighting, s. It is finite and exceeds every limit.
NEVER_HEARD_S = 1e6
#: Standard deviation of each component of the velocity of a source, m/s. It is half the
#: speed of a fast source.
SPEED_STD = 0.35
#: Time constant with which a velocity is forgotten, s.
VELOCITY_FADE_S = 5.0
#: Assumed range of the first target if only its bearing is known, m.
ASSUMED_RANGE_M = 3.0
#: Standard deviation that is added to the covariances in the test for outliers, m.
GATE_FLOOR_M = 0.2
#: Number of consecutive outliers that are accepted if they agree with each other.
BELIEVED_OUTLIERS = 3
#: Squared normalized innovation in two dimensions that chance exceeds in 1 % of the
#: cases.
GATE = 9.21
#: Largest ratio of the variance of innovations to their covariance at which both agree.
SCATTER_MARGIN = 1.5
#: Each sighting changes the scatter by this share of the relative excess over
#: ``SCATTER_MARGIN``. A burst has 20 sightings.
SCATTER_RATE = 0.05
#: Largest cost that one sighting can add to a hypothesis, nepers. A single wrong frame
#: says little, whatever its covariance.
LARGEST_STEP = 1.0
#: The same limit for a sighting after a silence of more than ``SILENCE_S`` seconds,
#: nepers. Such a sighting is independent of the previous ones.
LARGEST_FRESH_STEP = 4.0
SILENCE_S = 0.5
#: Lead in cost, in nepers, that the other hypothesis needs before the choice changes.
SWITCH_MARGIN = 3.0
#: Largest cost of a hypothesis, nepers. Because of this limit, errors of the model
#: cannot exclude a hypothesis forever.
LARGEST_COST = 12.0


class FilterSettings(NamedTuple):
    """Properties of the sightings of one kind of hearing."""

    floor: float
    """Standard deviation of errors that are not in the covariance of a sighting, m."""
    measurement_age: float
    """Time from the moment of a sighting to its arrival, s."""


def blank_memory(hypotheses: int) -> NDArray[np.float64]:
    """Returns the memory before anything is heard, for one or two hypotheses."""
    return NEVER_HEARD_S * ages(hypotheses)


def ages(hypotheses: int) -> NDArray[np.float64]:
    """Returns a memory of zeros, with ones as the ages of the tracks."""
    marks = np.zeros(1 + hypotheses * HYPOTHESIS)
    marks[3::HYPOTHESIS] = marks[3 + TRACK :: HYPOTHESIS] = 1.0
    return marks


@register_jitable
def chosen_track(memory: NDArray[Any]) -> NDArray[Any]:
    """Returns the track of the chosen hypothesis, a view."""
    start = 3 if memory[0] < 0.5 else 3 + HYPOTHESIS
    return memory[start : start + TRACK]


@register_jitable
def _hypothesis(memory: NDArray[Any], index: int) -> NDArray[Any]:
    """Returns hypothesis 0 (ahead) or 1 (behind), a view."""
    return memory[1 + index * HYPOTHESIS : 1 + (index + 1) * HYPOTHESIS]


@register_jitable
def _track(hypothesis: NDArray[Any]) -> NDArray[Any]:
    """Returns the track of a hypothesis, a view."""
    return hypothesis[2 : 2 + TRACK]


@register_jitable
def _outliers(hypothesis: NDArray[Any]) -> NDArray[Any]:
    """Returns the track of the outliers of a hypothesis, a view."""
    return hypothesis[2 + TRACK :]


@register_jitable
def _copy(values: NDArray[Any], out: NDArray[Any]) -> None:
    """Copies values in a loop, because a slice takes seconds to compile."""
    for k in range(len(out)):
        out[k] = values[k]


@register_jitable
def _predict(track: NDArray[Any], seconds: Any) -> None:
    """Predicts a track some seconds ahead; its age stays unchanged."""
    fade, variance = VELOCITY_FADE_S, SPEED_STD**2
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
    """Compares a sighting (estimate of the position from one audio frame) with a track.

    With a range, the innovation is the difference of the positions. Without a range, it
    is the offset from the track to the line of the bearing.

    Args:
        track: Track at the moment of the sighting.
        sighting: The sighting.
        floor: Standard deviation of errors that are not in the covariance of the
            sighting, m.
        scale: Factor of the covariance of the sighting.
        extra: Variance added to that of the innovation, m^2.

    Returns:
        Seven numbers: the innovation (2); the inverse of its covariance (xx, xy, yy);
        the squared normalized innovation; and the logarithm of the determinant of the
        covariance. Without a range, the inverse has rank one. If the track is in the
        direction opposite to the bearing, the squared innovation is infinite.
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
    """Computes the innovation that the filter uses, and limits the effect of outliers.

    A squared normalized innovation above ``GATE`` does not agree with the model. If it
    remains above ``GATE`` even with the additional standard deviation ``GATE_FLOOR_M``,
    the filter rejects the sighting. Otherwise the sighting gets a larger covariance, so
    that its effect stays bounded (Huber's weight).

    Returns:
        Three values: whether the sighting is accepted; the squared normalized
        innovation with the original covariance; and the result of ``_innovation``.
    """
    floor, scale = settings.floor, track[15]
    found = _innovation(track, sighting, floor, scale, 0.0)
    squared = found[5]
    if squared <= GATE:
        return True, squared, found
    extra = GATE_FLOOR_M**2
    if _innovation(track, sighting, floor, scale, extra)[5] > GATE:
        return False, squared, found
    scale *= np.sqrt(squared / GATE)
    return True, squared, _innovation(track, sighting, floor, scale, 0.0)


@register_jitable
def _learn_scatter(track: NDArray[Any], squared: Any, dimensions: Any) -> None:
    """Adapts the scatter of a track to the innovations.

    The scatter is the ratio of the actual variance of estimates to their stated
    covariance. Reflections scatter estimates far more than noise does. The scatter
    rises if the squared normalized innovation is above ``SCATTER_MARGIN`` times its
    expected value. Otherwise it falls, but not below 1. It adapts within about
    ``1 / SCATTER_RATE`` sightings (estimates).
    """
    excess = min(squared, GATE) / (dimensions * SCATTER_MARGIN)
    track[15] = max(1.0, track[15] * (1.0 + SCATTER_RATE * (excess - 1.0)))


@register_jitable
def _correct(track: NDArray[Any], found: tuple[Any, ...]) -> None:
    """Applies the Kalman correction of an innovation."""
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
    """Starts a track with the first sighting of a source."""
    zx, zy, rxx, rxy, ryy, ox, oy, _, _, ranged = sighting
    track[:] = 0.0
    track[0] = settings.measurement_age
    if ranged > 0.0:
        track[1], track[2] = zx, zy
        track[5], track[6], track[7] = rxx, rxy, ryy
    else:
        # The ranges 0 and twice the assumed range are two standard deviations from the
        # assumed range.
        distance, along = ASSUMED_RANGE_M, ASSUMED_RANGE_M**2 / 4.0
        track[1], track[2] = ox + distance * zx, oy + distance * zy
        track[5] = distance**2 * rxx + along * zx * zx
        track[6] = distance**2 * rxy + along * zx * zy
        track[7] = distance**2 * ryy + along * zy * zy
    track[5] += settings.floor**2
    track[7] += settings.floor**2
    track[12] = track[14] = SPEED_STD**2
    track[15] = 1.0


@register_jitable
def _follow(
    track: NDArray[Any], sighting: NDArray[Any], settings: FilterSettings
) -> tuple[bool, Any]:
    """Updates one track with a sighting (estimate of the position) that it accepts.

    The function returns whether the track accepts the sighting, and the cost that the
    sighting adds. A track that rejects the sighting does not change.
    """
    moved = track.copy()
    seconds = track[0] - settings.measurement_age
    _predict(moved, seconds)
    counts, squared, found = _robust_innovation(moved, sighting, settings)
    if counts:
        _correct(moved, found)
        _learn_scatter(moved, squared, 1.0 + sighting[9])
        moved[0] = settings.measurement_age
        _copy(moved, track)
    return counts, 0.5 * (found[5] + found[6])


@register_jitable
def _mirrored(sighting: NDArray[Any]) -> NDArray[Any]:
    """Returns the sighting on the other side of the row, which has the same delays."""
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
    """Updates one of the two hypotheses of the filter with a sighting.

    A sighting is an estimate of the position. The hypotheses are that the source is
    ahead (0) or behind (1). Either previous hypothesis may lead to the updated
    hypothesis, so there are two histories. The function continues the likelier history.

    If the sighting is an outlier to both histories, the function updates the track of
    the outliers instead. After enough consecutive outliers that agree, their track
    replaces the track of the hypothesis.

    Args:
        memory: Memory of the filter. The function changes the hypothesis ``index``.
        before: Copy of the memory before the sighting.
        index: Index of the hypothesis.
        candidate: The sighting for hypothesis 0, or its mirror image for hypothesis 1.
        settings: Floor of the errors, and age of the sightings.

    Returns:
        Three values: cost of the history; cost that the sighting adds, infinite if it
        is an outlier to both histories; and index of the history.
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
        if child[1] < BELIEVED_OUTLIERS:
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
    """Updates the costs of both hypotheses, and chooses between them.

    The hypotheses are that the source is ahead (0) or behind (1). Each hypothesis has
    one candidate for the position of the source: the sighting for hypothesis 0, and its
    mirror image for hypothesis 1. The choice changes if the chosen hypothesis costs
    more than the other by ``SWITCH_MARGIN``. It also changes if only the candidate of
    the other hypothesis continues the track of the chosen hypothesis.

    Args:
        memory: Memory of the filter, which the function changes.
        front: Result of ``_inherit`` for hypothesis 0: cost, added cost and history.
        back: Result of ``_inherit`` for hypothesis 1.
        largest: Largest cost that this sighting can add to one hypothesis, nepers.
    """
    lead = front[0] - back[0]
    least = min(front[1], back[1])
    if least < np.inf:
        lead += min(front[1] - least, largest)
        lead -= min(back[1] - least, largest)
    elif _hypothesis(memory, 0)[1] <= 0.0:
        lead = 0.0  # after a jump, the side is unknown
    _hypothesis(memory, 0)[0] = min(max(lead, 0.0), LARGEST_COST)
    _hypothesis(memory, 1)[0] = min(max(-lead, 0.0), LARGEST_COST)
    behind = memory[0] > 0.0
    own, other = (back, front) if behind else (front, back)
    if own[1] == np.inf and other[1] < np.inf and other[2] == int(behind):
        # Only the other candidate continues the target, which therefore crossed the
        # line.
        memory[0] = 1.0 - memory[0]
    else:
        margin = -SWITCH_MARGIN if behind else SWITCH_MARGIN
        memory[0] = 1.0 if lead > margin else 0.0


@njit(cache=True)
def fold(
    memory: NDArray[Any], sighting: NDArray[Any], settings: FilterSettings
) -> bool:
    """Updates the memory of the filter with a sighting (estimate of the position).

    Args:
        memory: (1 + HYPOTHESIS,) or (1 + 2 HYPOTHESIS,) memory of one or two
            hypotheses. The function changes the memory. The ages of the tracks are
            those at the arrival of the sighting.
        sighting: (10,) sighting, see the docstring of the module.
        settings: Floor of the errors, and age of the sightings.

    Returns:
        Whether the chosen track has accepted the sighting.
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
def expected(memory: NDArray[Any]) -> NDArray[Any]:
    """Returns a copy of the chosen track of the source, predicted to the present.

    Args:
        memory: (1 + HYPOTHESIS,) or (1 + 2 HYPOTHESIS,) memory of one or two
            hypotheses. The ages of the tracks are those at present.

    Returns:
        (TRACK,) elements in the order of ``TRACK_NAMES``. The track of a source that
        was never heard is not predicted.
    """
    track = chosen_track(memory).copy()
    if track[0] < NEVER_HEARD_S:
        _predict(track, track[0])
    return track
