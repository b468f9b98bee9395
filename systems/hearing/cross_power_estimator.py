"""Locates a source from spectra that are summed while the robot rests and listens."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.delays.correlations import parabola_vertex
from systems.framework.block import OBJECT, Port
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame
from systems.hearing.cross_powers import (
    FINE,
    CrossPowers,
    FrameSpectra,
    cross_correlations,
    gather_frame,
    no_powers,
    signal_powers,
)
from systems.hearing.frame_block import FrameBlock
from systems.hearing.source_fix import range_status
from systems.hearing.spherical_interpolation import near_or_far, plane_wave_bearing
from systems.hearing.steer_near import near_grid, steer
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.parameters import MicArrayParameters

#: Band of the sound, Hz (Song 2011, 4.3). At low sample rates, half the rate is the
#: upper edge.
_LOW_HZ, _HIGH_HZ = 200.0, 8_000.0
#: Least bandwidth of a sound, Hz. With less bandwidth, the correlation repeats within
#: the delays of the array, so that any bearing fits. A steady tone has a bandwidth of
#: up to 310 Hz because of its ends and of echoes. A siren has a bandwidth of some
#: thousand Hz.
_LEAST_BANDWIDTH_HZ = 600.0
#: A channel counts as silent up to this share of the power of the median channel.
_DEAF = 1e-4
#: Least response for a sound, as a share of a reference sum. The reference is the sum
#: that the occupied bins of all pairs would have if they came from one position. If the
#: response is lower, nothing is heard.
_COHERENT = 0.15
#: Least response for a sound, as a multiple of the root of 2 n, where n is the number
#: of occupied bins. In 60 recordings of silence, chance reached at most 5.1 times this
#: root.
_CHANCE = 5.5
#: Least number of frames for an estimate.
LEAST_FRAMES = 4
#: Share of the strongest response. If the response of another direction is at least
#: this share, the result is ambiguous.
_AMBIGUOUS_SHARE = 0.9


class Direction(NamedTuple):
    """Estimated direction of a sound."""

    bearing: float
    """Bearing from the middle microphone, CCW from the x axis of B, rad."""
    range_status: int
    """Result of the function ``range_status``: whether there is a range, or why there
    is none."""
    place: NDArray[np.float64] | None = None
    """(2,) position relative to the middle microphone in the axes of the body frame B,
    m. None if only the bearing is known."""
    ambiguous: bool = False
    """Whether other directions fit about equally well."""
    other: float = 0.0
    """Bearing of the best other direction, rad."""


class ArrayListener:
    """Sums spectra and estimates directions, without a Drake context.

    Args:
        robot: Positions of the microphones, the middle microphone first.
        c: Speed of sound, m/s.
        microphones: Sample rate and length of the audio frames.

    Raises:
        InputError: There are fewer than four microphones.
    """

    def __init__(
        self, robot: RobotParameters, c: float, microphones: MicArrayParameters
    ) -> None:
        places = np.array(robot.microphones_m)
        if len(places) < 4:
            raise InputError(
                "robot.microphones_m",
                f"has {len(places)} microphones; give four or more, with the "
                "first in the middle",
            )
        self.c = c
        """Speed of sound, m/s."""
        self.band_hz = _LOW_HZ, min(_HIGH_HZ, 0.5 * microphones.sample_rate_hz)
        """Lowest and highest frequency to use, Hz."""
        self.p_PR_B = places[0]
        """(2,) position of the middle microphone relative to P, in B axes, m."""
        self.p_RM = places - places[0]
        """(n, 2) positions of the microphones relative to the middle one, m."""
        self.facts = FrameSpectra(
            len(places),
            microphones.frame_samples,
            microphones.sample_rate_hz,
            self.band_hz[1],
        )

    def lost(self, sound: CrossPowers) -> list[int]:
        """Returns the numbers of the silent channels, counted from 0.

        ``sound`` has the sums of spectra from the time in which the source sounded.
        """
        power = sound.own.sum(axis=1)
        return np.flatnonzero(power <= _DEAF * np.median(power)).tolist()

    def direction(self, sound: CrossPowers, noise: CrossPowers) -> Direction | None:
        """Estimates the direction from which the sound comes.

        The function subtracts the cross powers of the noise, and whitens the result.
        For each position of a grid, it adds up the correlations of all pairs of
        channels at the delays of this position. The position with the largest sum gives
        the bearing. The peaks of the correlations near the delays of this position give
        a range.

        Args:
            sound: Sums of spectra from the time in which the source sounded.
            noise: Sums of spectra from before the sound, or empty sums.

        Returns:
            The direction. None if nothing is heard, or if fewer than three microphones
            work.
        """
        lost, facts = self.lost(sound), self.facts
        if sound.frames < LEAST_FRAMES or facts.channels - len(lost) < 3:
            return None
        heard = [
            k for k, pair in enumerate(facts.pairs) if not {*pair}.intersection(lost)
        ]
        mean, occupied = signal_powers(facts, sound, noise, self.band_hz)
        if not occupied[heard].any():
            return None
        # The phases of the cross powers carry the delays (whitening).
        narrow = self._bandwidth(occupied[heard]) < _LEAST_BANDWIDTH_HZ
        size = np.maximum(np.abs(mean), 1e-300)
        # Sum of the correlations of all pairs at each position of the grid.
        weighted = np.where(occupied, mean / size, 0.0)
        correlations = cross_correlations(facts, weighted)[heard]
        pairs = [facts.pairs[k] for k in heard]
        found = steer(
            near_grid(self.p_RM, pairs, self.c),
            correlations,
            FINE * facts.rate_hz,
        )
        # Noise alone must not reach the strongest sum.
        bins = 2.0 * float(occupied[heard].sum())
        chance = 0.0 if narrow else _CHANCE * math.sqrt(bins)
        if found.response < max(_COHERENT * bins, chance):
            return None
        # Position from the exact delays of the peaks.
        delays = self._refined(correlations, found.delays)
        bearing, place, status = self._interpolated(pairs, delays, lost)
        ambiguous = narrow or found.other_share >= _AMBIGUOUS_SHARE
        bearing = self.bearing_of(found.bearing, bearing)
        return Direction(bearing, status, place, ambiguous, found.other)

    def bearing_of(self, steered: float, interpolated: float) -> float:
        """Returns the bearing to report, rad, which is ``steered`` in this class.

        ``steered`` is the bearing of the position with the largest sum of correlations,
        rad. ``interpolated`` is the bearing from the delays of the peaks, rad. A
        subclass may report ``interpolated``.
        """
        return steered

    def _bandwidth(self, occupied: NDArray[np.bool_]) -> float:
        """Returns the bandwidth of the sound in the median pair, Hz."""
        width = self.facts.rate_hz / self.facts.length
        return float(np.median(occupied.sum(axis=1))) * width

    def _refined(
        self, correlations: NDArray[np.float64], delays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Returns the (pairs,) delays of the correlation peaks near given delays, s."""
        rate, length = FINE * self.facts.rate_hz, correlations.shape[1]
        around = np.arange(-2 * FINE, 2 * FINE + 1)
        refined = np.empty(len(delays))
        for k, (pair, delay) in enumerate(zip(correlations, delays, strict=True)):
            at = round(delay * rate) + around
            values = pair[at % length]
            m = min(max(int(values.argmax()), 1), len(values) - 2)
            refined[k] = (at[m] + parabola_vertex(*values[m - 1 : m + 2])) / rate
        return refined

    def _interpolated(
        self,
        pairs: list[tuple[int, int]],
        delays: NDArray[np.float64],
        lost: list[int],
    ) -> tuple[float, NDArray[np.float64] | None, int]:
        """Returns bearing (rad), position (m) and status of the range for given delays.

        ``delays`` has t_j - t_i in s for each pair (i, j) of working microphones. The
        position is relative to the middle microphone. It is None if a channel is silent
        (``lost``), or if the range is not credible.
        """
        others = [k for k in range(self.facts.channels) if k not in lost]
        base, *rest = others
        rows = np.zeros((len(pairs), len(rest)))
        for row, (i, j) in zip(rows, pairs, strict=True):
            if j != base:
                row[rest.index(j)] += 1.0
            if i != base:
                row[rest.index(i)] -= 1.0
        d = self.c * (np.linalg.pinv(rows) @ delays)
        p_RM = self.p_RM[rest] - self.p_RM[base]
        if lost:  # the middle microphone may be silent
            status = range_status(0.0, enough=False)
            return plane_wave_bearing(p_RM, d), None, status
        return near_or_far(p_RM, d)


#: Values of the input ``listening``: what the search wants the estimator to gather.
_NOTHING, _NOISE, _SOUND = range(3)


class _Memory(NamedTuple):
    """Values that the estimator keeps from one frame to the next one."""

    asked: int
    """Value of ``listening`` at the last frame."""
    before: NDArray[np.float64]
    """(channels, samples) last frame that was gathered."""
    noise: CrossPowers
    sound: CrossPowers
    outputs: NDArray[np.float64]
    """Values of the output ports in order."""


class CrossPowerEstimator(FrameBlock):
    """Estimates where the source is whenever the searching robot rests and listens.

    The search block sets the input ``listening``, which requests noise, sound or
    nothing. While it requests noise or sound, the block sums cross-power spectra of
    audio frames. The sums for noise and for sound are separate. When ``listening`` no
    longer requests sound, the estimate appears at the outputs. It stays there until
    sound is requested again. All outputs then become zero.

    The outputs have these meanings:

    - ``lost_microphone`` is the number of the first silent channel, counted from 1, or
      0 if no channel is silent. If nothing was heard, all other outputs are zero.
    - Bearing and range are seen from the middle microphone, which is the first
      microphone.
    - ``p_PS_B`` is the position of the source relative to the control point P. If the
      range is unknown, it is a unit vector, and ``range_status`` gives the reason
      (``systems.hearing.source_fix``).
    - ``ambiguous`` is 1 if another direction, ``alternative_bearing``, fits about
      equally well. It is also 1 if the bandwidth of the sound is so small that any
      direction fits.

    The block reads the input ``audio`` only while ``listening`` requests noise or
    sound.

    The state has the outputs, the last frame, and the sums of spectra. The block
    updates the state every ``frame_s`` of the microphones. The outputs change one
    control period later.

    Args:
        robot: Positions of the microphones.
        sound_speed_m_s: Speed of sound that the robot assumes, m/s.
        microphones: Sample rate and length of the frames.

    Raises:
        InputError: There are fewer than four microphones.

    Reference: Song 2011, 3.2, 4.3, eq. 9 to 17. The paper measures delays in whole
    samples. The bearing from a grid of positions is not in the paper.
    """

    part, stage = "hearing", "hearing"
    inputs = (
        Port("audio", OBJECT, "AudioFrame"),
        Port("listening", 1, "number, 0 nothing, 1 noise alone, 2 sound"),
    )
    outputs = (
        Port("source_bearing", 1, "rad"),
        Port("source_range", 1, "m"),
        Port("p_PS_B", 2, "m, m", ("p_PS_B_x", "p_PS_B_y")),
        Port("detected", 1, "0 or 1", "detected"),
        Port("range_valid", 1, "0 or 1", "range_valid"),
        Port("ambiguous", 1, "0 or 1", "ambiguous"),
        Port("alternative_bearing", 1, "rad"),
        Port("lost_microphone", 1, "number, 0 none", "lost_microphone"),
        Port("range_status", 1, "number, 0 nothing heard", "range_status"),
    )
    listener: type[ArrayListener] = ArrayListener
    """Class that estimates the directions."""

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(preset="song2011_hearing"),
        sound_speed_m_s: float = SOUND_SPEED_M_S,
        microphones: MicArrayParameters = MicArrayParameters(),
    ) -> None:
        super().__init__()
        self._listener = self.listener(robot, sound_speed_m_s, microphones)
        self.set_name("cross_power_estimator")
        facts = self._listener.facts
        self._none = no_powers(facts)
        frame = np.zeros((facts.channels, facts.samples))
        blank = _Memory(_NOTHING, frame, self._none, self._none, self._values())
        self.declare_frames(blank, blank, microphones)

    def hear(
        self,
        inputs: NDArray[np.float64],
        audio: Callable[[], AudioFrame],
        memory: _Memory,
    ) -> tuple[NDArray[np.float64], _Memory]:
        """Adds an audio frame to the sums, or estimates the source.

        See ``FrameBlock.hear``. The function calls ``audio`` only if it needs the
        frame.
        """
        after = self._gathered(round(float(inputs[0])), audio, memory)
        return after.outputs, after

    def _gathered(
        self, asked: int, audio: Callable[[], AudioFrame], memory: _Memory
    ) -> _Memory:
        """Returns the memory after a frame. ``asked`` is the value of ``listening``."""
        if asked == _NOTHING and memory.asked == _NOTHING:
            return memory
        noise, sound, outputs = memory.noise, memory.sound, memory.outputs
        if memory.asked == _SOUND and asked != _SOUND:
            outputs = self._estimate(sound, noise)
        if asked == _NOTHING:
            return memory._replace(asked=asked, outputs=outputs)
        frame = audio().counts.astype(np.float64)
        if asked != memory.asked:  # a spectrum needs two frames
            if asked == _NOISE:
                return _Memory(asked, frame, self._none, sound, outputs)
            return _Memory(asked, frame, noise, self._none, self._values())
        facts = self._listener.facts
        if asked == _NOISE:
            noise = gather_frame(facts, noise, memory.before, frame)
        else:
            sound = gather_frame(facts, sound, memory.before, frame)
        return _Memory(asked, frame, noise, sound, outputs)

    def _estimate(self, sound: CrossPowers, noise: CrossPowers) -> NDArray[np.float64]:
        listener = self._listener
        lost = listener.lost(sound) if sound.frames > 0.0 else []
        return self._values(listener.direction(sound, noise), lost)

    def _values(
        self, found: Direction | None = None, lost: Sequence[int] = ()
    ) -> NDArray[np.float64]:
        """Returns the values of the output ports in order."""
        first_lost = 1.0 + lost[0] if lost else 0.0
        if found is None:
            return np.array([0.0] * 8 + [first_lost, 0.0])
        distance, p_PS_B = 0.0, [math.cos(found.bearing), math.sin(found.bearing)]
        if found.place is not None:
            distance = float(np.linalg.norm(found.place))
            p_PS_B = (self._listener.p_PR_B + found.place).tolist()
        ranged, ambiguous = float(found.place is not None), float(found.ambiguous)
        directions = found.bearing, distance, *p_PS_B, 1.0, ranged, ambiguous
        return np.array((*directions, found.other, first_lost, found.range_status))
