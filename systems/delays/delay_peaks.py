"""Finds sub-sample peaks of the cross-correlations of channels, and their errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.delays.correlation_peak import measure_peaks
from systems.delays.correlations import whitening
from systems.delays.overlap import EDGE_SAMPLES, cut_rows
from systems.delays.transforms import filled_rows, transform_filled_rows
from systems.framework.compiling import njit


@njit(cache=True)
def _pair_spectra(
    spectra: NDArray[np.complex64], pairs: NDArray[np.int64]
) -> tuple[
    NDArray[np.complex64], NDArray[np.float32], NDArray[np.float64]
]:  # pragma: no cover  (compiled)
    """Returns the cross-spectra of pairs, their weights, and the channel energies.

    The shapes are (p, bins), (p, bins) and (n,). All weights are 1.
    """
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
    """Matrices that convert values of pairs to values of channels."""

    pairs: NDArray[np.int64]
    """(p, 2) all pairs of n channels."""
    to_delays: NDArray[np.float64]
    """(n - 1, p) matrix that converts the delays of all pairs to the delays t_k - t_0
    by least squares. t_k is the time of arrival at channel k."""
    to_shares: NDArray[np.float64]
    """(n, p) matrix that converts the coherences of the pairs to the share of signal in
    each channel. A coherence is the geometric mean of the shares of two channels. The
    matrix therefore converts logarithms, by least squares. The result is exact for
    three channels."""

    @classmethod
    def of(cls, pairs: NDArray[np.int64]) -> PairTables:
        """Makes the tables of all pairs i < j of channels."""
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
    """Peaks of the correlations of all pairs."""

    arrivals: NDArray[np.float64]
    """(n,) times of arrival relative to channel 0 that fit the delays of all pairs
    best, samples."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the arrivals at channels 1 ... n - 1, samples^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    angular_frequency: float
    """Root mean square angular frequency of the sound that two channels share, rad per
    sample. It is the smallest value of all pairs."""
    noise_energy: float
    """Energy in a channel that the other channels do not share, units of the frame
    squared. It is the energy within the band, averaged over the channels."""
    moved: float
    """Largest difference between an arrival and the arrival from which the search
    started, samples."""
    closure: float
    """Largest disagreement between the delay of a pair and ``arrivals``, samples."""


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
    """Finds the peaks of the cross-correlations near given delays.

    Args:
        frame: (n, samples) channels.
        arrivals: (n,) times of arrival to start from, relative to channel 0, samples.
        tables: The pairs of channels.
        length: Length of the Fourier transform, samples; at least that of the audio
            frame.
        band: Bins of the transform to use.
        phat: Whether to whiten the cross-spectra.
        newton: Whether to refine the delays between samples by Newton's method.

    Returns:
        The peaks, or None if a pair has no peak.
    """
    rows = filled_rows(len(frame))
    cut, cut_samples = cut_rows(frame, np.rint(arrivals), rows, length)
    spectra = transform_filled_rows(cut)[: len(frame), band]
    cross, weights, energy = _pair_spectra(spectra, tables.pairs)
    if phat:
        weights = whitening(cross)
    # The soft edges reduce the energy: the mean square of a raised cosine is 3/8.
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
