"""A channel that is late at every direction, told from the fit of the wave fronts.

Delays of more microphones than a source has coordinates must fit a wave front. What
one channel is off by, in the same way in all stretches of a recording, is no noise
and no echo: the channel is late, or its microphone does not stand where it should.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.array_geometry import KnownArray
from analysis.recordings.channel_faults import ChannelFault
from analysis.recordings.recording_search import Sighting
from analysis.recordings.source_placement import tolerance
from systems.hearing.multilateration import locate_source, whitening_matrix
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

# Stretches that are looked at; they lie anywhere in the recording.
_MOST_STRETCHES = 64
_LEAST_STRETCHES = 3

# Channels that one message names.
_MOST_NAMED = 8

# Of normally distributed values, standard deviation over median deviation.
_TO_STANDARD = 1.4826

# A channel of which nothing is known within a second.
_LEAST_INFORMATION = 1.0

_STEPS = 6

# Of the inverse range before anything is heard, 1/m: large arrays hear near sources.
_INVERSE_RANGE = 1.0

# A lateness counts beyond so many deviations of what the tolerances of one stretch
# allow: those are alike in all of them, and do not average out.
_DEVIATIONS = 2.7

# Channels that explain nearly as much are no less to be blamed.
_ALIKE = 0.8


@dataclass(frozen=True)
class Lateness:
    """By how much each channel alone would have to be late to fit best."""

    late_s: NDArray[np.float64]
    """(n,) median over the stretches, s."""
    deviations: NDArray[np.float64]
    """(n,) the same over its standard deviation in one stretch."""
    explained: NDArray[np.float64]
    """(n,) share of the misfit that it explains, 0 to 1."""


def channel_lateness(
    sightings: Sequence[Sighting], array: KnownArray
) -> Lateness | None:
    """How late each channel seems.

    Args:
        sightings: Delays and their errors.
        array: The microphones and their budget.

    Returns:
        The latenesses; None where there are too few stretches.
    """
    every = -(-len(sightings) // _MOST_STRETCHES) or 1
    chosen = sightings[::every]
    if len(chosen) < _LEAST_STRETCHES:
        return None
    shape = array.shape
    if shape.dimension == 2:
        shape = ArrayShape.of(np.pad(shape.p_AM, ((0, 0), (0, 1))))
    found = [_of_stretch(sighting, shape, array) for sighting in chosen]
    late, info, alike, misfit = (np.array(part) for part in zip(*found, strict=True))
    middle = np.median(late, axis=0)
    # Noise averages out over the stretches, of which one in two is independent.
    scatter = _TO_STANDARD * np.median(np.abs(late - middle), axis=0)
    deviation = np.sqrt(np.median(alike, axis=0) + 2.0 * scatter**2 / len(late))
    explained = (2.0 * late * middle - middle**2) * info
    return Lateness(
        late_s=middle,
        deviations=np.abs(middle) / deviation,
        explained=explained.sum(axis=0) / max(float(misfit.sum()), 1e-30),
    )


def late_channel(
    sightings: Sequence[Sighting], array: KnownArray
) -> ChannelFault | None:
    """The channel that is late, if one is beyond doubt.

    Args:
        sightings: Delays and their errors.
        array: The microphones and their budget.

    Returns:
        Which one, and by how much; None: none is beyond doubt.
    """
    found = channel_lateness(sightings, array)
    if found is None:
        return None
    worst = int(np.argmax(found.explained))
    if found.deviations[worst] < _DEVIATIONS:
        return None
    blamed = np.flatnonzero(found.explained > _ALIKE * found.explained[worst])
    names = " or ".join(str(k + 1) for k in blamed[:_MOST_NAMED])
    names += " or others" if len(blamed) > _MOST_NAMED else ""
    late_us = 1e6 * abs(float(found.late_s[worst]))
    return ChannelFault(
        "late",
        tuple(int(k) for k in blamed),
        f"channel {names}: off by {late_us:.0f} us at all times, or its microphone "
        f"by {1e-3 * late_us * array.c:.0f} mm; sample all channels at once, and check "
        "their order and the positions (in m)",
    )


def _of_stretch(
    sighting: Sighting, shape: ArrayShape, array: KnownArray
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Lateness of each channel alone, and what is known of it.

    Returns:
        (n,) latenesses, s; (n,) their information, 1/s^2; (n,) the part of their
        variances that is alike in all stretches, s^2; and the whole misfit.
    """
    c = array.c
    allowed = tolerance(sighting, array)
    whole = sighting.covariance + allowed
    start = locate_source(sighting.tau, whole, shape, c)
    w = 1.0 / start.range if start.range_valid else 0.0
    u = start.p_AS / np.linalg.norm(start.p_AS)
    root = whitening_matrix(whole)
    residual, slopes = _fit(sighting.tau, root, u, w, shape, c)
    # What a place may explain is taken out of the misfit and of each lateness.
    late = np.vstack((-np.ones(shape.count - 1), np.eye(shape.count - 1))).T
    sides = np.vstack((root @ late, np.zeros((1, shape.count))))
    across = np.linalg.svd(slopes, full_matrices=True)
    rank = int(np.sum(across[1] > 1e-9 * across[1].max()))
    free = across[0][:, rank:]
    misfit, sides = free.T @ residual, free.T @ sides
    info = np.maximum(np.sum(sides**2, axis=0), _LEAST_INFORMATION)
    # The tolerances, whitened; and the range, of which as little is known.
    steady = np.zeros((shape.count, shape.count))
    steady[:-1, :-1] = root @ allowed @ root.T
    steady[-1, -1] = 1.0
    gain = (free @ sides) / info
    alike = np.sum(gain * (steady @ gain), axis=0)
    return (sides.T @ misfit) / info, info, alike, float(misfit @ misfit)


def _fit(
    tau: NDArray[np.float64],
    root: NDArray[np.float64],
    u: NDArray[np.float64],
    w: float,
    shape: ArrayShape,
    c: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Whitened residual of the best place and its slopes, with a row for the range."""
    for k in range(_STEPS + 1):
        delays, along_u, along_w = _wave_front(u, w, shape.p_AM, c)
        basis = np.linalg.svd(u[np.newaxis])[2][1:].T
        slopes = np.vstack(
            (
                np.column_stack((root @ along_u @ basis, root @ along_w)),
                [0.0] * basis.shape[1] + [1.0 / _INVERSE_RANGE],
            )
        )
        residual = np.append(root @ (tau - delays), -w / _INVERSE_RANGE)
        if k == _STEPS:
            break
        step = np.linalg.lstsq(slopes, residual, rcond=1e-9)[0]
        step *= min(1.0, 0.5 / max(float(np.abs(step[:-1]).max()), 1e-12))
        u = u + basis @ step[:-1]
        u /= np.linalg.norm(u)
        w = min(max(w + float(step[-1]), 0.0), 1.0 / NEAREST_M)
    return residual, slopes


def _wave_front(
    u: NDArray[np.float64], w: float, p: NDArray[np.float64], c: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Delays after channel 0 of sound from u / w, and their slopes along u and w.

    A microphone at p is nearer to it than the origin by (2 p.u - w p^2) / (1 + s),
    where s is its distance times w.
    """
    square = np.sum(p**2, axis=1)
    s = np.sqrt(np.maximum(1.0 - 2.0 * w * (p @ u) + w * w * square, 1e-12))
    path = (w * square - 2.0 * (p @ u)) / (1.0 + s)
    along_u = -p / s[:, np.newaxis]
    if w < 1e-6:
        along_w = 0.5 * (square - (p @ u) ** 2)
    else:
        along_w = ((w * square - p @ u) / s - path) / w
    return (
        (path[1:] - path[0]) / c,
        (along_u[1:] - along_u[0]) / c,
        (along_w[1:] - along_w[0]) / c,
    )
