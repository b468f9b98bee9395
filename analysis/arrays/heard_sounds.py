"""Estimates the delays of a sound at rest from the stretches of a recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.call_search import CallSearch
from analysis.arrays.prepared_recording import (
    LEAST_SIGHTINGS,
    SNAPSHOTS,
    prepared_recording,
)
from analysis.arrays.recorded_samples import Recording, recorded_samples
from analysis.arrays.recording_search import MAD_TO_STD, RecordingSearch, Sighting
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape

# Largest distance of a stretch from the median, in standard deviations. A stretch
# beyond it belongs to a different sound.
_FARTHEST = 3.0

# Error from reflections that is the same in all stretches, and independent for each
# channel. It is a share of the travel time of sound along the array, for each part of
# the sound that is not coherent.
_SCATTER_SHARE = 0.015


@dataclass(frozen=True)
class HeardSound:
    """Delays of a sound at rest."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0 of channels 1 ... n - 1 after channel 0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, s^2. It contains noise, reflections, and
    the scatter of the stretches."""
    stretches: int
    """Number of stretches that contain a sound."""
    used: int
    """Number of these stretches that agree on the delays."""


def sightings_of(
    files: Recording,
    geometry: ArrayGeometry,
    from_s: float = 0.0,
    to_s: float | None = None,
    top_hz: float = math.inf,
    starts_s: Sequence[float] | None = None,
) -> tuple[list[Sighting], list[str]]:
    """Finds the stretches of a recording in which a source is clearly audible.

    A stretch is a run of consecutive short windows, which are called snapshots. Only
    the part from ``from_s`` to ``to_s`` and only frequencies up to ``top_hz`` are used.
    At higher frequencies, the periods are shorter than the possible delay errors from
    wrong microphone positions. ``starts_s`` contains the beginnings of several files.
    The texts are messages about files and faulty channels.
    """
    recorded = recorded_samples(files, geometry, starts_s=starts_s)
    length, rate = recorded.samples.shape[1] / recorded.rate, recorded.rate
    end = length if to_s is None else to_s
    if not from_s < end <= length + 1.0 / rate:
        raise InputError(
            "recording",
            f"{recorded.name} has {length:.3f} s, and {from_s:g} to {end:g} s are not "
            "within it; correct from_s and to_s",
        )
    part = slice(round(from_s * rate), round(end * rate))
    recording, faults, _ = prepared_recording(
        recorded._replace(samples=recorded.samples[:, part]),
        geometry,
        top_hz=top_hz,
        trusts_positions=False,
    )
    known = geometry.known
    if known.far_apart:
        calls = CallSearch.of(recording, known).sightings()
        return calls, [fault.message for fault in faults]
    found: list[Sighting] = []
    for snapshots in SNAPSHOTS:
        search = RecordingSearch(recording, known.shape, known.c, snapshots)
        heard = list(search.sightings())
        found = max(found, heard, key=len)
        if len(found) >= min(LEAST_SIGHTINGS, len(search.stretches)):
            break
    return found, [*recorded.remarks, *(fault.message for fault in faults)]


def heard_sound(
    sightings: Sequence[Sighting], shape: ArrayShape, c: float
) -> HeardSound:
    """Averages the delays of a sound at rest over one or more stretches.

    A stretch with smaller errors has a larger weight. The covariance of the mean
    follows in these steps:

    1. The errors of the stretches are combined as if they were independent.
    2. The covariance is doubled, because stretches overlap by half.
    3. If the stretches scatter more than their errors say, the covariance grows
       accordingly.
    4. The error from reflections is added, because it is the same in all stretches.
    """
    tau = np.array([sighting.tau for sighting in sightings])
    # Stretches far from the median contain a different sound.
    off = np.linalg.norm(tau - np.median(tau, axis=0), axis=1)
    usual = MAD_TO_STD * float(np.median(off))
    near = off <= max(_FARTHEST * usual, float(off.min()))
    chosen = [s for s, is_near in zip(sightings, near, strict=True) if is_near]
    weights = [np.linalg.inv(s.covariance) for s in chosen]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    pulls = [w @ s.tau for w, s in zip(weights, chosen, strict=True)]
    mean = covariance @ np.sum(pulls, axis=0)
    if len(chosen) > 1:
        errors = [s.tau - mean for s in chosen]
        scatter = sum(float(d @ w @ d) for d, w in zip(errors, weights, strict=True))
        covariance *= 2.0 * max(1.0, scatter / (mean.size * (len(chosen) - 1)))
    coherence = float(np.mean([min(s.coherence, 1.0) for s in chosen]))
    alike = _SCATTER_SHARE * (1.0 - coherence) * shape.max_delay(c)
    covariance = covariance + alike**2 * (np.eye(mean.size) + 1.0)
    return HeardSound(mean, covariance, len(sightings), len(chosen))
