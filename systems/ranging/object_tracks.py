"""Tracking of objects over several control periods, which yields their velocities."""

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

#: Largest number of tracks.
TRACKS = 12
#: Largest distance between a group of hits and the predicted position of its track, m.
#: A group that is farther away is another object.
_GATE_M = 0.3
#: Width of an object above which its motion along its surface is not visible, m.
_WIDE_M = 0.8
#: Spacing of the beams above which motion is not visible, m.
_COARSE_M = 0.25
#: Standard deviation of the distance of an object, m. This error comes in addition to
#: the noise of the ranges, because the beams hit different points of an object from
#: tick to tick.
NOISE_M = 0.04
#: Rate at which the variance of each velocity component grows, (m/s)^2/s. The standard
#: deviation grows to 0.1 m/s within one second.
_WALK = 0.1**2
#: The velocity of an object is known after its motion has been visible without
#: interruption for this time, s.
_CONFIRMATION_S = 0.5
#: Time for which a track is kept after its object was last seen, s.
_MEMORY_S = 0.5
#: Speed below which an object counts as at rest, m/s.
_RESTING_M_S = 0.05

# Indices of the elements of a track.
# ``EXISTS``: 1 if the track exists, otherwise 0.
# ``SURE``: time for which the motion has been visible without interruption, s.
# ``UNSEEN``: time since the object was last seen, s.
# ``QX``, ``QY``: position of the nearest point of the object in W, m.
# ``RADIUS``: radius of the object, m.
# ``DEPTH``: distance from the nearest point to the tracked position, away from P, m.
# ``STATE``: position and velocity of the object in W, m and m/s.
# ``COVARIANCE``: 4 x 4 covariance of ``STATE``, row by row.
_EXISTS, _SURE, _UNSEEN, _QX, _QY, _RADIUS, _DEPTH, _STATE = range(8)
_COVARIANCE = _STATE + 4
TRACK_SIZE = _COVARIANCE + 16

# ``_FIRST_M_S``: standard deviation of each component of an initial velocity, m/s.
# ``_ANYWHERE_M``: standard deviation of an unknown position along a surface, m.
_FIRST_M_S, _ANYWHERE_M = 0.5, 10.0
# Time constant with which the depth of a track follows the measured depth, s.
_DEPTH_S = 4.0
# Time constant with which a velocity along a surface decays if the motion along the
# surface is not visible, s.
_FORGET_S = 5.0


class TrackNumbers(NamedTuple):
    """Constants of the tracking."""

    noise_m: float
    """Standard deviation of the distance of a group, m."""
    tick_s: float


@njit(cache=True)
def _motion_is_known(
    track: Any, own: TrackNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether the motion has been visible for long enough."""
    return bool(track[_SURE] > _CONFIRMATION_S - 0.5 * own.tick_s)


@njit(cache=True)
def _move_on(track: Any, own: TrackNumbers) -> None:  # pragma: no cover  (compiled)
    """Predicts a track one control period ahead.

    The model has a constant velocity and white noise of the acceleration. An object
    whose velocity is not known stays where it was seen: the edge of a shadow can move
    along a wall at several meters per second.
    """
    t = own.tick_s
    track[_UNSEEN] += t
    known = _motion_is_known(track, own)
    state, p = track[_STATE:_COVARIANCE], track[_COVARIANCE:].reshape(4, 4)
    for i in range(2):
        if known:
            track[_QX + i] += t * state[2 + i]
        state[i] += t * state[2 + i]
    # Covariance F P F^T: first the rows, then the columns.
    for i in range(4):
        for j in range(2):
            p[j, i] += t * p[2 + j, i]
    for i in range(4):
        for j in range(2):
            p[i, j] += t * p[i, 2 + j]
    # Noise of the acceleration.
    for i in range(2):
        p[i, i] += _WALK * t**3 / 3.0
        p[i, 2 + i] += _WALK * t**2 / 2.0
        p[2 + i, i] += _WALK * t**2 / 2.0
        p[2 + i, 2 + i] += _WALK * t


@njit(cache=True)
def _correct(
    track: Any, off: float, h: Any, variance: float
) -> None:  # pragma: no cover  (compiled)
    """Corrects a track by one scalar measurement of its position (Kalman update).

    ``off`` is the measured position minus the predicted position along the unit vector
    ``h``, m. ``variance`` is that of the measurement, m^2.
    """
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
    """Rotates the tracked position of a surface about P to its nearest point.

    P is the control point. ``along`` is the unit vector from P to the nearest point of
    the present hits. The noise of the ranges moves this point along the surface by more
    than the spacing of the beams. Therefore only the distance of the surface from P
    shows a motion. The function keeps the tracked distance and its variance, but in the
    direction ``along``. The position along the surface becomes unknown. The sensors do
    not measure the velocity along the surface, so this velocity decays to zero.
    """
    state, p = track[_STATE:_COVARIANCE], track[_COVARIANCE:].reshape(4, 4)
    x, y = state[0] - p_WP[0], state[1] - p_WP[1]
    far = max(math.hypot(x, y), 1e-9)
    old = np.array([x / far, y / far])
    new, across = np.array([along[0], along[1]]), np.array([-along[1], along[0]])
    old_across = np.array([-old[1], old[0]])
    # Keep the variances of each 2 x 2 block toward P and across, in the new axes.
    outer, outer_across = np.outer(new, new), np.outer(across, across)
    for i in range(2):
        for j in range(2):
            part = p[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].copy()
            aside = 0.0
            if i == j:
                aside = np.sum(part * np.outer(old_across, old_across))
            # A position along the surface says nothing about the middle of the hits.
            if i == 0 and j == 0:
                aside = _ANYWHERE_M**2
            toward = np.sum(part * np.outer(old, old))
            p[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = (
                toward * outer + aside * outer_across
            )
    state[0], state[1] = p_WP[0] + far * along[0], p_WP[1] + far * along[1]
    # Reduce the velocity along the surface.
    aside_m_s = along[0] * state[3] - along[1] * state[2]
    lost = own.tick_s / _FORGET_S * aside_m_s
    state[2] += lost * along[1]
    state[3] -= lost * along[0]


@njit(cache=True)
def _hides_motion(
    group: Any, own: TrackNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether the motion of a group along its surface is not visible."""
    wide = group[OPEN] > 0.5 or group[EXTENT] > _WIDE_M
    return bool(wide or group[CHORD] > _COARSE_M)


@njit(cache=True)
def _take_in(
    track: Any, group: Any, p_WP: Any, own: TrackNumbers
) -> None:  # pragma: no cover  (compiled)
    """Corrects a track with its group of hits, or starts the track.

    The measured position depends on the group:

    - If a motion along the surface is not visible, the position is the nearest point.
      Only its distance from the control point P counts as measured.
    - Otherwise, the position is in the direction of the middle of the group. Its
      distance from P is that of the nearest point plus the smoothed depth. The depth is
      the distance of the middle minus that of the nearest point. Both coordinates count
      as measured. Perpendicular to the direction, the standard deviation is larger by
      the spacing of the beams.
    """
    wide = _hides_motion(group, own)
    sure = group[CHORD] < _COARSE_M and (not wide or group[EXTENT] > 0.0)
    # Smooth the depth, which is the distance of the middle minus that of the nearest
    # point.
    near = math.hypot(group[NEAR_X], group[NEAR_Y])
    far = max(math.hypot(group[MIDDLE_X], group[MIDDLE_Y]), 1e-9)
    if track[_EXISTS] < 0.5:
        track[:] = 0.0
        track[_DEPTH] = far - near
    track[_DEPTH] += own.tick_s / _DEPTH_S * (far - near - track[_DEPTH])
    x, y = group[NEAR_X], group[NEAR_Y]
    if not wide:
        # Use the direction of the middle, but not its distance. The distance jumps when
        # a beam begins to hit another side of the object.
        part = (near + track[_DEPTH]) / far
        x, y = part * group[MIDDLE_X], part * group[MIDDLE_Y]
    far = max(math.hypot(x, y), 1e-9)
    along = x / far, y / far
    place = p_WP[0] + x, p_WP[1] + y
    # Start a track at the measured position, with unknown velocity.
    if track[_EXISTS] < 0.5:
        track[_EXISTS] = 1.0
        track[_STATE], track[_STATE + 1] = place
        p = track[_COVARIANCE:].reshape(4, 4)
        for i in range(2):
            p[i, i] = _ANYWHERE_M**2
            p[2 + i, 2 + i] = _FIRST_M_S**2
    if wide:
        _turn_surface(track, p_WP, along, own)
    # Correct the distance from P, then the position across.
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
    flat = group[EXTENT] > _WIDE_M
    track[_RADIUS] = 0.0 if flat else 0.5 * (group[EXTENT] + group[CHORD])


@njit(cache=True)
def _tracks_of(
    tracks: Any, groups: Any, p_WP: Any, own: TrackNumbers
) -> NDArray[np.int64]:  # pragma: no cover  (compiled)
    """Assigns groups of hits to tracks, at most one group to each track.

    The function first assigns the group and the track that are nearest to each other.
    Then it assigns the next nearest pair, and so on up to the distance ``_GATE_M``. The
    result has the index of the track of each group, or -1 for a group without a track.
    """
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
        if away[g, t] > _GATE_M:
            break
        of[g] = t
        away[g, :] = np.inf
        away[:, t] = np.inf
    return of


@njit(cache=True)
def track_objects(
    tracks: Any, groups: Any, p_WP: Any, own: TrackNumbers
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Tracks the objects for one control period.

    Each track is a Kalman filter with constant velocity (Bar-Shalom, Li and
    Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 6.2.2).
    The filter works in the world frame W, so that the motion of the robot does not
    appear as a motion of objects.

    A beam measures a distance, but does not show where an object is between two beams.
    A position is therefore accurate in the direction of the control point P. In the
    perpendicular direction, the position is as coarse as the spacing of the beams.

    A wide surface, or one that may continue beyond its hits, does not show a motion
    along itself. The filter then does not measure this component of the velocity, which
    starts at zero.

    On an oblique surface, a motion along the surface looks like a motion toward P.
    Therefore no velocity is known where the spacing of the beams is large. Nor is it
    known for a single hit that may be part of a longer surface.

    Args:
        tracks: (TRACKS, TRACK_SIZE) tracks, changed in place.
        groups: (n, GROUP_SIZE) groups from ``group_beams``.
        p_WP: Position (x, y) of P in W, m.
        own: Constants of the tracking.

    Returns:
        (OBJECT_SLOTS, OBJECT_SIZE) objects, nearest first.
    """
    # Predict all tracks, and drop those that were not seen for too long.
    for t in range(TRACKS):
        if tracks[t, _EXISTS] > 0.5:
            _move_on(tracks[t], own)
            if tracks[t, _UNSEEN] > _MEMORY_S + 0.5 * own.tick_s:
                tracks[t, _EXISTS] = 0.0
    # Correct each track by its group.
    of = _tracks_of(tracks, groups, p_WP, own)
    for g in range(len(groups)):
        if of[g] >= 0:
            _take_in(tracks[of[g]], groups[g], p_WP, own)
    for g in range(len(groups)):
        if of[g] < 0:
            # Start a track in a free row, or instead of the track unseen for longest.
            rank = np.where(tracks[:, _EXISTS] > 0.5, tracks[:, _UNSEEN], np.inf)
            free = int(np.argmax(rank))
            if rank[free] == 0.0:
                continue
            tracks[free, _EXISTS] = 0.0
            _take_in(tracks[free], groups[g], p_WP, own)
    # Publish the tracks; velocities only where they are known.
    slots = np.zeros((TRACKS, OBJECT_SIZE))
    for t in range(TRACKS):
        track, slot = tracks[t], slots[t]
        if track[_EXISTS] < 0.5:
            continue
        slot[THERE], slot[RADIUS] = 1.0, track[_RADIUS]
        slot[X], slot[Y] = track[_QX] - p_WP[0], track[_QY] - p_WP[1]
        if _motion_is_known(track, own):
            slot[KNOWN] = 1.0
            vx, vy = track[_STATE + 2], track[_STATE + 3]
            if math.hypot(vx, vy) > _RESTING_M_S:
                slot[VX], slot[VY] = vx, vy
    return nearest_objects(slots)
