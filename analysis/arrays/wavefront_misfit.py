"""Finds a channel that is always late, from the fit of the wave fronts.

If there are more microphones than unknown source coordinates, the delays must fit a
wave front. Noise and echoes cause different errors in each stretch of a recording. If
one channel has the same error in all stretches, there are two explanations. The channel
is late, or its microphone is not at the stated position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.recording_search import MAD_TO_STD, Sighting
from analysis.arrays.source_placement import tolerance
from analysis.arrays.wave_fronts import wave_front
from systems.hearing.multilateration import locate_source, whitening_matrix
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

# _MOST_STRETCHES: largest number of stretches to use, from anywhere in the recording.
# _LEAST_STRETCHES: least number of stretches.
_MOST_STRETCHES = 64
_LEAST_STRETCHES = 3

# Largest number of channels in one message.
_MOST_NAMED = 8

# Least information about the lateness of a channel, 1/s^2. It corresponds to a standard
# deviation of 1 s, which means that nothing is known.
_LEAST_INFORMATION = 1.0

_STEPS = 6

# Prior standard deviation of the inverse range, 1/m. Large arrays measure near sources.
_INVERSE_RANGE = 1.0

# Least significant lateness, in standard deviations. The errors of the array are the
# same in all stretches, so their part of the standard deviation does not average out.
_DEVIATIONS = 2.7

# Channels that explain at least this share of the best explanation are also reported.
_ALIKE = 0.8


@dataclass(frozen=True)
class Lateness:
    """Lateness of each channel that gives the best fit if only this channel is late."""

    late_s: NDArray[np.float64]
    """(n,) lateness of each channel, median over the stretches, s."""
    deviations: NDArray[np.float64]
    """(n,) magnitude of the lateness divided by its standard deviation."""
    explained: NDArray[np.float64]
    """(n,) share of the misfit that the lateness of the channel explains, 0 to 1."""


def channel_lateness(
    sightings: Sequence[Sighting], array: KnownArray
) -> Lateness | None:
    """Estimates how late each channel is, from the misfit of the wave fronts.

    The result is None if there are too few stretches, or if any delays fit a wave
    front, for example those of three microphones in a triangle.
    """
    every = -(-len(sightings) // _MOST_STRETCHES) or 1
    chosen = sightings[::every]
    if len(chosen) < _LEAST_STRETCHES:
        return None
    shape = array.shape
    if shape.dimension == 2:
        shape = ArrayShape.of(np.pad(shape.p_AM, ((0, 0), (0, 1))))
    if shape.freedom + 1 <= 0:  # The prior of the range counts as one more value.
        return None
    found = [_of_stretch(sighting, shape, array) for sighting in chosen]
    late, info, alike, misfit = (np.array(part) for part in zip(*found, strict=True))
    middle = np.median(late, axis=0)
    # The noise averages out over the stretches. Half of the stretches are independent.
    scatter = MAD_TO_STD * np.median(np.abs(late - middle), axis=0)
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
    """Finds the channel that is late, if the evidence is strong.

    Several channels are listed if they explain the misfit equally well.
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
        "their order and the positions (in m); a body that carries the microphones "
        "has the same effect",
    )


def _of_stretch(
    sighting: Sighting, shape: ArrayShape, array: KnownArray
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Estimates the lateness of each channel in a stretch if only this channel is late.

    Returns four values:

    - (n,) lateness in seconds;
    - (n,) inverse of the variance of the lateness;
    - (n,) part of this variance due to errors that are the same in all stretches;
    - sum of the squared whitened residuals of the stretch.
    """
    c = array.c
    allowed = tolerance(sighting, array)
    whole = sighting.covariance + allowed
    start = locate_source(sighting.tau, whole, shape, c)
    w = 1.0 / start.range if start.range_valid else 0.0
    u = start.p_AS / np.linalg.norm(start.p_AS)
    root = whitening_matrix(whole)
    residual, slopes = _fit(sighting.tau, root, u, w, shape, c)
    # The part that a change of the source position explains is removed from the misfit
    # and from each lateness.
    late = np.vstack((-np.ones(shape.count - 1), np.eye(shape.count - 1))).T
    sides = np.vstack((root @ late, np.zeros((1, shape.count))))
    across = np.linalg.svd(slopes, full_matrices=True)
    rank = int(np.sum(across[1] > 1e-9 * across[1].max()))
    free = across[0][:, rank:]
    misfit, sides = free.T @ residual, free.T @ sides
    info = np.maximum(np.sum(sides**2, axis=0), _LEAST_INFORMATION)
    # These are the whitened errors of the array. The last row is the range, which is
    # just as unknown in all stretches.
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
    """Fits a source position to delays that ``root`` whitens, beginning at u / w.

    The results are the (n,) whitened residuals, and the (n, 3) derivatives of the
    modeled values with respect to two coordinates of the direction and the inverse
    range. The last residual is that of the prior of the range.
    """
    for k in range(_STEPS + 1):
        front = wave_front(shape.p_AM, c, u, w)
        basis = np.linalg.svd(u[np.newaxis])[2][1:].T
        slopes = np.vstack(
            (
                np.column_stack((root @ front.by_h @ basis, root @ front.by_w)),
                [0.0] * basis.shape[1] + [1.0 / _INVERSE_RANGE],
            )
        )
        residual = np.append(root @ (tau - front.delays), -w / _INVERSE_RANGE)
        if k == _STEPS:
            break
        step = np.linalg.lstsq(slopes, residual, rcond=1e-9)[0]
        step *= min(1.0, 0.5 / max(float(np.abs(step[:-1]).max()), 1e-12))
        u = u + basis @ step[:-1]
        u /= np.linalg.norm(u)
        w = min(max(w + float(step[-1]), 0.0), 1.0 / NEAREST_M)
    return residual, slopes
