"""Defines the base class of blocks that process frames of audio in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import DiscreteStateIndex

from systems.framework.block import Block, RunFacts, Step
from systems.framework.finite import check_record, read_arrays
from systems.framework.host_step import host_step
from systems.framework.input_error import InputError
from systems.framework.packing import Packing
from systems.framework.signals import AudioFrame
from systems.sound.parameters import MicArrayParameters


def read_audio(context: Any, port: Any, block: str) -> AudioFrame:
    """Reads the frame of audio on an input port.

    Args:
        context: Context of the block.
        port: Input port ``audio`` of the block.
        block: Name of the block, for messages.

    Returns:
        The frame.

    Raises:
        TypeError: The value on the port is not a frame of audio.
        InputError: A value of the frame is not finite.
    """
    audio = port.Eval(context)
    if not isinstance(audio, AudioFrame):
        raise TypeError(
            f"{block}: port audio carries a {type(audio).__name__}; connect the audio "
            "of a MicArray"
        )
    check_record(context, port, audio)
    return audio


def check_rate(audio: AudioFrame, rate_hz: float, block: str) -> None:
    """Raises an ``InputError`` if the sample rate of a frame is not ``rate_hz``, Hz.

    ``block`` is the name of the block for the message.
    """
    if audio.sample_rate_hz != rate_hz:
        raise InputError(
            block,
            f"audio has a rate of {audio.sample_rate_hz:g} Hz; record at {rate_hz:g} "
            "Hz",
        )


class FrameBlock(Block):
    """The base class of blocks that process frames of audio in Python.

    The first input port of a subclass is ``audio``. All other ports carry numbers. A
    subclass defines the method ``hear``.

    State: two groups of discrete state. They change one control period after the end of
    a frame. The first group has the values of the output ports. The second group has
    the memory of ``hear``, packed into a vector. (An abstract state would need an
    unrestricted update. After such an update, Drake computes all blocks again.)
    """

    def declare_frames(
        self, memory: Any, example: Any, microphones: MicArrayParameters
    ) -> None:
        """Declares the ports, the state and the update.

        Args:
            memory: Memory before the first audio frame, a named tuple.
            example: A memory with the types and shapes of all later ones, see
                ``Packing``.
            microphones: Sample rate and length of the frames.
        """
        self._microphones, self._blank = microphones, memory
        self._packing = Packing(example)
        self._audio, *self._numbers = self.declare_ports()
        sizes = [int(port.size) for port in self.outputs]
        self.DeclareDiscreteState(sum(sizes))
        self.DeclareDiscreteState(self._packing.pack(memory).tolist())
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=microphones.frame_s, offset_sec=0.0, update=self._listen
        )
        ends = np.cumsum(sizes).tolist()
        for port, size, end in zip(self.outputs, sizes, ends, strict=True):

            def calc(
                context: Any, output: Any, part: Any = slice(end - size, end)
            ) -> None:
                output.SetFromVector(context.get_discrete_state(0).value()[part])

            ticket = self.discrete_state_ticket(DiscreteStateIndex(0))
            self.declare_output(port.name, calc, {ticket})

    def hear(
        self, inputs: NDArray[np.float64], audio: Callable[[], AudioFrame], memory: Any
    ) -> tuple[NDArray[np.float64], Any]:
        """Processes one frame of audio.

        Args:
            inputs: Elements of the input ports after ``audio``, in order.
            audio: Function that returns the frame.
            memory: Memory after the previous frame.

        Returns:
            Values of the output ports in order, and the new memory.

        Raises:
            InputError: The frame does not fit this block.
        """
        raise NotImplementedError

    def _frame(self, audio: AudioFrame) -> AudioFrame:
        check_rate(audio, self._microphones.sample_rate_hz, type(self).__name__)
        return audio

    def _listen(self, context: Any, discrete_state: Any) -> None:
        def frame() -> AudioFrame:
            return self._frame(read_audio(context, self._audio, type(self).__name__))

        inputs = np.concatenate([np.empty(0), *read_arrays(context, self._numbers)])
        memory = self._packing.unpack(context.get_discrete_state(1).value())
        values, memory = self.hear(inputs, frame, memory)
        discrete_state.set_value(0, values)
        discrete_state.set_value(1, self._packing.pack(memory))

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step of the block for a compiled simulation loop.

        Args:
            run: Facts about the run, which provide the frames.

        Returns:
            The step, which calls ``hear`` at the end of each frame.

        Raises:
            InputError: No block with a step publishes audio.
        """
        if "audio" not in run.carried:
            raise InputError(
                "engine",
                "compiled loops take frames of sound from a MicArray only; run with "
                "engine drake",
            )
        audio, memory = run.carried["audio"], self._blank

        def listen(tick: int, inputs: Any, outputs: Any) -> None:
            nonlocal memory
            outputs[:], memory = self.hear(
                inputs, lambda: self._frame(audio(tick)), memory
            )

        inputs = sum(port.size() for port in self._numbers)
        outputs = sum(int(port.size) for port in self.outputs)
        period = round(self._microphones.frame_s / run.tick_s)
        return host_step(listen, inputs, outputs, period)
