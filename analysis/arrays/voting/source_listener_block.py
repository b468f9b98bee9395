"""Provides a block that tracks every source that the microphones hear."""

from __future__ import annotations

from typing import Any, NamedTuple

from pydrake.common.value import Value

from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    TrackedSources,
    hear_sources,
)
from systems.base.robot import RobotParameters, microphones_B
from systems.framework.block import OBJECT, Block, Port
from systems.hearing.frame_block import check_rate, read_audio
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import MicArrayParameters


class _Heard(NamedTuple):
    memory: ListenerMemory
    sources: TrackedSources

    def __deepcopy__(self, memo: dict[int, Any]) -> _Heard:
        """Returns the object itself, because its contents never change."""
        return self


class SourceListener(Block):
    """Tracks every source that the microphones hear. Each track has an identity.

    Bearings are in the robot frame B, seen from the centroid of the microphones. If the
    microphones are in a row, all bearings are on the side of +x. The block calls
    ``hear_sources`` for each audio frame. The command ``phonotaxis listen`` calls the
    same function for each block of a stream. The frame that ends at t = 0 is ignored,
    because it was recorded before the start.

    State (abstract): ``ListenerMemory``, and the sources of the last step.
    Rate and latency: the state is updated every ``frame_s``. The sources are updated
    every ``step_s`` of the parameters, from the sound of the last ``window_s``.

    Args:
        parameters: How votes for directions become tracks.
        robot: Robot with the positions of the microphones.
        sound_speed_m_s: Speed of sound, m/s.
        microphones: Rate and length of the audio frames.
        band_hz: Lowest and highest frequency to use, Hz.

    Raises:
        InputError: The array cannot measure bearings.
    """

    part, stage = "listener", "hearing"
    inputs = (Port("audio", OBJECT, "AudioFrame"),)
    outputs = (Port("sources", OBJECT, "TrackedSources"),)

    def __init__(
        self,
        *,
        parameters: ListenerParameters = ListenerParameters(),
        robot: RobotParameters = RobotParameters(),
        sound_speed_m_s: float = SOUND_SPEED_M_S,
        microphones: MicArrayParameters = MicArrayParameters(),
        band_hz: tuple[float, float] = (200.0, 8_000.0),
    ) -> None:
        super().__init__()
        self._parameters = parameters
        self._plan = VotePlan.of(
            ArrayShape.of(microphones_B(robot)),
            sound_speed_m_s,
            microphones.sample_rate_hz,
            band_hz=band_hz,
        )
        self.set_name("source_listener")
        self.declare_ports()
        blank = _Heard(ListenerMemory.blank(self._plan), TrackedSources(0.0, ()))
        state = self.DeclareAbstractState(Value(blank))
        ticket = self.abstract_state_ticket(state)
        self.declare_output("sources", self._publish_sources, {ticket})
        self.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=microphones.frame_s, offset_sec=0.0, update=self._hear
        )

    def _hear(self, context: Any, state: Any) -> None:
        audio = read_audio(context, self.GetInputPort("audio"), "SourceListener")
        check_rate(audio, self._plan.sample_rate_hz, "SourceListener")
        if context.get_time() == 0.0:
            return  # recorded before the start
        before: _Heard = context.get_abstract_state(0).get_value()
        steps, memory = hear_sources(
            audio.counts, before.memory, self._plan, self._parameters
        )
        sources = steps[-1] if steps else before.sources
        state.get_mutable_abstract_state(0).set_value(_Heard(memory, sources))

    def _publish_sources(self, context: Any, output: Any) -> None:
        heard: _Heard = context.get_abstract_state(0).get_value()
        output.set_value(heard.sources)
