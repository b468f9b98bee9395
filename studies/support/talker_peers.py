"""pyroomacoustics' searches for directions, beside ours in ``studies.talkers``.

A method is asked once for a whole recording, with the true number of talkers given or
with the peaks of its spectrum, and block by block, as a vote of its best directions:
through the same histogram and rule for its peaks as ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pyroomacoustics as pra
from numpy.typing import NDArray
from scipy.signal import find_peaks

from analysis.arrays.voting.vote_peaks import gather_sources
from analysis.arrays.voting.vote_records import DirectionVotes
from studies.support.talker_rooms import RATE, Recording

C = 343.0
N_FFT, HOP, GRID = 512, 256, 180
BAND_HZ = [300.0, 3_700.0]

#: Its methods that run on such an array, and those that have a spectrum without being
#: told the number of sources.
PEERS = ("SRP", "MUSIC", "NormMUSIC", "CSSM", "WAVES", "TOPS")
OPEN_PEERS = ("SRP", "MUSIC", "NormMUSIC")

# Frames of a block, and the share of the weakest ones that do not vote.
_BLOCK, _WEAKEST = 3, 0.3

# Peaks of a spectrum, between its lowest and its highest value.
_HEIGHT, _PROMINENCE = 0.5, 0.15


def by_file(
    name: str, places: NDArray[np.float64]
) -> Callable[[Recording], list[float]]:
    """Bearings in deg of a recording, by a method that is told their number."""

    def bearings(recording: Recording) -> list[float]:
        search = _search(name, places, len(recording.bearings_deg))
        return _degrees(_located(search, _spectra(recording)))

    return bearings


def by_file_unknown(
    name: str, places: NDArray[np.float64]
) -> Callable[[Recording], list[float]]:
    """The same by the peaks of the method's spectrum.

    MUSIC is told that there is one source.
    """

    def bearings(recording: Recording) -> list[float]:
        search = _search(name, places, 1)
        search.locate_sources(_spectra(recording), freq_range=BAND_HZ)
        values = np.asarray(search.grid.values)
        values = (values - values.min()) / max(float(np.ptp(values)), 1e-30)
        first = int(values.argmin())
        turned = np.append(np.roll(values, -first), values[first])
        peaks, _ = find_peaks(turned, height=_HEIGHT, prominence=_PROMINENCE)
        return _degrees(search.grid.azimuth[(peaks + first) % len(values)])

    return bearings


def by_votes(
    name: str, places: NDArray[np.float64]
) -> Callable[[Recording], list[float]]:
    """The same by a vote of blocks of 64 ms, of which each has one direction."""

    def bearings(recording: Recording) -> list[float]:
        search = _search(name, places, 1)
        spectra = _spectra(recording)
        blocks = [
            spectra[:, :, k : k + _BLOCK]
            for k in range(0, spectra.shape[2] - _BLOCK + 1, _BLOCK)
        ]
        power = np.array([np.sum(np.abs(block) ** 2) for block in blocks])
        azimuth = []
        for k in np.flatnonzero(power > np.quantile(power, _WEAKEST)):
            azimuth += _located(search, blocks[k]).tolist()
        return [math.degrees(s.bearing) for s in gather_sources(_votes(azimuth))]

    return bearings


def _search(name: str, places: NDArray[np.float64], number: int) -> pra.doa.DOA:
    return pra.doa.algorithms[name](
        places[:, :2].T.copy(), RATE, N_FFT, c=C, num_src=number, n_grid=GRID
    )


def _located(
    search: pra.doa.DOA, spectra: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Azimuths, rad; none where CSSM or WAVES meets a matrix that has no inverse."""
    try:
        search.locate_sources(spectra, freq_range=BAND_HZ)
    except np.linalg.LinAlgError:
        return np.empty(0)
    return np.atleast_1d(search.azimuth_recon)


def _spectra(recording: Recording) -> NDArray[np.complex128]:
    """(n, bins, frames)."""
    window = pra.hann(N_FFT)
    spectra = pra.transform.stft.analysis(
        recording.channels.T.astype(np.float64), N_FFT, HOP, win=window
    )
    return np.asarray(spectra.transpose(2, 1, 0))


def _degrees(azimuth: NDArray[np.float64]) -> list[float]:
    return np.degrees(np.atleast_1d(azimuth)).tolist()


def _votes(azimuth: list[float]) -> DirectionVotes:
    """Directions in the place of our steered votes."""
    around = (np.array(azimuth) + math.pi) % (2.0 * math.pi) - math.pi
    ones = np.ones(around.size)
    return DirectionVotes(
        t_s=ones,
        azimuth=around,
        elevation=np.nan * ones,
        weight=ones,
        power=ones,
        rises=ones,
        steered=ones > 0,
        group_t_s=np.empty(0),
        group_levels_db=np.empty((0, 1)),
        group_fits=np.empty((0, 2)),
    )
