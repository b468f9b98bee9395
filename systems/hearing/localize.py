"""Locates the source of sound in each frame of audio, with a memory between frames."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.delays.copied_channels import frame_repeats
from systems.delays.delay_plan import DelayPlan
from systems.delays.delay_search import DelaySearch, weakest_sound
from systems.delays.delay_sets import estimate_delay_sets
from systems.delays.delays import DelayEstimate, estimate_delays, look
from systems.delays.echo_errors import echo_errors, energy_spread
from systems.delays.frame_energy import frame_energy
from systems.delays.half_band import PASSED, halve_rate
from systems.delays.precedence import EchoMemory, keep_first_wave_front
from systems.framework.input_error import InputError
from systems.framework.signals import FRAME_SAMPLES, SAMPLE_RATE_HZ
from systems.hearing.coherent import arrival_delays, refine_source
from systems.hearing.multilateration import locate_source
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_fix import NEAREST_M, SourceFix
from systems.sound.array_shape import ArrayShape

# Least correlation of a frame that contains almost nothing but direct sound.
_DIRECT_CORRELATION = 0.98
# The same limit until the first frame without a sound. Until then, the noise level is
# unknown, and noise may explain the rest of the energy.
_FIRST_CORRELATION = 0.9

# Largest ratio of energy that counts as noise to the energy between the sounds. The
# ratio applies to energy that the channels do not share. If this energy is larger, it
# counts as echoes.
_NOISE_MARGIN = 3.0

# Number of frames over which the noise level is averaged.
_NOISE_FRAMES = 8.0

# A knock, or a sound with too much reverberation to be detected, must not raise the
# noise level much. The average uses at most this many times the noise level for one
# frame.
_LOUDEST_NOISE = 1.5

# Least correlation of a frame that is accepted after the suppression of echoes.
_ECHO_CORRELATION = 0.4
# Largest ambiguity of a frame that is accepted after the suppression of echoes.
_ECHO_AMBIGUITY = 0.7

# The first frame of a sound may contain the sound in some channels only. The localizer
# rejects such a frame if noise alone reaches the lowest peak with more than this
# probability.
_SHARED_CHANCE = 1e-3

# Number of standard deviations by which a quiet frame may be below its expected energy.
# One percent of the frames with the weakest detectable sound are quieter.
_QUIET = 2.33

# Number of sets of delays that are examined if sounds overlap.
_SETS = 4
# Least correlation of a set of delays. Some sets occur by chance. If two sounds of
# 0.5-8 kHz overlap, one in twenty of the sets by chance has a higher correlation.
_SET_CORRELATION = 0.1

# No set that occurs by chance has a correlation as high as this.
_SURE_CORRELATION = 0.25

# Number of standard deviations by which the delays of the pairs in a set may disagree,
# in addition to the usual limit.
_SET_CLOSURE = 2.0

# Two sets belong to one sound if each of their delays differs by at most this, s.
_ONE_SOUND_S = 1e-4

# Two microphones are an even pair if their distances from the centroid differ by less
# than this, m.
_ALIKE_M = 1e-3

# A sound begins within a frame if its energy is spread over less than this share of the
# frame.
_WHOLE_FRAME = 0.8


# The following limits of the delays and of the position of a sound are not in the
# papers.
# Largest disagreement between the delay of a pair and the delays of all pairs, s.
_LARGEST_CLOSURE_S = 5e-6
# Largest ratio of the second peak of a correlation to its highest peak.
_LARGEST_AMBIGUITY = 0.8
# Largest difference between a measured delay and the delay of the estimated position,
# as a share of the longest delay across the array. _LARGEST_CLOSURE_S is added. The
# limit has an effect only if there are more delays than unknowns, for example with four
# or more microphones in a row.
_LARGEST_MISFIT = 0.05
# Largest standard deviation of a bearing, rad.
_LARGEST_BEARING_STD = math.radians(3.0)
# Largest standard deviation of a range, as a share of the range. If the standard
# deviation is larger, only the bearing is used.
_LARGEST_RANGE_STD = 0.25


class HearingMemory(NamedTuple):
    """Values that the localizer keeps from one frame to the next one."""

    energy: float
    """Average energy of a frame without a sound, in units of the frame squared. Rumble
    (low frequencies) is excluded. The value is 0 before the first frame without a
    sound."""
    noise_energy: float
    """Average energy of one channel of a frame without a sound, in units of the frame
    squared. It is the energy within the band, at the sample rate of the plan."""
    echoes: NDArray[np.float32] | None = None
    """(n, bins) memory of past power in ``systems.delays.precedence``. None if the
    memory is below the noise."""
    heard: bool = False
    """Whether the frame contained a sound."""


class Candidate(NamedTuple):
    """One of the sounds of a frame."""

    fix: SourceFix
    """Estimated position or direction of its source."""
    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0, s. t_k is the time of arrival at channel k."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, s^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    sure: bool = True
    """Whether the correlation is higher than any that occurs by chance."""
    alone: bool = False
    """Whether this sound dominates, so that it determines the delays of the frame."""


class _Sound(NamedTuple):
    """A frame that contains a sound."""

    heard: NDArray[np.float32]
    """(n, samples) channels at the sample rate of the plan."""
    seen: tuple[DelaySearch, slice]
    """Return value of ``look``."""


def _averaged(known: float, new: float) -> float:
    """Returns the noise level after one more frame."""
    return known + (min(new, _LOUDEST_NOISE * known) - known) / _NOISE_FRAMES


def _is_doubtful(delays: DelayEstimate) -> bool:
    """Returns whether the delays of a sound may be wrong."""
    return delays.closure > _LARGEST_CLOSURE_S or delays.ambiguity > _LARGEST_AMBIGUITY


class Localizer:
    """Locates the sources of sound in successive frames of audio.

    The frames have the form that ``MicArray`` publishes. If the band allows it, the
    class halves the sample rate of the frames to save time. Delays are not restricted
    to whole samples.

    Args:
        parameters: Method, band and rate of false alarms.
        shape: The microphones.
        c: Speed of sound, m/s.
        sample_rate_hz: Sample rate of the frames, Hz.
        frame_samples: Samples per channel of a frame.
        limited: Whether to reject estimates that are not reliable. If not, every
            estimate counts, as in the papers.

    Raises:
        InputError: The array cannot be used at this sample rate and band.
    """

    def __init__(
        self,
        parameters: TDOAParameters,
        shape: ArrayShape,
        c: float,
        *,
        sample_rate_hz: float = SAMPLE_RATE_HZ,
        frame_samples: int = FRAME_SAMPLES,
        limited: bool = True,
    ) -> None:
        whole = parameters.method == "amdf" or frame_samples % 2 == 1
        low_hz, high_hz = parameters.limits_hz
        self._halved = not whole and high_hz <= PASSED * sample_rate_hz
        self._sample_rate_hz = sample_rate_hz
        divisor = 2 if self._halved else 1
        plan = DelayPlan(
            shape=shape,
            c=c,
            sample_rate_hz=sample_rate_hz / divisor,
            frame_samples=frame_samples // divisor,
            low_hz=low_hz,
            high_hz=high_hz,
        )
        self.plan = plan
        self.parameters = parameters
        self._limited = limited
        self._sizes = EchoMemory(plan.shape.count, plan.sample_rate_hz)
        band = plan.band.stop - plan.band.start
        self._band_samples = plan.frame_samples * band / plan.length
        channels = plan.shape.count
        self._frame_shape = (channels, frame_samples)
        self._scatter = _QUIET * math.sqrt(2.0 / (channels * frame_samples))
        # Uneven pairs: the two microphones have different distances from a source
        # straight ahead of the centroid.
        i, j = plan.shape.pairs.T
        from_center = np.linalg.norm(plan.shape.p_AM, axis=1)
        self._uneven = np.abs(from_center[i] - from_center[j]) > _ALIKE_M
        self._all = np.ones(len(i), dtype=bool)
        # Factor that converts the average energy of one channel, on one side of the
        # spectrum, to the energy of all channels and samples, on both sides.
        self._frame_share = 2.0 * channels * frame_samples / plan.frame_samples
        # For the setting "found", the band may be arbitrarily narrow, so the weakest
        # sound is unknown.
        self._weakest = 0.0
        if parameters.band_hz != "found":
            self._weakest = weakest_sound(plan, parameters.false_alarm_rate)

    def blank(self) -> HearingMemory:
        """Returns the memory before the first frame."""
        return HearingMemory(0.0, 0.0)

    def full(self) -> HearingMemory:
        """Returns an example of the memory in which nothing is None."""
        echoes = np.zeros(self._sizes.shape, np.float32)
        return HearingMemory(0.0, 0.0, echoes)

    def localize(
        self, frame: NDArray[np.float32 | np.int16], memory: HearingMemory
    ) -> tuple[SourceFix | None, HearingMemory]:
        """Locates the dominant sound of an audio frame.

        Args:
            frame: (n, samples) channels, in any unit, for example counts.
            memory: Memory after the previous frame.

        Returns:
            Two values: the source on the side of ``ArrayShape.ahead``, or None if there
            is no estimate; and the new memory.

        Raises:
            InputError: The shape of the frame does not fit this array, or a value of
                the frame is not finite.
        """
        sound, after = self._sound(frame, memory)
        if sound is None:
            return None, after
        first, after = self._first(sound, memory, after)
        if first is None or self._is_copied(frame, first.fix, memory):
            return None, after
        return first.fix, after

    def candidates(
        self, frame: NDArray[np.float32 | np.int16], memory: HearingMemory
    ) -> tuple[list[Candidate], HearingMemory]:
        """Locates each of the sounds of an audio frame.

        Args:
            frame: (n, samples) channels, in any unit, for example counts.
            memory: Memory after the previous frame.

        Returns:
            Two values: the list of sounds, and the new memory. The list begins with the
            sound that ``localize`` finds, if any. Further sounds follow in the order of
            ``estimate_delay_sets``.

        Raises:
            InputError: The shape of the frame does not fit this array, or a value of
                the frame is not finite.
        """
        sound, after = self._sound(frame, memory)
        if sound is None:
            return [], after
        first, after = self._first(sound, memory, after)
        found = [] if first is None else [first._replace(alone=True)]
        # Correlations by chance are higher if the sound fills only a part of the frame.
        spread = energy_spread(sound.heard)
        for delays in estimate_delay_sets(
            sound.heard, self.plan, self.parameters.method, sound.seen, _SETS
        ):
            far = [np.abs(delays.tau - other.tau).max() for other in found]
            apart = min(far, default=math.inf) > _ONE_SOUND_S
            whole = delays.correlation * spread
            if apart and whole > _SET_CORRELATION:
                further = self._one_of_several(delays)
                sure = whole > _SURE_CORRELATION
                found += [] if further is None else [further._replace(sure=sure)]
        return [c for c in found if not self._is_copied(frame, c.fix, memory)], after

    def _one_of_several(self, delays: DelayEstimate) -> Candidate | None:
        """Locates one of several sounds from the set of its delays.

        The other sounds act as noise. Therefore the delays of the pairs may disagree
        more than those of a single sound. The result is None if the delays or the
        position are rejected.
        """
        scatter = math.sqrt(float(np.diag(delays.covariance).max()))
        closure = max(0.0, delays.closure - _SET_CLOSURE * scatter)
        return self._fix(delays._replace(closure=closure, ambiguity=0.0))

    def _sound(
        self, frame: NDArray[np.float32 | np.int16], memory: HearingMemory
    ) -> tuple[_Sound | None, HearingMemory]:
        """Detects a sound in an audio frame by three tests.

        1. The energy must be above the energy of noise.
        2. The correlation peaks must be too high for noise alone.
        3. If the frame is the first frame of a sound, all channels must contain the
           sound.

        The function returns the detected sound, or None if a test fails, and the new
        memory.
        """
        energy = self._checked_energy(frame)
        if energy <= self._quietest(memory):
            return None, self._after_noise(memory, energy)
        heard: NDArray[np.float32] = (
            halve_rate(frame) if self._halved else frame.astype(np.float32, copy=False)
        )
        seen = look(
            heard,
            self.plan,
            self.parameters.method,
            find_band=self.parameters.band_hz == "found",
        )
        if seen is None:
            return None, memory
        search = seen[0]
        if search.chance > self.parameters.false_alarm_rate:
            return None, self._after_noise(memory, energy, search.energy)
        after = memory._replace(heard=True)
        if not memory.heard and search.weakest > _SHARED_CHANCE:
            return None, after
        return _Sound(heard, seen), after

    def _first(
        self, sound: _Sound, before: HearingMemory, memory: HearingMemory
    ) -> tuple[Candidate | None, HearingMemory]:
        """Locates the sound that dominates a frame, if there is one."""
        heard, seen = sound
        if not self.parameters.suppress_echoes:
            return self._fix(self._delays(heard, seen), heard), memory
        begins = not before.heard and energy_spread(heard) < _WHOLE_FRAME
        return self._locate(heard, seen, memory, begins=begins)

    def _quietest(self, memory: HearingMemory) -> float:
        """Returns the energy that 99 % of the frames with a detectable sound exceed."""
        in_band = self._frame_share * memory.noise_energy
        # Noise in the band cannot have more energy than the noise without rumble.
        rise = self._weakest * min(in_band, memory.energy)
        return (1.0 - self._scatter) * memory.energy + rise

    def _locate(
        self,
        frame: NDArray[np.float32],
        seen: tuple[DelaySearch, slice],
        memory: HearingMemory,
        *,
        begins: bool,
    ) -> tuple[Candidate | None, HearingMemory]:
        """Locates the sound that ``look`` found in an audio frame.

        If the channels share almost all of their energy, the delays of the frame are
        final. Otherwise the function suppresses the echoes and measures the delays
        again. It then adds the errors due to the remaining echoes to the covariance.

        A sound that begins within the frame may include a reflection off the floor,
        which no single channel reveals. For such a sound, the function always adds
        these errors.
        """
        delays = self._delays(frame, seen)
        direct = delays is not None and self._is_direct(delays, memory)
        if direct and not begins:
            return self._fix(delays, frame), memory
        dry, echoes, news = keep_first_wave_front(
            frame, memory.echoes, self._sizes, self._noise_density(memory)
        )
        memory = memory._replace(echoes=echoes)
        if direct:
            news = 1.0
        else:
            frame, delays = dry, self._delays(dry)
        if (
            delays is None
            or delays.correlation < _ECHO_CORRELATION
            or delays.ambiguity > _ECHO_AMBIGUITY
        ):
            return None, memory
        plan = self.plan
        errors = echo_errors(plan.shape, plan.c, news, delays.angular_frequency)
        return self._fix(delays, echoes=errors), memory

    def _checked_energy(self, frame: NDArray[np.float32 | np.int16]) -> float:
        if frame.shape != self._frame_shape:
            channels, samples = self._frame_shape
            raise InputError(
                "audio",
                f"a frame of shape {frame.shape}; give one channel for each of "
                f"the {channels} microphones, of {samples} samples",
            )
        energy = frame_energy(frame)
        if not math.isfinite(energy) and not np.isfinite(frame).all():
            channel, sample = np.argwhere(~np.isfinite(frame))[0]
            raise InputError(
                "audio",
                f"channel {channel + 1}: sample {sample} is "
                f"{frame[channel, sample]}; give numbers",
            )
        return energy

    def _is_place(self, fix: SourceFix, tau: NDArray[np.float64]) -> bool:
        """Returns whether a source can be at this position and cause these delays."""
        shape, c = self.plan.shape, self.plan.c
        if fix.range_valid and fix.range < NEAREST_M:
            return False
        if shape.freedom <= 0 or not self._limited:
            return True
        limit = _LARGEST_CLOSURE_S + _LARGEST_MISFIT * shape.max_delay(c)
        return bool(np.abs(arrival_delays(fix, shape, c) - tau).max() <= limit)

    def _is_copied(
        self,
        frame: NDArray[np.float32 | np.int16],
        fix: SourceFix,
        memory: HearingMemory,
    ) -> bool:
        """Returns whether two channels of an audio frame repeat each other.

        Two microphones at equal distances from the centroid have equal distances from a
        source straight ahead. Without noise, they then record equal samples. In frames
        without noise, the function therefore does not compare their channels at lag 0.
        """
        shape = self.plan.shape
        # A fix without range has the delays of a plane wave. They may differ from those
        # of the frame, so the channels are also compared at lag 0.
        later = self._sample_rate_hz * arrival_delays(fix, shape, self.plan.c)
        noisy = memory.energy > 0.0
        at_once = self._all if noisy else self._uneven
        return frame_repeats(frame, shape.pairs, later, at_once, noisy=noisy)

    def _delays(
        self, frame: NDArray[np.float32], seen: tuple[DelaySearch, slice] | None = None
    ) -> DelayEstimate | None:
        return estimate_delays(
            frame,
            self.plan,
            self.parameters.method,
            find_band=self.parameters.band_hz == "found",
            seen=seen,
        )

    def _after_noise(
        self, memory: HearingMemory, energy: float, noise_energy: float | None = None
    ) -> HearingMemory:
        """Returns the memory after an audio frame of noise.

        ``energy`` is the energy of the frame without rumble. ``noise_energy`` is the
        energy within the band, or None if it was not measured.
        """
        echoes = memory.echoes
        if echoes is not None:
            echoes = self._sizes.faded(echoes, self.plan.frame_samples)
            if echoes.max() <= self._sizes.least(self._noise_density(memory)):
                echoes = None
        if not memory.energy > 0.0:
            return HearingMemory(energy, noise_energy or 0.0, echoes)
        if noise_energy is None:
            noise_energy = memory.noise_energy * energy / memory.energy
        return HearingMemory(
            _averaged(memory.energy, energy),
            _averaged(memory.noise_energy, noise_energy),
            echoes,
        )

    def _noise_density(self, memory: HearingMemory) -> float:
        """Returns the mean square of white noise as loud as the noise in the band."""
        return memory.noise_energy / self._band_samples

    def _is_direct(self, delays: DelayEstimate, memory: HearingMemory) -> bool:
        """Returns whether noise explains the energy that the channels do not share."""
        known = memory.noise_energy
        least = _DIRECT_CORRELATION if known > 0.0 else _FIRST_CORRELATION
        return (
            delays.correlation >= least or delays.noise_energy <= _NOISE_MARGIN * known
        )

    def _fix(
        self,
        delays: DelayEstimate | None,
        frame: NDArray[np.float32] | None = None,
        echoes: NDArray[np.float64] | None = None,
    ) -> Candidate | None:
        """Returns the position that explains the delays of a sound.

        The method ``ml`` refines the position with the audio frame, unless ``frame`` is
        None. ``echoes`` is the (n - 1, n - 1) covariance of the delays due to remaining
        echoes, s^2. The result is None if the delays or the position are rejected.
        """
        plan = self.plan
        if delays is None or (self._limited and _is_doubtful(delays)):
            return None
        covariance = delays.covariance
        if echoes is not None:
            covariance = covariance + echoes
        fix = locate_source(delays.tau, covariance, plan.shape, plan.c)
        if not self._is_place(fix, delays.tau):
            return None
        if self.parameters.method == "ml" and frame is not None:
            bins = delays.band
            hertz = plan.sample_rate_hz / plan.length
            fix = (
                refine_source(
                    frame,
                    fix,
                    plan.shape,
                    plan.c,
                    sample_rate_hz=plan.sample_rate_hz,
                    band_hz=(bins.start * hertz, (bins.stop - 1) * hertz),
                )
                or fix
            )
        if self._limited:
            if fix.bearing_std > _LARGEST_BEARING_STD:
                return None
            fix = fix.within_error(_LARGEST_RANGE_STD)
        return Candidate(fix, delays.tau, covariance, delays.correlation)
