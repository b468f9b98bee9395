"""Bearing and range of the source from the frames of the microphones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import OBJECT, Block, Port, RunFacts, Step
from systems.framework.finite import read_arrays
from systems.framework.host_step import host_step
from systems.framework.signals import AudioFrame
from systems.hearing.audio_port import (
    audio_of_run,
    check_rate,
    declare_state_outputs,
    read_audio,
)
from systems.hearing.localise import HearingMemory, Localiser
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_choice import Belief, ChoiceMemory, SourceChoice
from systems.hearing.source_fix import NOTHING_HEARD, REJECTED, SourceFix
from systems.sound.acoustics import AcousticParameters
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import MicArrayParameters, SoundParameters
from systems.sound.sound_emitter import MAXIMUM_RANGE_M


def robot_localiser(
    parameters: TDOAParameters,
    robot: RobotParameters,
    acoustics: AcousticParameters,
    microphones: MicArrayParameters = MicArrayParameters(),
) -> tuple[Localiser, NDArray[np.float64]]:
    """The localiser of the robot's own microphones.

    Args:
        parameters: Of the estimator.
        robot: Places of the microphones.
        acoustics: Speed of sound.
        microphones: Sample rate and length of the frames.

    Returns:
        The localiser, and (2,) the microphones' centroid from P in B axes, m.
    """
    shape = ArrayShape.of(robot.microphones_m)
    localiser = Localiser(
        parameters,
        shape,
        acoustics.c,
        sample_rate_hz=microphones.sample_rate_hz,
        frame_samples=microphones.frame_samples,
    )
    return localiser, np.mean(robot.microphones_m, axis=0)


def robot_choice(
    localiser: Localiser,
    robot: RobotParameters,
    p_PA_B: NDArray[np.float64],
    frame_s: float,
) -> SourceChoice:
    """What chooses among the sounds that a robot's localiser finds.

    Args:
        localiser: Of ``robot_localiser``.
        robot: Place of P.
        p_PA_B: (2,) the microphones' centroid from P in B axes, m.
        frame_s: Period of the frames, s.

    Returns:
        It, with the first bearing of the localiser's parameters.
    """
    degrees = localiser.parameters.first_bearing_deg
    return SourceChoice(
        localiser.plan.shape,
        localiser.plan.c,
        p_PA_B + np.array([robot.control_point_m, 0.0]),
        frame_s,
        None if degrees is None else math.radians(degrees),
    )


def may_sound(
    sound: SoundParameters, time: float, longest_way: float, frame_s: float
) -> bool:
    """Whether a frame can hold direct sound of a source, by its schedule.

    Args:
        sound: Its gate.
        time: End of the frame, s.
        longest_way: Longest that sound can take to the microphones, s.
        frame_s: Length of the frame, s.

    Returns:
        False where the frame can only hold noise and reverberation.
    """
    phase = time - sound.start_s
    # A frame that ends as a burst begins holds none of it.
    since_burst = phase % sound.period_s or sound.period_s
    open_for = sound.on_s + longest_way + frame_s
    return phase > 0.0 and since_burst < open_for


#: Input ports for ``choose: followed``.
_BELIEF = (
    Port("p_WS_estimated", 2, "m"),
    Port("covariance_W", 4, "m^2"),
    Port("age", 1, "s"),
    Port("pose_WB_estimated", 3, "m, m, rad"),
)
# Groups of the discrete state: the outputs one after the other, and memories.
_OUTPUTS, _MEMORY, _ECHOES, _CHOICE = range(4)


class TDOAEstimator(Block):
    """Hears where the source is.

    ``systems.hearing.localise`` computes where the sound of a frame comes from: delays
    of all pairs of channels, a place that explains them, and its errors. Range and
    bearing count from the microphones' centroid, for the default row M2 = P;
    p_PS_B from P. Microphones in a row cannot tell front from back: the source
    is reported in the front half plane. Where nothing is heard all outputs are
    zero. Where ``range_valid`` is 0 the range is 0, p_PS_B is the unit vector
    along the bearing and the covariance is that of this vector; ``range_status``
    says why (``systems.hearing.source_fix``). The covariance
    (row major, of p_PS_B) counts noise and echoes, not errors of the
    microphones' places or of the speed of sound.

    With ``choose: followed`` it hears each of the sounds of a frame and chooses the one
    that comes from where the source is expected (``systems.hearing.source_choice``). It
    then has four further input ports, which ``SourceTracker`` and ``WheelOdometry``
    publish: p_WS_estimated [m], covariance_W [m^2], age [s] and pose_WB_estimated [m,
    m, rad]. They act on the state alone: no algebraic loop.

    State: the outputs, ``HearingMemory``, and with ``choose: followed``
    ``ChoiceMemory``.
    Rate and latency: updated every ``frame_s`` of the microphones, 25 ms, from the
    frame that ends then, and visible after it: one tick, the time that a processor
    takes.

    Args:
        parameters: Method, band and thresholds.
        robot: Places of the microphones.
        acoustics: Speed of sound.
        sound: What is listened to; its gate is the schedule where that is known.
        microphones: Sample rate and length of the frames.

    Raises:
        InputError: The array cannot serve at this rate and band.

    Reference: Han 2019, 2.2-2.3; Kim 2017, eq. 3-8.
    """

    part, stage = "hearing", "hearing"
    inputs: Sequence[Port] = (Port("audio", OBJECT, "AudioFrame"),)
    outputs = (
        Port("source_bearing", 1, "rad"),
        Port("source_range", 1, "m"),
        Port("p_PS_B", 2, "m, m", ("p_PS_B_x", "p_PS_B_y")),
        Port("covariance", 4, "m^2"),
        Port("detected", 1, "0 or 1", "detected"),
        Port("range_valid", 1, "0 or 1", "range_valid"),
        Port("range_status", 1, "number, 0 nothing heard", "range_status"),
    )

    def __init__(
        self,
        *,
        parameters: TDOAParameters = TDOAParameters(),
        robot: RobotParameters = RobotParameters(),
        acoustics: AcousticParameters = AcousticParameters(),
        sound: SoundParameters = SoundParameters(),
        microphones: MicArrayParameters = MicArrayParameters(),
    ) -> None:
        super().__init__()
        self._microphones = microphones
        self._schedule = sound if parameters.schedule_known else None
        self._longest_way_s = MAXIMUM_RANGE_M / acoustics.c
        self._localiser, self._p_PA_B = robot_localiser(
            parameters, robot, acoustics, microphones
        )
        self.set_name("tdoa_estimator")
        self._choice = None
        if parameters.choose == "followed":
            self._choice = robot_choice(
                self._localiser, robot, self._p_PA_B, microphones.frame_s
            )
            self.inputs = (*self.inputs, *_BELIEF)
        self._audio, *self._belief = self.declare_ports()
        self._output_size = sum(int(port.size) for port in self.outputs)
        self.DeclareDiscreteState(self._output_size)
        self.DeclareDiscreteState(4)
        self.DeclareDiscreteState(math.prod(self._localiser.echo_shape))
        if self._choice is not None:
            self.DeclareDiscreteState(self._choice.blank().pack().tolist())
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=microphones.frame_s, offset_sec=0.0, update=self._listen
        )
        declare_state_outputs(self)

    def _listen(self, context: Any, discrete_state: Any) -> None:
        audio = read_audio(context, self._audio, "TDOAEstimator")
        before = self._remembered(context)
        choice = None
        if self._choice is not None:
            state = context.get_discrete_state(_CHOICE).value()
            belief = _belief(np.concatenate(read_arrays(context, self._belief)))
            choice = ChoiceMemory.unpack(state), belief
        values, after, chosen = self.hear(audio, before, choice)
        flags = after.echoes is not None, after.heard
        discrete_state.set_value(_MEMORY, np.array((*after[:2], *flags)))
        if after.echoes is not None and after.echoes is not before.echoes:
            discrete_state.set_value(_ECHOES, after.echoes.ravel())
        if chosen is not None:
            discrete_state.set_value(_CHOICE, chosen.pack())
        discrete_state.set_value(_OUTPUTS, values)

    def hear(
        self,
        audio: AudioFrame,
        memory: HearingMemory,
        choice: tuple[ChoiceMemory, Belief] | None = None,
    ) -> tuple[NDArray[np.float64], HearingMemory, ChoiceMemory | None]:
        """Where the sound of a frame comes from.

        Args:
            audio: The frame.
            memory: What the last frame left.
            choice: What it left for ``choose: followed``, and what is believed now.

        Returns:
            Values of the output ports, one after the other, and the new memories.

        Raises:
            InputError: The frame has another rate, or is none of this array.
        """
        check_rate(audio, self._microphones.sample_rate_hz, "TDOAEstimator")
        sounds = self._schedule is None or may_sound(
            self._schedule,
            audio.time,
            self._longest_way_s,
            self._microphones.frame_s,
        )
        if self._choice is None or choice is None:
            fix, after = self._localiser.localise(audio.counts, memory)
            chosen = None
        else:
            found, after = self._localiser.candidates(audio.counts, memory)
            best, chosen = self._choice.choose(found, *choice, may_sound=sounds)
            fix = None if best is None else found[best].fix
        # A frame with a silent channel leaves the memory as it is.
        heard = sounds and after.heard and after is not memory
        values = port_values(fix if sounds else None, self._p_PA_B, heard=heard)
        return np.concatenate(values), after, chosen

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each frame of a compiled loop.

        Args:
            run: Has the frames.

        Returns:
            The step, which calls Python.

        Raises:
            InputError: No block with a step publishes audio.
        """
        audio = audio_of_run(run)
        memory = self._localiser.blank()
        chosen = None if self._choice is None else self._choice.blank()

        def listen(tick: int, inputs: Any, outputs: Any) -> None:
            nonlocal memory, chosen
            choice = None if chosen is None else (chosen, _belief(inputs))
            outputs[:], memory, chosen = self.hear(audio(tick), memory, choice)

        inputs = sum(port.size() for port in self._belief)
        period = round(self._microphones.frame_s / run.tick_s)
        return host_step(listen, inputs, self._output_size, period)

    def _remembered(self, context: Any) -> HearingMemory:
        """The memory that the last frame left."""
        numbers = context.get_discrete_state(_MEMORY).value().tolist()
        energy, noise_energy, echoing, heard = numbers
        echoes = None
        if echoing:
            held = context.get_discrete_state(_ECHOES).value()
            echoes = held.astype(np.float32).reshape(self._localiser.echo_shape)
        return HearingMemory(energy, noise_energy, echoes, bool(heard))


def _belief(values: NDArray[np.float64]) -> Belief:
    """From the values of the ports ``_BELIEF``, one after the other."""
    return Belief(
        values[:2].copy(),
        values[2:6].reshape(2, 2).copy(),
        float(values[6]),
        values[7:].copy(),
    )


def port_values(
    fix: SourceFix | None, p_PA_B: NDArray[np.float64], *, heard: bool = False
) -> tuple[NDArray[np.float64], ...]:
    """Values of the output ports, in order.

    Args:
        fix: Estimate of the source, if there is one.
        p_PA_B: (2,) the microphones' centroid from P in B axes, m.
        heard: Whether the frame has a sound, if there is no estimate.

    Returns:
        Bearing (1,), rad, range (1,), m, p_PS_B (2,), m, or a unit vector where the
        range is not known, its covariance (4,), m^2, (1,) flags 0 or 1: heard, and
        range known, and (1,) the status of the range.
    """
    if fix is None:
        sizes = (port.elements({}) for port in TDOAEstimator.outputs)
        *silence, _ = map(np.zeros, sizes)
        return (*silence, np.array([float(REJECTED if heard else NOTHING_HEARD)]))
    return (
        np.array([fix.bearing]),
        np.array([fix.range]),
        fix.p_AS + p_PA_B if fix.range_valid else fix.p_AS,
        fix.covariance.ravel(),
        np.ones(1),
        np.array([float(fix.range_valid)]),
        np.array([float(fix.range_status)]),
    )
