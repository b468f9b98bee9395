"""Finds times and frequencies at which only one wave reaches an array.

The covariance of the channels over a few frames then has the rank 1. Its nonzero
eigenvalues are equal to those of the matrix of products between the frames. This matrix
is smaller if an array has more microphones than there are frames. It can be computed
for all groups of frames at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Number of frames in a covariance.
GROUP_FRAMES = 4


def _products(spectra: NDArray[np.complex64]) -> list[NDArray[np.complex64]]:
    """Returns products of each frame with the frame m later, for m = 0, 1, 2, 3.

    Each product is summed over the channels and has the shape (frames - m, bins).
    """
    frames = len(spectra)
    return [
        np.einsum("fnb,fnb->fb", spectra[: frames - m], spectra[m:].conj())
        for m in range(GROUP_FRAMES)
    ]


def _running(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Returns the sums of ``size`` consecutive rows, starting at each row."""
    count = len(values) - size + 1
    return np.sum([values[k : k + count] for k in range(size)], axis=0)


def group_powers(spectra: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Computes the (g, b) power of each group of frames, summed over the channels.

    Group k consists of the frames k ... k + ``GROUP_FRAMES`` - 1 of the (f, n, b)
    spectra.
    """
    power = np.einsum("fnb->fb", spectra.real**2 + spectra.imag**2)
    return _running(power, GROUP_FRAMES)


def find_rank_one(
    spectra: NDArray[np.complex64],
    candidates: NDArray[np.bool_],
    least_ratio: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.complex128]]:
    """Finds the (g, b) candidates among the bins that contain only one wave.

    A bin is one frequency in one group of frames. The results are the (k,) numbers of
    the groups and of the frequencies of these bins, and their (k, n) dominant
    eigenvectors, with any length and phase.
    """
    products = _products(spectra)
    power = _running(products[0].real, GROUP_FRAMES)
    # Sum of the squared eigenvalues.
    squares = _running(np.abs(products[0]) ** 2, GROUP_FRAMES)
    for m in range(1, GROUP_FRAMES):
        squares += 2.0 * _running(np.abs(products[m]) ** 2, GROUP_FRAMES - m)
    # Least sum of squares at this ratio, as a share of the squared sum of the
    # eigenvalues.
    rest = GROUP_FRAMES - 1
    least = (1.0 + rest / least_ratio**2) / (1.0 + rest / least_ratio) ** 2
    group, bins = np.nonzero(candidates & (squares >= least * power**2) & (power > 0.0))
    if not len(group):
        return group, bins, np.empty((0, spectra.shape[1]), dtype=np.complex128)
    frames = group[:, np.newaxis] + np.arange(GROUP_FRAMES)
    snapshots = spectra[frames, :, bins[:, np.newaxis]].astype(np.complex128)
    gram = snapshots @ snapshots.conj().transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(gram)
    found = values[:, -1] >= least_ratio * values[:, -2]
    first = vectors[found, :, -1].conj()
    pattern = np.einsum("kf,kfn->kn", first, snapshots[found])
    return group[found], bins[found], pattern
