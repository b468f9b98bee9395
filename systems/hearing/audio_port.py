"""Ports of the estimators, in Drake and in compiled loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from systems.framework.block import RunFacts
from systems.framework.finite import check_record
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame


def read_audio(context: Any, port: Any, block: str) -> AudioFrame:
    """Returns the frame on a port.

    Args:
        context: Context of the block.
        port: Input port ``audio`` of the block.
        block: Name of the block, for messages.

    Returns:
        The frame.

    Raises:
        TypeError: The port carries something else.
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


def audio_of_run(run: RunFacts) -> Callable[[int], AudioFrame]:
    """Returns the function that computes the frames in a compiled loop.

    Args:
        run: The run.

    Returns:
        A function of the present tick, which computes the frame that ends at this tick.

    Raises:
        InputError: No block with a step publishes audio.
    """
    if "audio" not in run.carried:
        raise InputError(
            "engine",
            "compiled loops take frames of sound from a MicArray only; run with "
            "engine drake",
        )
    return run.carried["audio"]


def check_rate(audio: AudioFrame, rate_hz: float, block: str) -> None:
    """Raises an error if a frame has another sample rate.

    Args:
        audio: The frame.
        rate_hz: Sample rate that the block expects, Hz.
        block: Name of the block, for messages.

    Raises:
        InputError: The rates differ.
    """
    if audio.sample_rate_hz != rate_hz:
        raise InputError(
            block,
            f"audio has a rate of {audio.sample_rate_hz:g} Hz; record at {rate_hz:g} "
            "Hz",
        )


def declare_state_outputs(block: Any) -> None:
    """Declares the output ports of a block whose first state group contains them.

    Args:
        block: The block, which has declared its input ports. The state group contains
            the values of the output ports in order.
    """
    first = 0
    for port in block.outputs:

        def calc(
            context: Any, output: Any, part: Any = slice(first, first + port.size)
        ) -> None:
            output.SetFromVector(context.get_discrete_state(0).value()[part])

        block.declare_output(port.name, calc, {block.xd_ticket()})
        first += port.size
