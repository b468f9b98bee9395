"""Times and frequencies at which one wave alone reaches an array.

The covariance of the channels over a few frames then has rank 1. Its eigenvalues are
those of the frames' products with each other, which are fewer than the microphones of
a large array, and can be had for all groups of frames at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Frames of a covariance.
GROUP_FRAMES = 4


def _products(spectra: NDArray[np.complex64]) -> list[NDArray[np.complex64]]:
    """Of each frame with the one m later, summed over channels: (frames - m, bins)."""
    frames = len(spectra)
    return [
        np.einsum("fnb,fnb->fb", spectra[: frames - m], spectra[m:].conj())
        for m in range(GROUP_FRAMES)
    ]


def _running(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Sums of so many rows after one another."""
    count = len(values) - size + 1
    return np.sum([values[k : k + count] for k in range(size)], axis=0)


def group_powers(spectra: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Powers of groups of frames.

    Args:
        spectra: (f, n, b) frames, channels, bins; at least ``GROUP_FRAMES`` frames.

    Returns:
        (g, b) sum over the frames of a group and channels; a group begins with each
        frame that enough others follow.
    """
    power = np.einsum("fnb->fb", spectra.real**2 + spectra.imag**2)
    return _running(power, GROUP_FRAMES)


def find_rank_one(
    spectra: NDArray[np.complex64],
    candidates: NDArray[np.bool_],
    least_ratio: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.complex128]]:
    """Bins in which one wave is all there is.

    Args:
        spectra: (f, n, b) frames, channels, bins.
        candidates: (g, b) groups and bins to look at, as of ``group_powers``.
        least_ratio: Of the two largest eigenvalues.

    Returns:
        (k,) groups, (k,) bins, and (k, n) the dominant eigenvector of each, of any
        length and phase.
    """
    products = _products(spectra)
    power = _running(products[0].real, GROUP_FRAMES)
    # The sum of the eigenvalues squared.
    squares = _running(np.abs(products[0]) ** 2, GROUP_FRAMES)
    for m in range(1, GROUP_FRAMES):
        squares += 2.0 * _running(np.abs(products[m]) ** 2, GROUP_FRAMES - m)
    # The least that it can be, beside the square of their sum, at that ratio.
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
