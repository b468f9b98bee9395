"""Velocities of objects, from where they are tick by tick."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.ranging.beam_groups import (
    CHORD,
    EXTENT,
    MIDDLE_X,
    MIDDLE_Y,
    NEAR_X,
    NEAR_Y,
    OPEN,
)
from systems.ranging.objects import KNOWN, RADIUS, THERE, VX, VY, X, Y, nearest_objects
from systems.ranging.parameters import OBJECT_SIZE

#: Tracks, and numbers of one: whether it exists; for how long its motion was seen, and
#: for how long it was not seen at all, s; its nearest point in W, m; its radius and how
#: far behind its surface the place of its state is, m; its state of place and velocity,
#: m and m/s, and the covariance of these, row by row.
TRACKS = 12
_EXISTS, _SURE, _UNSEEN, _QX, _QY, _RADIUS, _DEPTH, _STATE = range(8)
_COVARIANCE = _STATE + 4
TRACK_SIZE = _COVARIANCE + 16

#: Standard deviations: of a velocity at first, m/s, and of how far along a surface a
#: hit is that may go on, m.
_FIRST_M_S, _ANYWHERE_M = 0.5, 10.0
#: In which what an object's place is behind its nearest point follows what is seen, s.
_DEPTH_S = 4.0
#: In which a motion along a surface that cannot be seen any more is forgotten.
_FORGET_S = 5.0


class TrackNumbers(NamedTuple):
    """How objects are followed."""

    gate_m: float
    """A group farther from where a track is to be is another object's, m."""
    wide_m: float
    """Of what is wider, the motion along it cannot be seen, m."""
    coarse_m: float
    """Where beams are farther apart, motion cannot be seen, m."""
    noise_m: float
    """Standard deviation of a group's distance, m."""
    walk: float
    """Variance by which a component of a velocity changes, (m/s)^2/s."""
    confirmation_s: float
    """A velocity is known when it could be seen for so long, s."""
    memory_s: float
    """What is not seen is there for so long, s."""
    resting_m_s: float
    """Objects slower than this count as at rest, m/s."""
    tick_s: float


@njit(cache=True)
def _move_on(track: Any, own: TrackNumbers) -> None:  # pragma: no cover  (compiled)
    """To the next tick: constant velocity, but for white noise of acceleration."""
    t = own.tick_s
    track[_UNSEEN] += t
    state, p = track[_STATE:_COVARIANCE], track[_COVARIANCE:].reshape(4, 4)
    for i in range(2):
        track[_QX + i] += t * state[2 + i]
        state[i] += t * state[2 + i]
    for i in range(4):
        for j in range(2):
            p[j, i] += t * p[2 + j, i]
    for i in range(4):
        for j in range(2):
            p[i, j] += t * p[i, 2 + j]
    for i in range(2):
        p[i, i] += own.walk * t**3 / 3.0
        p[i, 2 + i] += own.walk * t**2 / 2.0
        p[2 + i, i] += own.walk * t**2 / 2.0
        p[2 + i, 2 + i] += own.walk * t


@njit(cache=True)
def _correct(
    track: Any, off: float, h: Any, variance: float
) -> None:  # pragma: no cover  (compiled)
    """Takes in how far off a place is along a unit vector, m."""
    state, p = track[_STATE:_COVARIANCE], track[_COVARIANCE:].reshape(4, 4)
    gain = p[:, 0] * h[0] + p[:, 1] * h[1]
    total = gain[0] * h[0] + gain[1] * h[1] + variance
    for i in range(4):
        state[i] += gain[i] / total * off
    for i in range(4):
        for j in range(4):
            p[i, j] -= gain[i] * gain[j] / total


@njit(cache=True)
def _turn_surface(
    track: Any, p_WP: Any, along: Any, own: TrackNumbers
) -> None:  # pragma: no cover  (compiled)
    """The place of a surface slides to where it is nearest now, as far from P.

    By the noise of ranges it slides to and fro by more than a beam, and only how far it
    is tells of motion. What is known of that goes with it; of motion along the surface
    nothing is, and it comes to count as none.
    """
    state, p = track[_STATE:_COVARIANCE], track[_COVARIANCE:].reshape(4, 4)
    x, y = state[0] - p_WP[0], state[1] - p_WP[1]
    far = max(math.hypot(x, y), 1e-9)
    old = np.array([x / far, y / far])
    new, across = np.array([along[0], along[1]]), np.array([-along[1], along[0]])
    old_across = np.array([-old[1], old[0]])
    outer, outer_across = np.outer(new, new), np.outer(across, across)
    for i in range(2):
        for j in range(2):
            part = p[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].copy()
            aside = 0.0
            if i == j:
                aside = np.sum(part * np.outer(old_across, old_across))
            # Where along the surface tells nothing of the middle of what is seen.
            if i == 0 and j == 0:
                aside = _ANYWHERE_M**2
            towards = np.sum(part * np.outer(old, old))
            p[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = (
                towards * outer + aside * outer_across
            )
    state[0], state[1] = p_WP[0] + far * along[0], p_WP[1] + far * along[1]
    aside_m_s = along[0] * state[3] - along[1] * state[2]
    lost = own.tick_s / _FORGET_S * aside_m_s
    state[2] += lost * along[1]
    state[3] -= lost * along[0]


@njit(cache=True)
def _hides_motion(
    group: Any, own: TrackNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Whether motion along a group's surface cannot be seen."""
    wide = group[OPEN] > 0.5 or group[EXTENT] > own.wide_m
    return bool(wide or group[CHORD] > own.coarse_m)


@njit(cache=True)
def _take_in(
    track: Any, group: Any, p_WP: Any, own: TrackNumbers
) -> None:  # pragma: no cover  (compiled)
    """A group that is a track's, or begins it."""
    wide = _hides_motion(group, own)
    sure = group[CHORD] < own.coarse_m and (not wide or group[EXTENT] > 0.0)
    near = math.hypot(group[NEAR_X], group[NEAR_Y])
    far = max(math.hypot(group[MIDDLE_X], group[MIDDLE_Y]), 1e-9)
    if track[_EXISTS] < 0.5:
        track[:] = 0.0
        track[_DEPTH] = far - near
    track[_DEPTH] += own.tick_s / _DEPTH_S * (far - near - track[_DEPTH])
    x, y = group[NEAR_X], group[NEAR_Y]
    if not wide:
        # The middle of what is seen, but not its distance: that jumps when a beam
        # comes to hit another side.
        part = (near + track[_DEPTH]) / far
        x, y = part * group[MIDDLE_X], part * group[MIDDLE_Y]
    far = max(math.hypot(x, y), 1e-9)
    along = x / far, y / far
    place = p_WP[0] + x, p_WP[1] + y
    if track[_EXISTS] < 0.5:
        track[_EXISTS] = 1.0
        track[_STATE], track[_STATE + 1] = place
        p = track[_COVARIANCE:].reshape(4, 4)
        for i in range(2):
            p[i, i] = _ANYWHERE_M**2
            p[2 + i, 2 + i] = _FIRST_M_S**2
    if wide:
        _turn_surface(track, p_WP, along, own)
    dx, dy = place[0] - track[_STATE], place[1] - track[_STATE + 1]
    _correct(track, dx * along[0] + dy * along[1], along, own.noise_m**2)
    if not wide:
        across = -along[1], along[0]
        dx, dy = place[0] - track[_STATE], place[1] - track[_STATE + 1]
        aside = own.noise_m + group[CHORD]
        _correct(track, dx * across[0] + dy * across[1], across, aside**2)
    track[_SURE] = track[_SURE] + own.tick_s if sure else 0.0
    track[_UNSEEN] = 0.0
    track[_QX], track[_QY] = p_WP[0] + group[NEAR_X], p_WP[1] + group[NEAR_Y]
    flat = group[EXTENT] > own.wide_m
    track[_RADIUS] = 0.0 if flat else 0.5 * (group[EXTENT] + group[CHORD])


@njit(cache=True)
def _tracks_of(
    tracks: Any, groups: Any, p_WP: Any, own: TrackNumbers
) -> NDArray[np.int64]:  # pragma: no cover  (compiled)
    """(n,) track of each group, each once, the nearest pairs first; -1: none."""
    count = len(groups)
    away = np.full((count, TRACKS), np.inf)
    for g in range(count):
        x, y = p_WP[0] + groups[g, MIDDLE_X], p_WP[1] + groups[g, MIDDLE_Y]
        if _hides_motion(groups[g], own):
            x, y = p_WP[0] + groups[g, NEAR_X], p_WP[1] + groups[g, NEAR_Y]
        for t in range(TRACKS):
            if tracks[t, _EXISTS] > 0.5:
                dx, dy = x - tracks[t, _STATE], y - tracks[t, _STATE + 1]
                away[g, t] = math.hypot(dx, dy)
    of = np.full(count, -1)
    for _ in range(min(count, TRACKS)):
        best = int(np.argmin(away))
        g, t = best // TRACKS, best % TRACKS
        if away[g, t] > own.gate_m:
            break
        of[g] = t
        away[g, :] = np.inf
        away[:, t] = np.inf
    return of


@njit(cache=True)
def track_objects(
    tracks: Any, groups: Any, p_WP: Any, own: TrackNumbers
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Follows objects by a tick.

    A Kalman filter of constant velocity each (Bar-Shalom, Li and Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, 6.2.2), in W, so that
    the robot's own motion is none of theirs. A beam tells how far, but not
    where between its neighbours: the place is good towards P and, across, as coarse as
    the beams. Of what is wide, or may go on beyond what is seen, motion along the
    surface cannot be seen and stays what it was, at first none. One beam on a surface
    takes motion along it for motion towards P, the more the more oblique it is: where
    beams are far apart, and of a single hit that may be one of a longer surface, no
    velocity is known.

    Args:
        tracks: (TRACKS, TRACK_SIZE), changed.
        groups: (n, GROUP_SIZE) of ``group_beams``.
        p_WP: (x, y) m.
        own: How they are followed.

    Returns:
        (OBJECT_SLOTS, OBJECT_SIZE) objects, nearest first.
    """
    for t in range(TRACKS):
        if tracks[t, _EXISTS] > 0.5:
            _move_on(tracks[t], own)
            if tracks[t, _UNSEEN] > own.memory_s + 0.5 * own.tick_s:
                tracks[t, _EXISTS] = 0.0
    of = _tracks_of(tracks, groups, p_WP, own)
    for g in range(len(groups)):
        if of[g] >= 0:
            _take_in(tracks[of[g]], groups[g], p_WP, own)
    for g in range(len(groups)):
        if of[g] < 0:
            # The place of none, or of what was not seen for longest.
            rank = np.where(tracks[:, _EXISTS] > 0.5, tracks[:, _UNSEEN], np.inf)
            free = int(np.argmax(rank))
            if rank[free] == 0.0:
                continue
            tracks[free, _EXISTS] = 0.0
            _take_in(tracks[free], groups[g], p_WP, own)
    slots = np.zeros((TRACKS, OBJECT_SIZE))
    for t in range(TRACKS):
        track, slot = tracks[t], slots[t]
        if track[_EXISTS] < 0.5:
            continue
        slot[THERE], slot[RADIUS] = 1.0, track[_RADIUS]
        slot[X], slot[Y] = track[_QX] - p_WP[0], track[_QY] - p_WP[1]
        if track[_SURE] > own.confirmation_s - 0.5 * own.tick_s:
            slot[KNOWN] = 1.0
            vx, vy = track[_STATE + 2], track[_STATE + 3]
            if math.hypot(vx, vy) > own.resting_m_s:
                slot[VX], slot[VY] = vx, vy
    return nearest_objects(slots)
