"""Simulates the microphones of the robot, with their converter."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector

from systems.base.robot import RobotParameters, microphones_B
from systems.framework.block import OBJECT, Block, Port, RunFacts, Step
from systems.framework.cache import declare_cache
from systems.framework.faults import Fault
from systems.framework.finite import check_finite, check_record, read_arrays
from systems.framework.host_step import host_step
from systems.framework.signals import (
    SAMPLE_RATE_HZ,
    AudioFrame,
    Emission,
)
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.parameters import MicArrayParameters, RoomParameters
from systems.sound.real_array import (
    ChannelErrors,
    RealArray,
    no_errors,
    real_array,
)
from systems.sound.recorder import MicMemory, Recorder
from systems.sound.room import room_images
from systems.sound.sound_emitter import MAXIMUM_RANGE_M


def microphone_reach(room: RoomParameters | None, sound_speed_m_s: float) -> float:
    """Returns the longest distance that sound travels to the microphones, m.

    A loudspeaker must store the sound that it emits for the travel time of this
    distance. The result is ``MAXIMUM_RANGE_M`` in the free field (no room), and larger
    if reflections need it.
    """
    if room is None:
        return MAXIMUM_RANGE_M
    longest_s = room_images(room, sound_speed_m_s).length / SAMPLE_RATE_HZ
    return max(MAXIMUM_RANGE_M, longest_s * sound_speed_m_s)


class MicArray(Block):
    """Records the sound at the microphones of the robot.

    The block publishes one frame of audio every ``frame_s`` (by default 25 ms). A frame
    published at the time t covers the interval [t - frame_s, t). The module
    ``systems.sound.propagation`` describes how the sound travels.

    Within a frame, the robot moves along a cubic Hermite polynomial that starts at the
    pose at the end of the last frame. In two cases, the block has no pose from exactly
    one frame ago: before the first frame, and if the output is evaluated between the
    ends of two frames. The block then assumes that the robot has moved at its present
    velocity.

    In a room, the direct sound is the same as without a room. For the reflections, the
    block assumes that robot and source are at rest. It updates their positions only
    every ``UPDATE_PERIOD_S`` (0.1 s). In the frame that ends at an update, the
    reflections fade from those of the previous positions to those of the new positions.

    A Monte Carlo trial may set four numeric parameters of the block in the context
    before the first control period (tick). The index of each parameter is a constant of
    this class:

    - ``POSITION_ERRORS``: (2 n,) x and y of one microphone after the other, m;
    - ``CHANNEL_DELAYS``: (n,) delays, s;
    - ``GAINS``: (n,) factors, where 1 means no error;
    - ``SOUND_SPEED``: (1,) speed of sound in the air, m/s.

    The first three parameters are explained in ``systems.sound.real_array``. By
    default, the array has no errors.

    The state has the time, the pose and the velocity of the robot at the end of the
    last frame. In a room, the state also has three values from the last update of the
    reflections: the time, the pose of the robot, and the position of each source. The
    block updates the state every ``frame_s``. The output is a function of the state and
    the present inputs, without latency.

    Args:
        parameters: Microphones, amplifier and converter.
        robot: Positions of the microphones.
        sound_speed_m_s: Speed of sound, m/s.
        room: Walls; None for the free field.
        faults: Faults of the robot. The block uses only the faults of ``microphones``.
        others: Names of further sources that the robot does not follow. Each name adds
            an input port ``emission_<name>`` [Emission].
        seed: Seed of the noise.

    Raises:
        ValueError: The room is not possible, or the file of the ego noise cannot be
            used.
    """

    part, stage = "microphones", "hearing"
    inputs: Sequence[Port] = (
        Port("emission", OBJECT, "Emission"),
        Port("pose_WB", 3, "m, m, rad"),
        Port("velocity_WB", 3, "m/s, m/s, rad/s"),
    )
    outputs = (Port("audio", OBJECT, "AudioFrame"),)
    POSITION_ERRORS, CHANNEL_DELAYS, GAINS, SOUND_SPEED = range(4)

    def __init__(
        self,
        *,
        parameters: MicArrayParameters = MicArrayParameters(),
        robot: RobotParameters = RobotParameters(),
        sound_speed_m_s: float = SOUND_SPEED_M_S,
        room: RoomParameters | None = None,
        faults: Sequence[Fault] = (),
        others: Sequence[str] = (),
        seed: int = 0,
    ) -> None:
        super().__init__()
        self._parameters, self._robot = parameters, robot
        self.set_name("mic_array")
        self._recorder = Recorder(
            parameters,
            robot,
            sound_speed_m_s,
            room=room,
            sources=1 + len(others),
            seed=seed,
            faults=faults,
        )
        self._declare_errors(sound_speed_m_s)
        followed, *motion = self.inputs
        further = [followed._replace(name=f"emission_{name}") for name in others]
        self.inputs = (followed, *further, *motion)
        ports = self.declare_ports()
        *self._sources, pose, velocity = ports
        self._motion = [pose, velocity]
        group: Any
        for group in self._recorder.blank:
            if group is not None:
                self.DeclareDiscreteState(group)
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=parameters.frame_s, offset_sec=0.0, update=self._remember
        )
        sources = {port.ticket() for port in ports}
        sources |= {self.time_ticket(), self.xd_ticket(), self._array.ticket()}
        self.declare_output("audio", self._record, sources)

    def _declare_errors(self, c: float) -> None:
        none = no_errors(len(self._robot.microphones_m))
        # The order is that of the constants POSITION_ERRORS to SOUND_SPEED.
        groups: Any = (
            none.position_errors.ravel(),
            none.channel_delays,
            none.gains,
            np.array([c]),
        )
        for values in groups:
            self.DeclareNumericParameter(BasicVector(values))
        self._array = declare_cache(
            self,
            "array with its errors",
            self._build_array,
            {self.all_parameters_ticket()},
        )

    def _build_array(self, context: Any) -> RealArray:
        groups = [
            context.get_numeric_parameter(index).CopyToVector()
            for index in range(context.num_numeric_parameter_groups())
        ]
        names = "POSITION_ERRORS", "CHANNEL_DELAYS", "GAINS", "SOUND_SPEED"
        for name, values in zip(names, groups, strict=True):
            check_finite(f"MicArray: {name}", values)
        positions, delays, gains, (c,) = groups
        errors = ChannelErrors(positions.reshape(-1, 2), delays, gains)
        p_BM = microphones_B(self._robot)
        return real_array(p_BM, self._parameters, errors, float(c))

    def _memory(self, context: Any) -> MicMemory:
        groups = range(context.num_discrete_state_groups())
        return MicMemory(*(context.get_discrete_state(k).value() for k in groups))

    def _remember(self, context: Any, discrete_state: Any) -> None:
        now: Any = read_arrays(context, self._motion)
        old, time = self._memory(context), context.get_time()
        emissions: Sequence[Emission] = ()
        if old.places is not None and self._recorder.updates(time):
            emissions = self._emissions(context)
        new = self._recorder.remembered(emissions, time, now, old)
        for group, values in enumerate(new):
            if values is not None and values is not old[group]:
                discrete_state.set_value(group, values)

    def _emissions(self, context: Any) -> list[Emission]:
        emissions = []
        for port in self._sources:
            emission: Any = port.Eval(context)
            if not isinstance(emission, Emission):
                raise TypeError(
                    f"MicArray: port {port.get_name()} carries a "
                    f"{type(emission).__name__}; connect the emission of a SoundEmitter"
                )
            check_record(context, port, emission)
            emissions.append(emission)
        return emissions

    def _record(self, context: Any, output: Any) -> None:
        emissions, time = self._emissions(context), context.get_time()
        now: Any = read_arrays(context, self._motion)
        memory = self._memory(context)
        array: Any = self._array.Eval(context)
        frame = self._recorder.record(emissions, time, now, memory, array)
        output.set_value(frame)

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step of the block for a compiled simulation loop.

        The step stores the motion of the robot. It also provides a function that
        returns the audio frame that ends at a given tick (control period). This
        function computes a frame only when another block reads it.

        Args:
            run: Seed and period of the run, and emissions of the sources.

        Returns:
            The step.
        """
        recorder = self._recorder.of_seed(run.seed_of(self.get_name()))
        emitted = [run.carried[port.get_name()] for port in self._sources]
        memory = before = recorder.blank
        now = np.zeros(3), np.zeros(3)

        def remember(tick: int, inputs: Any, _: Any) -> None:
            nonlocal memory, before, now
            time, now = tick * run.tick_s, (inputs[:3].copy(), inputs[3:].copy())
            emissions: list[Emission] = []
            if memory.places is not None and recorder.updates(time):
                emissions = [emission(tick) for emission in emitted]
            before, memory = memory, recorder.remembered(emissions, time, now, memory)

        @lru_cache(maxsize=1)
        def audio(tick: int) -> AudioFrame:
            """Returns the frame that ends at a tick. Computes the frame only once."""
            emissions = [emission(tick) for emission in emitted]
            time = tick * run.tick_s
            return recorder.record(emissions, time, now, before, recorder.array)

        period = round(self._parameters.frame_s / run.tick_s)
        return host_step(remember, 6, 0, period)._replace(carries={"audio": audio})
