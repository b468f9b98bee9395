"""Directions from which single times and frequencies of a sound come.

Of several people who talk at once, one is far louder than the others at most times and
frequencies: averages over all of them lie between the talkers, single ones do not. Each
bin in which one wave alone reaches the array votes for a direction (after Mohan et al.
2008, and Pavlidi et al. 2013); ``analysis.arrays.voting.vote_peaks`` gathers the votes.
What is no louder than an echo of what came before does not vote.

The band ends where sound along the array's shortest pairs turns by half a period:
beyond it phases wrap, and votes pile up on the other side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.arrays.voting.phase_plane import PhasePlane
from analysis.arrays.voting.rank_one_bins import (
    GROUP_FRAMES,
    find_rank_one,
    group_powers,
)
from analysis.arrays.voting.steered_votes import SteeredSearch
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape

_FRAME_S = 0.032
# At least so many times what sound takes along the array.
_CROSSINGS = 6.0
_HOPS = 4

# Bins with less power than this share of all are dropped, and by how much its estimate
# follows in a hop.
_WEAKEST, _FOLLOW = 0.3, 0.1

# A bin votes where it is louder than what is left of the loudest so far by this factor;
# that decays so far in a second, as in a room of T60 1 s.
_RISE, _DECAY_DB_S = 1.6, 62.5

# Frequencies whose levels are kept.
_LEVELS = 24

# A band that ends below this holds too little of speech.
_LEAST_HIGHEST_HZ = 1_000.0

_SPEEDS_M_S = (100.0, 2_000.0)


class DirectionVotes(NamedTuple):
    """Votes in order of time, and levels over time."""

    t_s: NDArray[np.float64]
    """(k,) middle of the frames, s from the first sample."""
    azimuth: NDArray[np.float64]
    """(k,) rad, in (-pi, pi], from +x towards +y; on the side of ``ahead``."""
    elevation: NDArray[np.float64]
    """(k,) rad, above +z = 0; NaN where the array does not tell it."""
    weight: NDArray[np.float64]
    """(k,) frequency, Hz; of steered votes the response, 0 to 1."""
    steered: NDArray[np.bool_]
    """(k,) whether it is a vote of the steered response, not of a single bin."""
    group_t_s: NDArray[np.float64]
    """(g,) middles of all groups of frames, s."""
    group_levels_db: NDArray[np.float64]
    """(g, 24) power of all channels at some frequencies of the band, dB over the
    unit of the samples."""


class VoteMemory(NamedTuple):
    """What the blocks so far leave behind."""

    tail: NDArray[np.float32]
    """(n, m) samples that further votes need."""
    groups: int
    """Groups of frames so far."""
    level: float
    """Power of a bin below which the weakest lie; 0: nothing was heard yet."""
    echo: NDArray[np.float32]
    """(b,) power of each bin that what came before may have left."""


@dataclass(frozen=True)
class VotePlan:
    """How an array votes. Make one by ``VotePlan.of``."""

    shape: ArrayShape
    c: float
    """Speed of sound, m/s."""
    sample_rate_hz: float
    window: NDArray[np.float32]
    """(w,) Hann window of a frame."""
    hop: int
    """Samples from frame to frame."""
    bins: slice
    """Of the spectra, that vote one by one; empty where they cannot."""
    plane: PhasePlane
    steered: SteeredSearch
    least_ratio: float
    """Of the covariance's two largest eigenvalues."""

    @classmethod
    def of(
        cls,
        shape: ArrayShape,
        c: float,
        sample_rate_hz: float,
        *,
        band_hz: tuple[float, float] = (200.0, 8_000.0),
        least_ratio: float = 20.0,
    ) -> VotePlan:
        """A plan for an array and a rate.

        Args:
            shape: The microphones; they must tell bearings.
            c: Speed of sound, m/s.
            sample_rate_hz: Of the samples, Hz.
            band_hz: Lowest and highest frequency that may count, Hz. Bins vote only
                as far as the phases of the shortest pairs do not wrap.
            least_ratio: Of the two largest eigenvalues of a covariance that counts
                as one wave.

        Returns:
            The plan.

        Raises:
            InputError: The array tells no bearings, or a number makes no sense.
        """
        if "bearing" not in shape.angles:
            raise InputError(
                "microphones",
                "a row that is not level gives no bearings; give a row in the "
                "plane z = const, or add microphones off the row",
            )
        _check(c, sample_rate_hz, band_hz, least_ratio)
        frame_s = max(_FRAME_S, _CROSSINGS * shape.max_delay(c))
        hop = max(1, round(frame_s * sample_rate_hz / _HOPS))
        size = _HOPS * hop
        low, high = band_hz[0], min(band_hz[1], 0.5 * sample_rate_hz)
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
            least_ratio=least_ratio,
        )

    def blank(self) -> VoteMemory:
        """The memory before the first block."""
        tail = np.zeros((self.shape.count, 0), np.float32)
        echo = np.zeros(max(0, self.bins.stop - self.bins.start), np.float32)
        return VoteMemory(tail, 0, 0.0, echo)

    @property
    def group_samples(self) -> int:
        """Samples of the frames of a vote."""
        return len(self.window) + (GROUP_FRAMES - 1) * self.hop

    @property
    def frequencies_hz(self) -> NDArray[np.float64]:
        """Of ``bins``, Hz."""
        k = np.arange(self.bins.start, self.bins.stop, dtype=np.float64)
        return k * self.sample_rate_hz / len(self.window)


def cast_votes(
    plan: VotePlan, memory: VoteMemory, block: NDArray[np.floating | np.integer]
) -> tuple[DirectionVotes, VoteMemory]:
    """The votes that another block of samples makes possible.

    However a recording is cut into blocks, the votes are the same, but for rounding.

    Args:
        plan: How to vote.
        memory: What the last block left; ``plan.blank()`` at first.
        block: (n, k) samples of each channel, any unit, any k.

    Returns:
        The votes, and the new memory.

    Raises:
        InputError: The block has other channels than the array, or is not finite.
    """
    samples = np.concatenate((memory.tail, _checked(plan, block)), axis=1)
    groups = (samples.shape[1] - plan.group_samples) // plan.hop + 1
    if groups < 1:
        return _no_votes(), memory._replace(tail=samples)
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
    loud, level = _louder(powers, memory.level)
    cast = [
        _steered_votes(plan, spectra, np.asarray(loud.any(axis=1)), t_s, memory.groups)
    ]
    fresh, echo = _risen(bins, memory.echo, plan.hop / plan.sample_rate_hz)
    if bins.shape[1]:
        cast.append(_bin_votes(plan, spectra[:, :, plan.bins], loud & fresh, t_s))
    votes = join_votes(cast)
    tail = samples[:, groups * plan.hop :]
    after = VoteMemory(tail, memory.groups + groups, level, echo)
    return votes._replace(group_t_s=t_s, group_levels_db=_levels_db(powers)), after


def join_votes(parts: list[DirectionVotes]) -> DirectionVotes:
    """Votes of several blocks together, in order of time.

    Args:
        parts: As ``cast_votes`` returns them.

    Returns:
        All of them.
    """
    if not parts:
        return _no_votes()
    joined = DirectionVotes._make(
        np.concatenate(each) for each in zip(*parts, strict=True)
    )
    order = np.argsort(joined.t_s, kind="stable")
    return DirectionVotes._make([*(each[order] for each in joined[:5]), *joined[5:]])


def _check(
    c: float, sample_rate_hz: float, band_hz: tuple[float, float], least_ratio: float
) -> None:
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
    if not 1.0 <= least_ratio < math.inf:
        raise InputError("least_ratio", f"{least_ratio:g}; give at least 1")


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


def _no_votes() -> DirectionVotes:
    none = np.empty(0)
    return _cast(none, none, none, none, steered=False)


def _cast(
    t_s: NDArray[np.float64],
    azimuth: NDArray[np.float64],
    elevation: NDArray[np.float64],
    weight: NDArray[np.float64],
    *,
    steered: bool,
) -> DirectionVotes:
    """Votes of one kind, without the groups."""
    kind = np.full(len(t_s), steered)
    levels = np.empty((0, _LEVELS))
    return DirectionVotes(t_s, azimuth, elevation, weight, kind, np.empty(0), levels)


def _levels_db(powers: NDArray[np.float32]) -> NDArray[np.float64]:
    """(g, 24) levels of single bins, as many in each octave."""
    last = powers.shape[1] - 1
    kept = np.rint(np.geomspace(1.0, last + 1.0, _LEVELS)).astype(int) - 1
    chosen = powers[:, kept].astype(np.float64)
    return np.asarray(10.0 * np.log10(np.maximum(chosen, 1e-30)))


def _louder(
    powers: NDArray[np.float32], level: float
) -> tuple[NDArray[np.bool_], float]:
    """(g, b) bins above the weakest share of the last second, and its new level.

    The level of one group after another rises and falls with the share below it.
    """
    loud = np.zeros(powers.shape, dtype=bool)
    for row, kept in zip(powers, loud, strict=True):
        if not level > 0.0:
            level = float(np.quantile(row, _WEAKEST))
        np.greater(row, level, out=kept)
        below = 1.0 - kept.mean()
        level *= math.exp(_FOLLOW * (_WEAKEST - below))
    return loud, level


def _risen(
    powers: NDArray[np.float32], echo: NDArray[np.float32], hop_s: float
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """(g, b) bins that are louder than an echo of those before, and what they leave."""
    decay = np.float32(10.0 ** (-0.1 * _DECAY_DB_S * hop_s))
    fresh = np.empty(powers.shape, dtype=bool)
    for row, kept in zip(powers, fresh, strict=True):
        np.greater(row, np.float32(_RISE) * echo, out=kept)
        echo = np.maximum(row, decay * echo)
    return fresh, echo


def _steered_votes(
    plan: VotePlan,
    spectra: NDArray[np.complex64],
    loud: NDArray[np.bool_],
    t_s: NDArray[np.float64],
    groups: int,
) -> DirectionVotes:
    """Of groups that do not overlap by more than a frame."""
    found = []
    times = []
    first = -groups % GROUP_FRAMES
    for g in range(first, len(t_s), GROUP_FRAMES):
        if loud[g]:
            votes = plan.steered.votes(spectra[g : g + GROUP_FRAMES])
            found.append(votes)
            times.append(np.full(len(votes[0]), t_s[g]))
    if not found:
        return _no_votes()
    azimuth, elevation, weight = (np.concatenate(e) for e in zip(*found, strict=True))
    return _cast(np.concatenate(times), azimuth, elevation, weight, steered=True)


def _bin_votes(
    plan: VotePlan,
    spectra: NDArray[np.complex64],
    loud: NDArray[np.bool_],
    t_s: NDArray[np.float64],
) -> DirectionVotes:
    """Of times and frequencies at which there is one wave."""
    group, bins, pattern = find_rank_one(spectra, loud, plan.least_ratio)
    frequency = plan.frequencies_hz[bins]
    fits = plan.plane.fit(pattern, frequency)
    return _cast(
        t_s[group[fits.fits]],
        fits.azimuth,
        fits.elevation,
        frequency[fits.fits],
        steered=False,
    )
