"""Sub-sample peaks of the channels' cross-correlations, and their errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.delays.correlation_peak import measure_peaks
from systems.delays.overlap import EDGE_SAMPLES, cut_rows
from systems.delays.transforms import filled_rows, transform_filled_rows
from systems.framework.compiling import njit

# Weights of PHAT fall to zero where the cross-spectrum is below this share of
# its mean: bins of noise would otherwise weigh as much as bins of sound.
_PHAT_FLOOR = 0.1


def whitening(cross: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Weights of the phase transform, for (pairs, bins) cross-spectra."""
    size = np.abs(cross)
    floor = _PHAT_FLOOR * size.mean(axis=-1, keepdims=True)
    return 1.0 / (size + floor + np.finfo(np.float32).tiny)


@njit(cache=True)
def _pair_spectra(
    spectra: NDArray[np.complex64], pairs: NDArray[np.int64]
) -> tuple[
    NDArray[np.complex64], NDArray[np.float32], NDArray[np.float64]
]:  # pragma: no cover  (compiled)
    """Cross-spectra (p, bins) of pairs of channels, weights 1, and energies (n,)."""
    channels, bins = spectra.shape
    energy = np.zeros(channels)
    for m in range(channels):
        for k in range(bins):
            a = spectra[m, k]
            energy[m] += a.real * a.real + a.imag * a.imag
    cross = np.empty((len(pairs), bins), dtype=spectra.dtype)
    for p in range(len(pairs)):
        i, j = pairs[p]
        for k in range(bins):
            cross[p, k] = spectra[i, k].conjugate() * spectra[j, k]
    return cross, np.ones(cross.shape, dtype=np.float32), energy


class PairTables(NamedTuple):
    """Matrices that join pairs of channels to channels."""

    pairs: NDArray[np.int64]
    """(p, 2) all pairs of n channels."""
    to_delays: NDArray[np.float64]
    """(n - 1, p) least squares from their delays to t_k - t_0."""
    to_shares: NDArray[np.float64]
    """(n, p) least squares from the logarithms of their coherences to those of
    the channels' shares of signal: a coherence is the geometric mean of two
    shares. Exact for three channels."""

    @classmethod
    def of(cls, pairs: NDArray[np.int64]) -> PairTables:
        """The tables of all pairs i < j of some channels."""
        rows = np.arange(len(pairs))
        count = int(pairs.max()) + 1
        first, second = np.zeros((2, len(pairs), count), dtype=np.float64)
        first[rows, pairs[:, 0]] = second[rows, pairs[:, 1]] = 1.0
        return cls(
            pairs,
            np.asarray(np.linalg.pinv((second - first)[:, 1:]), dtype=np.float64),
            np.asarray(np.linalg.pinv(0.5 * (first + second)), dtype=np.float64),
        )


class Peaks(NamedTuple):
    """Peaks of all pairs' correlations."""

    arrivals: NDArray[np.float64]
    """(n,) arrival at each channel after channel 0 that fits all delays, samples."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) of the arrivals after the first one, samples^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    angular_frequency: float
    """Root mean square of what the channels share, rad a sample; least of the pairs."""
    noise_energy: float
    """Of what the mean channel does not share with the others, within the band,
    units of the frame squared."""
    moved: float
    """Largest change of an arrival, samples."""
    closure: float
    """Largest disagreement of a pair's own delay with ``arrivals``, samples."""


def find_peaks(
    frame: NDArray[np.float32],
    arrivals: NDArray[np.float64],
    tables: PairTables,
    *,
    length: int,
    band: slice,
    phat: bool = False,
    newton: bool = True,
) -> Peaks | None:
    """Peaks of the cross-correlations near given delays.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) arrival at each channel after channel 0, samples.
        tables: The pairs of channels.
        length: Of the Fourier transform, at least that of the frame.
        band: Its bins to use.
        phat: Whether to whiten.
        newton: Whether to search between the samples.

    Returns:
        The peaks, or None where there is none.
    """
    rows = filled_rows(len(frame))
    cut, cut_samples = cut_rows(frame, np.rint(arrivals), rows, length)
    spectra = transform_filled_rows(cut)[: len(frame), band]
    cross, weights, energy = _pair_spectra(spectra, tables.pairs)
    if phat:
        weights = whitening(cross)
    # The soft edges cost energy: the mean square of a raised cosine is 3/8.
    peaks = Peaks(
        *measure_peaks(
            cross,
            weights,
            energy,
            arrivals,
            tables,
            (band.start, length, cut_samples - 1.25 * EDGE_SAMPLES),
            newton,
        )
    )
    return peaks if peaks.correlation > 0.0 else None
