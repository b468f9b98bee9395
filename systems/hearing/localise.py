"""From one frame of sound to a place, with what has to be remembered for it."""

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

# From this correlation on, a frame holds hardly anything but the direct sound; and
# where the noise was not heard alone yet, so that it may be the rest.
_DIRECT_CORRELATION = 0.98
_FIRST_CORRELATION = 0.9

# What channels do not share is noise as long as it is below this many times what
# is heard between the sounds; beyond, it is echoes.
_NOISE_MARGIN = 3.0

# Frames over which the level of the noise is averaged.
_NOISE_FRAMES = 8.0

# A knock, or a sound that reverberates too much to be heard, may raise that level no
# more than a noise of so many times it.
_LOUDEST_NOISE = 1.5

# Frames whose echoes were suppressed are believed from this correlation on, and up
# to this ambiguity.
_ECHO_CORRELATION = 0.4
_ECHO_AMBIGUITY = 0.7

# In the first frame of a sound it may not have reached all channels: noise alone
# would seem to be heard there with more than this probability.
_SHARED_CHANCE = 1e-3

# Of the frames that hold the weakest sound that can be heard so many are quieter
# than expected by this many standard deviations: 1 %.
_QUIET = 2.33

# Sets of delays that are followed up where sounds overlap, and the least correlation
# of one: of what chance leaves beside two sounds of 0.5-8 kHz a twentieth is higher.
_SETS = 4
_SET_CORRELATION = 0.1

# Nothing that is left correlates as much as this.
_SURE_CORRELATION = 0.25

# The delays of its pairs may disagree by so many standard deviations more.
_SET_CLOSURE = 2.0

# Sets with all delays this near to each other are one sound, s.
_ONE_SOUND_S = 1e-4

# Microphones whose distances from the centroid differ by less are an even pair, m.
_ALIKE_M = 1e-3

# A sound begins within a frame whose energy is spread over less than this share
# of it.
_WHOLE_FRAME = 0.8


class HearingMemory(NamedTuple):
    """What a frame leaves behind for the next one."""

    energy: float
    """Of a frame between the sounds, without rumble, units of the frame squared; 0
    until such a frame was heard."""
    noise_energy: float
    """Of its mean channel within the band, of what is left at the plan's rate."""
    echoes: NDArray[np.float32] | None = None
    """(n, bins) see ``systems.delays.precedence``; None where the noise is louder."""
    heard: bool = False
    """Whether it held a sound."""


class Candidate(NamedTuple):
    """One of the sounds of a frame."""

    fix: SourceFix
    """Where it comes from."""
    tau: NDArray[np.float64]
    """(n - 1,) its delays t_k - t_0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) of them, s^2."""
    correlation: float
    """Least correlation coefficient of the pairs, 0 to 1."""
    sure: bool = True
    """Whether it correlates more than chance does."""
    alone: bool = False
    """Whether it outweighs whatever else sounds."""


class _Sound(NamedTuple):
    """A frame that holds a sound."""

    heard: NDArray[np.float32]
    """(n, samples) at the plan's rate."""
    seen: tuple[DelaySearch, slice]
    """What ``look`` returned."""


def _averaged(known: float, new: float) -> float:
    """The level of the noise after one more frame."""
    return known + (min(new, _LOUDEST_NOISE * known) - known) / _NOISE_FRAMES


class Localiser:
    """Where the sounds of successive frames come from.

    Frames as ``MicArray`` publishes them are heard at half their rate, where that
    leaves the band, and delays need not be whole samples.

    Args:
        parameters: Method, band and thresholds.
        shape: The microphones.
        c: True speed of sound, m/s.
        sample_rate_hz: Of the frames, Hz.
        frame_samples: Of a frame, a channel.

    Raises:
        InputError: The array cannot serve at this rate and band.
    """

    def __init__(
        self,
        parameters: TDOAParameters,
        shape: ArrayShape,
        c: float,
        *,
        sample_rate_hz: float = SAMPLE_RATE_HZ,
        frame_samples: int = FRAME_SAMPLES,
    ) -> None:
        whole = parameters.method == "amdf" or frame_samples % 2 == 1
        self._halved = not whole and parameters.high_hz <= PASSED * sample_rate_hz
        self._sample_rate_hz = sample_rate_hz
        divisor = 2 if self._halved else 1
        plan = DelayPlan(
            shape=shape,
            c=parameters.sound_speed_m_s or c,
            sample_rate_hz=sample_rate_hz / divisor,
            frame_samples=frame_samples // divisor,
            low_hz=parameters.low_hz,
            high_hz=parameters.high_hz,
        )
        self.plan = plan
        self.parameters = parameters
        self._sizes = EchoMemory(plan.shape.count, plan.sample_rate_hz)
        band = plan.band.stop - plan.band.start
        self._band_samples = plan.frame_samples * band / plan.length
        channels = plan.shape.count
        self._frame_shape = (channels, frame_samples)
        self._scatter = _QUIET * math.sqrt(2.0 / (channels * frame_samples))
        # Pairs that no source ahead of the centroid is as far from.
        i, j = plan.shape.pairs.T
        from_centre = np.linalg.norm(plan.shape.p_AM, axis=1)
        self._uneven = np.abs(from_centre[i] - from_centre[j]) > _ALIKE_M
        self._all = np.ones(len(i), dtype=bool)
        # Both sides of the spectrum, all channels, all samples.
        self._frame_share = 2.0 * channels * frame_samples / plan.frame_samples
        # A band that is found may be as narrow as it likes.
        self._weakest = 0.0
        if parameters.band == "set":
            self._weakest = weakest_sound(plan, parameters.false_alarm_rate)

    def blank(self) -> HearingMemory:
        """The memory before the first frame."""
        return HearingMemory(0.0, 0.0)

    @property
    def echo_shape(self) -> tuple[int, int]:
        """Shape of ``HearingMemory.echoes``."""
        return self._sizes.shape

    def localise(
        self, frame: NDArray[np.float32 | np.int16], memory: HearingMemory
    ) -> tuple[SourceFix | None, HearingMemory]:
        """Where the sound of a frame comes from.

        Args:
            frame: (n, samples) channels, any unit; counts will do.
            memory: What the last frame left.

        Returns:
            The source on the side of ``ArrayShape.ahead``, or None where nothing
            is heard, and the new memory.

        Raises:
            InputError: The frame is no frame of this array, or not finite.
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
        """Where each of the sounds of a frame comes from.

        Args:
            frame: As of ``localise``.
            memory: What the last frame left.

        Returns:
            What ``localise`` finds, if anything, then further sounds, those with the
            greatest correlations first; and the new memory.

        Raises:
            InputError: As ``localise``.
        """
        sound, after = self._sound(frame, memory)
        if sound is None:
            return [], after
        first, after = self._first(sound, memory, after)
        found = [] if first is None else [first._replace(alone=True)]
        # In a part of a frame chance correlates more.
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
        """The place behind a set of delays, where it is believed.

        To each sound the others are noise: its pairs may disagree by what that does.
        """
        scatter = math.sqrt(float(np.diag(delays.covariance).max()))
        closure = max(0.0, delays.closure - _SET_CLOSURE * scatter)
        return self._fix(delays._replace(closure=closure, ambiguity=0.0))

    def _sound(
        self, frame: NDArray[np.float32 | np.int16], memory: HearingMemory
    ) -> tuple[_Sound | None, HearingMemory]:
        """What a frame holds beside noise, None if nothing, and the new memory."""
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
            find_band=self.parameters.band == "found",
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
        """The sound that outweighs the others of a frame, if one does."""
        heard, seen = sound
        if not self.parameters.suppress_echoes:
            return self._fix(self._delays(heard, seen), heard), memory
        begins = not before.heard and energy_spread(heard) < _WHOLE_FRAME
        return self._locate(heard, seen, memory, begins=begins)

    def _quietest(self, memory: HearingMemory) -> float:
        """Energy that 99 of 100 frames reach that hold a sound above the noise."""
        in_band = self._frame_share * memory.noise_energy
        # What of it is no rumble.
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
        """Where the sound comes from that ``look`` has seen in a frame.

        A sound that begins within the frame may have met the floor, which shows in
        no channel alone: it is never taken to be free of echoes.
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
        """Whether a source could be there, and the delays be those from there."""
        shape, c = self.plan.shape, self.plan.c
        if fix.range_valid and fix.range < NEAREST_M:
            return False
        if shape.freedom <= 0:
            return True
        limit = self.parameters.maximum_closure_s
        limit += self.parameters.maximum_misfit * shape.max_delay(c)
        return bool(np.abs(arrival_delays(fix, shape, c) - tau).max() <= limit)

    def _is_copied(
        self,
        frame: NDArray[np.float32 | np.int16],
        fix: SourceFix,
        memory: HearingMemory,
    ) -> bool:
        """Whether channels of a located frame repeat each other.

        Without any noise, two microphones that are as far from the source do.
        """
        shape = self.plan.shape
        # A direction alone may belong to delays that are not its own: none counts too.
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
            find_band=self.parameters.band == "found",
            seen=seen,
        )

    def _after_noise(
        self, memory: HearingMemory, energy: float, noise_energy: float | None = None
    ) -> HearingMemory:
        """Noise of a frame's energy, and of that within the band if it is known."""
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
        """Energy of the noise a sample of the band."""
        return memory.noise_energy / self._band_samples

    def _is_direct(self, delays: DelayEstimate, memory: HearingMemory) -> bool:
        """Whether noise alone explains what the channels do not share."""
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
        """The place behind the delays of a frame, where they are believed.

        Args:
            delays: Of the sound.
            frame: Where it is to be refined by the method ``ml``, if that is set.
            echoes: Further covariance, of delays whose echoes were suppressed.
        """
        parameters, plan = self.parameters, self.plan
        if (
            delays is None
            or delays.closure > parameters.maximum_closure_s
            or delays.ambiguity > parameters.maximum_ambiguity
        ):
            return None
        covariance = delays.covariance
        if echoes is not None:
            covariance = covariance + echoes
        fix = locate_source(delays.tau, covariance, plan.shape, plan.c)
        if not self._is_place(fix, delays.tau):
            return None
        if parameters.method == "ml" and frame is not None:
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
        if fix.bearing_std > math.radians(parameters.maximum_bearing_std_deg):
            return None
        fix = fix.within_error(parameters.maximum_relative_range_std)
        return Candidate(fix, delays.tau, covariance, delays.correlation)
