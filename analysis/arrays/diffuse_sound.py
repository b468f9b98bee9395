"""Removes diffuse sound from the cross-spectra of channels.

Reverberation arrives from all directions. Such diffuse sound is in phase at close
microphones: between two microphones at the distance D, its coherence is sin(x) / x with
x = w D / c. It pulls all delays toward zero, so the elevation above a planar array
seems too large, and the angle from the axis of a row seems too close to 90 deg.

The phases reveal the share of the diffuse sound. The phase of direct sound is
proportional to the frequency, but the phase of the sum of direct and diffuse sound is
not. Independent noise of the channels has no effect on phases, so it is not mistaken
for diffuse sound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.phase_agreement import climb, pair_delays, sums

# Shares of diffuse sound that are compared. The best share is interpolated.
_SHARES = np.linspace(0.0, 0.9, 10)

# The share and the delays are estimated in turn, this many times.
_ROUNDS = 3

# Least mean square of the diffuse coherence. The microphones of other arrays are so far
# apart that diffuse sound is incoherent.
_LEAST_COHERENCE = 1e-3

# Standard deviation of the share, as a part of the difference between the two possible
# shares that ``_whole`` states. The value is from simulated rooms.
_SHARE_ERROR = 1.0


class WithoutDiffuse(NamedTuple):
    """Cross-spectra of the direct sound alone."""

    cross: NDArray[np.complex128]
    """(p, f) cross-spectra without those of the diffuse sound."""
    share: float
    """Share of the removed diffuse sound in the sound without the noise."""
    error: NDArray[np.float64]
    """(n - 1,) error of the delays from the error of the share, s."""


def without_diffuse(
    cross: NDArray[np.complex128],
    total: NDArray[np.float64],
    diffuse: NDArray[np.complex64],
    w: NDArray[np.float64],
    tau: NDArray[np.float64],
    edges: NDArray[np.int64],
) -> WithoutDiffuse:
    """Estimates the share of diffuse sound, and removes this sound.

    Args:
        cross: (p, f) cross-spectra of the pairs.
        total: (f,) power, weighted like the cross-spectra.
        diffuse: (p, f) coherence of diffuse sound.
        w: (f,) angular frequencies, rad/s.
        tau: (n - 1,) delays that fit the cross-spectra, s.
        edges: (b + 1,) edges of frequency bands. Noise has a constant share in a band.

    Returns:
        The cross-spectra of the direct sound.
    """
    power = np.maximum(total, 1e-12)
    mean_square = (power * np.abs(diffuse) ** 2).sum() / (power.sum() * len(diffuse))
    if mean_square < _LEAST_COHERENCE:
        return WithoutDiffuse(cross, 0.0, np.zeros(tau.size))
    even, whole = np.ones(w.size), np.array([0, w.size])
    share, heard, left = 0.0, np.ones(w.size), cross
    for _ in range(_ROUNDS):
        # The diffuse sound moves the delays by ``bend`` times its share.
        curve = sums(left, even, w, tau, whole)[1]
        pull = sums(heard * total * diffuse, even, w, tau, whole)[0][0]
        bend = -np.linalg.lstsq(curve, pull, rcond=None)[0]
        misfits = []
        for tried in _SHARES:
            model = _model(tau + (tried - share) * bend, tried, diffuse, w)
            misfits.append(_misfit(cross, power, model, edges))
        share = _lowest(np.array(misfits))
        model = _model(tau, share, diffuse, w)
        heard = _heard_share(cross, power, model, edges)
        left = cross - share * heard * total * diffuse
        tau = climb(left, even, w, tau)
    whole_share = _whole(share)
    left = cross - whole_share * heard * total * diffuse
    error = _SHARE_ERROR * (whole_share - share) * bend
    return WithoutDiffuse(left, whole_share, error)


def _whole(share: float) -> float:
    """Returns the share of all reflections, given the diffuse share in the phases.

    Reverberation in rooms is not quite diffuse. Strong first reflections shorten the
    delays, too, but they hardly bend the phases. In simulated rooms with reverberation
    times of 0.2-0.6 s, the delays of arrays of 6-20 cm are right on average if the
    square root of the diffuse share is removed.
    """
    return math.sqrt(share)


def _model(
    tau: NDArray[np.float64],
    share: float,
    diffuse: NDArray[np.complex64],
    w: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Returns (p, f) cross-spectra of direct and diffuse sound with the power 1."""
    turn = np.exp(-1j * np.outer(pair_delays(tau), w))
    return (1.0 - share) * turn + share * diffuse


def _heard_share(
    cross: NDArray[np.complex128],
    power: NDArray[np.float64],
    model: NDArray[np.complex128],
    edges: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Returns the (f,) share of direct and diffuse sound in the sound and its noise."""
    product = (cross * model.conj()).real.sum(axis=0)
    square = power * (np.abs(model) ** 2).sum(axis=0)
    share = np.add.reduceat(product, edges[:-1]) / np.add.reduceat(square, edges[:-1])
    return np.repeat(np.clip(share, 0.0, 1.0), np.diff(edges))


def _misfit(
    cross: NDArray[np.complex128],
    power: NDArray[np.float64],
    model: NDArray[np.complex128],
    edges: NDArray[np.int64],
) -> float:
    heard = _heard_share(cross, power, model, edges)
    return float((np.abs(cross - power * heard * model) ** 2 / power).sum())


def _lowest(misfits: NDArray[np.float64]) -> float:
    """Returns the share with the lowest misfit, from a parabola through three."""
    k = int(misfits.argmin())
    if k in (0, misfits.size - 1):
        return float(_SHARES[k])
    before, here, after = misfits[k - 1 : k + 2]
    step = 0.5 * (before - after) / max(before - 2.0 * here + after, 1e-30)
    return float(_SHARES[k] + step * (_SHARES[1] - _SHARES[0]))
