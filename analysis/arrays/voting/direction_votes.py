"""Estimates the direction of the sound at single times and frequencies.

If several people talk at once, one voice is much louder than the others at most times
and frequencies. An average over all times and frequencies gives a direction between the
talkers, but a single bin does not. A bin is one frequency at one time. If only one wave
reaches the array in a bin, the bin votes for a direction (after Mohan et al. 2008, and
Pavlidi et al. 2013). If a bin is no louder than the possible echo of earlier sound, it
does not vote. The module ``analysis.arrays.voting.vote_peaks`` gathers the votes.

The band has an upper limit. At this limit, the phase of sound along the shortest pairs
of the array changes by half a period. At higher frequencies, phases wrap, and votes
would pile up on the opposite side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.arrays.voting.bin_levels import (
    a_weight,
    levels_db,
    louder_bins,
    no_levels,
    risen_bins,
    standing_out,
)
from analysis.arrays.voting.single_waves import (
    GROUP_FRAMES,
    PhasePlane,
    find_rank_one,
    group_powers,
)
from analysis.arrays.voting.steered_votes import SteeredSearch
from analysis.arrays.voting.vote_records import (
    DirectionVotes,
    cast_of,
    join_votes,
    no_votes,
)
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape

_FRAME_S = 0.032
# Least length of a frame, as a multiple of the travel time of sound along the array.
_CROSSINGS = 6.0
_HOPS = 4

# Least ratio of the two largest eigenvalues of the covariance in a bin with one wave.
_LEAST_RATIO = 20.0

# Highest frequency to use, Hz. Lower frequencies suffice to separate speech and most
# noises.
_HIGHEST_HZ = 8_000.0

# Least upper limit of a band whose bins vote, Hz. A lower band contains too little
# speech.
_LEAST_HIGHEST_HZ = 1_000.0

_SPEEDS_M_S = (100.0, 2_000.0)


class VoteMemory(NamedTuple):
    """State of the voting between two blocks of samples."""

    tail: NDArray[np.float32]
    """(n, m) last samples of n channels, which the next votes need."""
    groups: int
    """Number of groups of frames so far."""
    level: float
    """Power limit of the weakest bins; 0 before the first sound."""
    echo: NDArray[np.float32]
    """(b,) largest remaining echo of earlier sound in each bin, as power."""
    steady_db: NDArray[np.float32]
    """(b,) level of the steady sound in each bin, dB; empty before the first group."""


@dataclass(frozen=True)
class VotePlan:
    """Settings with which an array votes for directions of sound.

    To make the settings for an array, call ``VotePlan.of``.
    """

    shape: ArrayShape
    c: float
    """Speed of sound, m/s."""
    sample_rate_hz: float
    window: NDArray[np.float32]
    """(w,) Hann window of a frame."""
    hop: int
    """Number of samples from one frame to the next."""
    bins: slice
    """Frequency bins that vote one by one. Empty if the array is too large for such
    votes."""
    plane: PhasePlane
    steered: SteeredSearch

    @classmethod
    def of(
        cls,
        shape: ArrayShape,
        c: float,
        sample_rate_hz: float,
        *,
        band_hz: tuple[float, float] = (200.0, 8_000.0),
    ) -> VotePlan:
        """Makes the settings with which an array votes for directions of sound.

        No frequency above 8 kHz votes, or above twice the lowest frequency if this is
        larger. Single frequencies vote only up to the frequency at which the phases of
        the shortest pairs wrap. Raises an InputError if the array cannot measure
        bearings, or if a number is invalid.
        """
        if "bearing" not in shape.angles:
            raise InputError(
                "microphones",
                "a row that is not level gives no bearings; give a row in the "
                "plane z = const, or add microphones off the row",
            )
        _check(c, sample_rate_hz, band_hz)
        frame_s = max(_FRAME_S, _CROSSINGS * shape.max_delay(c))
        hop = max(1, round(frame_s * sample_rate_hz / _HOPS))
        size = _HOPS * hop
        low, high = band_hz
        high = min(high, max(_HIGHEST_HZ, 2.0 * low), 0.5 * sample_rate_hz)
        plane = PhasePlane.of(shape, c)
        top = min(high, plane.highest_hz)
        per_hz = size / sample_rate_hz
        bins = slice(math.ceil(low * per_hz), math.floor(top * per_hz) + 1)
        if top < _LEAST_HIGHEST_HZ:
            bins = slice(bins.start, bins.start)
        angle = 2.0 * np.pi * np.arange(size) / size
        return cls(
            shape=shape,
            c=c,
            sample_rate_hz=sample_rate_hz,
            window=(0.5 - 0.5 * np.cos(angle)).astype(np.float32),
            hop=hop,
            bins=bins,
            plane=plane,
            steered=SteeredSearch.of(shape, c, per_hz, (low, high)),
        )

    def blank(self) -> VoteMemory:
        """Returns the memory before the first block."""
        tail = np.zeros((self.shape.count, 0), np.float32)
        echo = np.zeros(max(0, self.bins.stop - self.bins.start), np.float32)
        return VoteMemory(tail, 0, 0.0, echo, no_levels())

    @property
    def group_samples(self) -> int:
        """Number of samples in the group of frames of one vote."""
        return len(self.window) + (GROUP_FRAMES - 1) * self.hop

    @property
    def frequencies_hz(self) -> NDArray[np.float64]:
        """Frequencies of ``bins``, Hz."""
        k = np.arange(self.bins.start, self.bins.stop, dtype=np.float64)
        return k * self.sample_rate_hz / len(self.window)


def cast_votes(
    plan: VotePlan, memory: VoteMemory, block: NDArray[np.floating | np.integer]
) -> tuple[DirectionVotes, VoteMemory]:
    """Computes the votes for directions from one more block of (n, k) samples.

    The lengths of the blocks do not affect the votes, apart from rounding errors. The
    samples may have any unit. The first memory is ``plan.blank()``.
    """
    samples = np.concatenate((memory.tail, _checked(plan, block)), axis=1)
    groups = (samples.shape[1] - plan.group_samples) // plan.hop + 1
    if groups < 1:
        return no_votes(), memory._replace(tail=samples)
    size = len(plan.window)
    frames = np.lib.stride_tricks.sliding_window_view(samples, size, axis=1)
    frames = frames[:, : (groups + GROUP_FRAMES - 1) * plan.hop : plan.hop]
    spectra = fft.rfft(frames * plan.window, axis=2).transpose(1, 0, 2)
    middle = 0.5 * plan.group_samples + plan.hop * np.arange(
        memory.groups, memory.groups + groups
    )
    t_s = middle / plan.sample_rate_hz
    searched = group_powers(spectra[:, :, plan.steered.bins])
    bins = group_powers(spectra[:, :, plan.bins])
    powers = bins if bins.shape[1] else searched
    loud, level = louder_bins(powers, memory.level)
    hop_s = plan.hop / plan.sample_rate_hz
    rises, steady_db = standing_out(powers, memory.steady_db, hop_s)
    used = plan.bins if bins.shape[1] else plan.steered.bins
    heard = powers * a_weight(
        used.start, used.stop, len(plan.window) / plan.sample_rate_hz
    )
    cast = [
        _steered_votes(
            plan,
            spectra,
            _Groups(t_s, heard.sum(axis=1), rises.mean(axis=1)),
            np.asarray(loud.any(axis=1)),
            memory.groups,
        )
    ]
    fresh, echo = risen_bins(bins, memory.echo, hop_s)
    fitted = np.zeros((groups, 2))
    if bins.shape[1]:
        single, fitted = _bin_votes(
            plan,
            spectra[:, :, plan.bins],
            _Groups(t_s, heard, rises),
            loud & fresh,
        )
        cast.append(single)
    votes = join_votes(cast)
    tail = samples[:, groups * plan.hop :]
    after = VoteMemory(tail, memory.groups + groups, level, echo, steady_db)
    told = votes._replace(
        group_t_s=t_s, group_levels_db=levels_db(powers), group_fits=fitted
    )
    return told, after


class _Groups(NamedTuple):
    """Groups of frames, or their bins, from which votes come."""

    t_s: NDArray[np.float64]
    """(g,) middles of the groups, s."""
    power: NDArray[Any]
    """(g,) or (g, b) A-weighted power."""
    rises: NDArray[Any]
    """(g,) or (g, b) how far the sound stands out, 0 to 1."""


def _check(c: float, sample_rate_hz: float, band_hz: tuple[float, float]) -> None:
    if not _SPEEDS_M_S[0] <= c <= _SPEEDS_M_S[1]:
        raise InputError(
            "c", f"{c:g} m/s is not a speed of sound; use about 343 m/s in air"
        )
    if not 1_000.0 <= sample_rate_hz < math.inf:
        raise InputError(
            "sample_rate_hz", f"{sample_rate_hz:g} Hz; give at least 1000 Hz"
        )
    low, high = band_hz
    if not 0.0 < low < min(high, 0.5 * sample_rate_hz):
        raise InputError(
            "band_hz",
            f"{low:g} to {high:g} Hz at {sample_rate_hz:g} samples/s; give a lowest "
            "frequency above 0 and below the highest and half the rate",
        )


def _checked(
    plan: VotePlan, block: NDArray[np.floating | np.integer]
) -> NDArray[np.float32]:
    if block.ndim != 2 or len(block) != plan.shape.count:
        raise InputError(
            "block",
            f"it has the shape {block.shape}; give a row for each of the "
            f"{plan.shape.count} microphones",
        )
    samples = block.astype(np.float32)
    if not np.isfinite(samples).all():
        channel, sample = np.argwhere(~np.isfinite(samples))[0]
        raise InputError(
            "block",
            f"channel {channel + 1}: sample {sample} is {block[channel, sample]}; "
            "give numbers",
        )
    return samples


def _steered_votes(
    plan: VotePlan,
    spectra: NDArray[np.complex64],
    of: _Groups,
    loud: NDArray[np.bool_],
    groups: int,
) -> DirectionVotes:
    """Computes votes for the directions at which the steered response is greatest.

    A group has four frames. Only every fourth group votes, so that these groups have no
    frames in common.
    """
    found = []
    voting: list[int] = []
    first = -groups % GROUP_FRAMES
    for g in range(first, len(of.t_s), GROUP_FRAMES):
        if loud[g]:
            votes = plan.steered.votes(spectra[g : g + GROUP_FRAMES])
            found.append(votes)
            voting += [g] * len(votes[0])
    if not found:
        return no_votes()
    azimuth, elevation, weight = (np.concatenate(e) for e in zip(*found, strict=True))
    parts = (of.t_s[voting], azimuth, elevation, weight)
    return cast_of(*parts, of.power[voting], of.rises[voting], steered=True)


def _bin_votes(
    plan: VotePlan,
    spectra: NDArray[np.complex64],
    of: _Groups,
    loud: NDArray[np.bool_],
) -> tuple[DirectionVotes, NDArray[np.float64]]:
    """Computes the votes of single bins that contain only one wave.

    The other result is ``DirectionVotes.group_fits``.
    """
    group, bins, pattern = find_rank_one(spectra, loud, _LEAST_RATIO)
    frequency = plan.frequencies_hz[bins]
    fits = plan.plane.fit(pattern, frequency)
    told = np.stack(
        (
            np.bincount(group, minlength=len(of.t_s)),
            np.bincount(group[fits.clearly], minlength=len(of.t_s)),
        ),
        axis=1,
    )
    at = group[fits.fits], bins[fits.fits]
    votes = cast_of(
        of.t_s[at[0]],
        fits.azimuth,
        fits.elevation,
        frequency[fits.fits],
        of.power[at],
        of.rises[at],
        steered=False,
    )
    return votes, told.astype(np.float64)
