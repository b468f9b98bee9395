"""The monitor of Drake's simulator: it saves sound, and ends the run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydrake.systems.framework import EventStatus

from diagrams.building.builder import SoundFollower
from diagrams.running.audio.run_audio import RunAudio
from diagrams.running.referee import Referee
from diagrams.running.stop_rules import READ_PORTS, ROUNDING_S

_GO_ON = EventStatus.DidNothing()


class Monitor:
    """Reads ports of a diagram at every tick, to judge the run and to save its sound.

    Drake's simulator calls the monitor before the blocks update their states in a tick
    (control period). The monitor therefore reads the same values as the updates, and
    Drake computes these values only once.

    Args:
        follower: The diagram with its robots and sources.
        audio: Open files for the sound of the run, or None to save no sound.
        progress: Function that is called at every tick with its time, s, or None.
    """

    def __init__(
        self,
        follower: SoundFollower,
        audio: RunAudio | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self._progress = progress
        self.referee = Referee(follower.scenario)
        self._diagram, self._tick_s = follower.diagram, follower.scenario.tick_s
        self._audio, self._tick = audio, -1
        self._ports: dict[tuple[str, str], tuple[Any, Any]] = {}
        for owner, parts in (*follower.sources.items(), *follower.robots.items()):
            for block in parts.blocks.values():
                for index in range(block.num_output_ports()):
                    port = block.get_output_port(index)
                    self._ports.setdefault((owner, port.get_name()), (block, port))
        self._root: Any = None
        self._contexts: dict[tuple[str, str], Any] = {}

    def __call__(self, context: Any) -> EventStatus:
        """Saves the sound of a tick and judges whether the run is over.

        A tick is a control period. The simulator calls this method after every
        integration step. Between ticks, the method does nothing.

        Args:
            context: Drake context of the diagram.

        Returns:
            A status that ends the simulation if the run is over.

        Raises:
            InputError: A robot that listens has no audio frames to save.
            OSError: The disk is full, or fails.
        """
        time, referee = context.get_time(), self.referee
        tick = round(time / self._tick_s)
        if tick == self._tick or abs(time - tick * self._tick_s) > ROUNDING_S:
            return _GO_ON
        self._tick = tick
        if context is not self._root:
            self._root, self._contexts = context, {}
        if self._progress is not None:
            self._progress(time)
        if self._audio is not None:
            self._audio.save(tick, self._read)
        for number, name in enumerate(referee.steps):
            referee.poses[number] = self._read(name, "pose_WB")
        for name, step in referee.steps.items():
            read = [self._numbers(name, *port) for port in READ_PORTS.items()]
            step.step(tick, step.state, (referee.poses, *read), (), step.numbers)
        if referee.over:
            cause = referee.cause_of(referee.decisive)
            return EventStatus.ReachedTermination(self._diagram, cause)
        return _GO_ON

    def _read(self, owner: str, name: str) -> Any:
        """Value of an output port; None if the robot or source has no such port."""
        key = owner, name
        if key not in self._ports:
            return None
        block, port = self._ports[key]
        if key not in self._contexts:
            self._contexts[key] = block.GetMyContextFromRoot(self._root)
        return port.Eval(self._contexts[key])

    def _numbers(self, owner: str, name: str, size: int) -> list[float]:
        values = self._read(owner, name)
        return [0.0] * size if values is None else values.tolist()
