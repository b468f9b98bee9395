"""Estimates bearing and range of the source from the frames of the microphones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import OBJECT, Port
from systems.framework.signals import AudioFrame
from systems.hearing.frame_block import FrameBlock
from systems.hearing.localize import HearingMemory, Localizer
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_choice import Belief, ChoiceMemory, SourceChoice
from systems.hearing.source_fix import NOTHING_HEARD, REJECTED, SourceFix
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import MicArrayParameters, SoundParameters
from systems.sound.sound_emitter import MAXIMUM_RANGE_M


def robot_localizer(
    parameters: TDOAParameters,
    robot: RobotParameters,
    sound_speed_m_s: float,
    microphones: MicArrayParameters = MicArrayParameters(),
    *,
    limited: bool = True,
) -> tuple[Localizer, NDArray[np.float64]]:
    """Makes the sound localizer for the microphones of a robot.

    Args:
        parameters: Parameters of the estimator.
        robot: Positions of the microphones.
        sound_speed_m_s: Speed of sound that the robot assumes, m/s.
        microphones: Sample rate and length of the audio frames.
        limited: Whether to reject estimates that are not reliable.

    Returns:
        The localizer, and the (2,) centroid of the microphones relative to the control
        point P, in the axes of the body frame B, m.
    """
    shape = ArrayShape.of(robot.microphones_m)
    localizer = Localizer(
        parameters,
        shape,
        sound_speed_m_s,
        sample_rate_hz=microphones.sample_rate_hz,
        frame_samples=microphones.frame_samples,
        limited=limited,
    )
    return localizer, np.mean(robot.microphones_m, axis=0)


def robot_choice(
    localizer: Localizer,
    robot: RobotParameters,
    p_PA_B: NDArray[np.float64],
    frame_s: float,
) -> SourceChoice:
    """Makes the ``SourceChoice`` for the sounds that the localizer of a robot finds.

    Args:
        localizer: Localizer from ``robot_localizer``. Its parameters contain the first
            bearing of the source.
        robot: Parameters of the body. The function uses the distance of the control
            point P ahead of the axle.
        p_PA_B: (2,) centroid of the microphones relative to P, in the axes of the body
            frame B, m.
        frame_s: Period of the audio frames, s.

    Returns:
        The choice.
    """
    degrees = localizer.parameters.first_bearing_deg
    return SourceChoice(
        localizer.plan.shape,
        localizer.plan.c,
        p_PA_B + np.array([robot.control_point_m, 0.0]),
        frame_s,
        None if degrees is None else math.radians(degrees),
    )


def may_sound(
    sound: SoundParameters, time: float, longest_way: float, frame_s: float
) -> bool:
    """Returns whether the schedule of a source permits direct sound in an audio frame.

    Args:
        sound: Schedule of the source.
        time: End of the frame, s.
        longest_way: Longest travel time of sound to the microphones, s.
        frame_s: Length of the frame, s.

    Returns:
        True if the frame can contain direct sound. False if the frame can contain only
        noise and reverberation.
    """
    phase = time - sound.start_s
    # A frame that ends when a burst begins contains nothing of the burst.
    since_burst = phase % sound.period_s or sound.period_s
    open_for = sound.on_s + longest_way + frame_s
    return phase > 0.0 and since_burst < open_for


#: Additional input ports for ``choose: followed``.
_BELIEF = (
    Port("p_WS_estimated", 2, "m"),
    Port("covariance_W", 4, "m^2"),
    Port("age", 1, "s"),
    Port("pose_WB_estimated", 3, "m, m, rad"),
)


class _Memory(NamedTuple):
    """Values that the estimator keeps from one frame to the next one."""

    hearing: HearingMemory
    choice: ChoiceMemory | None
    """Memory for ``choose: followed``; otherwise None."""


class TDOAEstimator(FrameBlock):
    """Estimates where the sound source is from the audio frames of the microphones.

    The module ``systems.hearing.localize`` measures the delays of all pairs of
    channels. It finds the position that explains the delays, and the errors of this
    position.

    The outputs have these meanings:

    - Range and bearing are seen from the centroid of the microphones. For the default
      row, this is the middle microphone, which is at the control point P.
    - ``p_PS_B`` is the position of the source relative to P. A row of microphones
      cannot distinguish front from back, so the source is reported in the front half
      plane.
    - If there is an estimate without a range, the range is 0, and ``p_PS_B`` is the
      unit vector along the bearing. ``range_status`` gives the reason
      (``systems.hearing.source_fix``).
    - ``covariance`` is that of ``p_PS_B``, in row-major order. It includes noise and
      echoes, but no errors of microphone positions or of the speed of sound.
    - If there is no estimate, all outputs except ``range_status`` are zero.

    If ``choose: followed`` is set, the block locates each of the sounds of a frame. It
    chooses the sound whose delays fit the expected position of the source
    (``systems.hearing.source_choice``). The block then has four further input ports:
    p_WS_estimated [m], covariance_W [m^2], age [s] and pose_WB_estimated [m, m, rad].
    ``SourceTracker`` publishes the first three, and ``WheelOdometry`` publishes the
    pose. The four ports affect only the state, so there is no algebraic loop.

    The state has ``HearingMemory``, the outputs, and with ``choose: followed`` also
    ``ChoiceMemory``. The block updates the state every ``frame_s`` of the microphones
    (25 ms). It then processes the frame that ends at this moment. The outputs change
    one control period later, which models the computing time.

    Args:
        parameters: Method, band and rate of false alarms.
        robot: Positions of the microphones.
        sound_speed_m_s: Speed of sound that the robot assumes, m/s.
        sound: The sound of the source. Its schedule has an effect only if
            ``schedule_known`` is set.
        microphones: Sample rate and length of the frames.
        limited: Whether to reject estimates that are not reliable.

    Raises:
        InputError: The array cannot be used at this sample rate and band.

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
        sound_speed_m_s: float = SOUND_SPEED_M_S,
        sound: SoundParameters = SoundParameters(),
        microphones: MicArrayParameters = MicArrayParameters(),
        limited: bool = True,
    ) -> None:
        super().__init__()
        self._schedule = sound if parameters.schedule_known else None
        self._longest_way_s = MAXIMUM_RANGE_M / sound_speed_m_s
        self._localizer, self._p_PA_B = robot_localizer(
            parameters, robot, sound_speed_m_s, microphones, limited=limited
        )
        self.set_name("tdoa_estimator")
        self._choice = None
        blank = _Memory(self._localizer.blank(), None)
        example = _Memory(self._localizer.full(), None)
        if parameters.choose == "followed":
            self._choice = robot_choice(
                self._localizer, robot, self._p_PA_B, microphones.frame_s
            )
            self.inputs = (*self.inputs, *_BELIEF)
            blank = blank._replace(choice=self._choice.blank())
            example = example._replace(choice=self._choice.full())
        self.declare_frames(blank, example, microphones)

    def hear(
        self,
        inputs: NDArray[np.float64],
        audio: Callable[[], AudioFrame],
        memory: _Memory,
    ) -> tuple[NDArray[np.float64], _Memory]:
        """Locates the sound of one frame, see ``FrameBlock.hear``."""
        frame, before, chosen = audio(), memory.hearing, memory.choice
        sounds = self._schedule is None or may_sound(
            self._schedule,
            frame.time,
            self._longest_way_s,
            self._microphones.frame_s,
        )
        if self._choice is None or chosen is None:
            fix, after = self._localizer.localize(frame.counts, before)
        else:
            found, after = self._localizer.candidates(frame.counts, before)
            best, chosen = self._choice.choose(
                found, chosen, _belief(inputs), may_sound=sounds
            )
            fix = None if best is None else found[best].fix
        # A frame with a silent channel does not change the memory.
        heard = sounds and after.heard and after is not before
        values = port_values(fix if sounds else None, self._p_PA_B, heard=heard)
        return np.concatenate(values), _Memory(after, chosen)


def _belief(values: NDArray[np.float64]) -> Belief:
    """Converts the values of the ports ``_BELIEF`` to a ``Belief``."""
    return Belief(
        values[:2].copy(),
        values[2:6].reshape(2, 2).copy(),
        float(values[6]),
        values[7:].copy(),
    )


def port_values(
    fix: SourceFix | None, p_PA_B: NDArray[np.float64], *, heard: bool = False
) -> tuple[NDArray[np.float64], ...]:
    """Returns the values of the output ports of the estimator, in order.

    Args:
        fix: Estimate of the source, or None.
        p_PA_B: (2,) centroid of the microphones relative to the control point P, in the
            axes of the body frame B, m.
        heard: Whether the audio frame contains a sound although there is no estimate.

    Returns:
        Seven arrays, in this order:

        - bearing (1,), rad;
        - range (1,), m;
        - position (2,) of the source relative to P, in the axes of B, m, or a unit
          vector without a range;
        - covariance (4,) of this position, m^2;
        - flag ``detected`` (1,), 0 or 1;
        - flag ``range_valid`` (1,), 0 or 1;
        - status of the range (1,).
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
