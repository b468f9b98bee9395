"""The olfactory robot's search: wait, smell, decide, move, until it touches."""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.compass import wrapped_deg
from systems.radio.codec import FRAMES_SIZE
from systems.search.parameters import (
    PlumeSearchParameters,
)
from systems.search.search_ending import (
    FOUND,
    NO_NOSE,
    NO_TOUCH,
    REFUSED,
    STEPS_GONE,
    UNDECIDED,
)
from systems.search.search_state import (
    AT,
    add_frame,
    clear_frames,
    publish_search,
    search_ports,
    ticks_of,
)
from systems.search.song_rules import song2011_turn
from systems.search.upwind_gradient import RULE_MEMORY, upwind_gradient_turn

#: Ratios and airflows that a stop averages: R1, R2, R3, F1, F2.
_SENSED = 5
_WAIT, _SENSE, _MOVE, _OVER = range(4)


class _Places(NamedTuple):
    """Places in the state of what this search has of its own."""

    unsent: int
    """What is still to be sent of a step: 2 all, 1 the second half, 0 nothing."""
    readings: int
    """Readings in this stop."""
    smelt: int
    """Least gas ratio of the last two stops and since, by which a touch is judged."""
    before: int
    """Least mean gas ratio at the last stop."""
    sum: int
    """Sums of the five readings in this stop; then their least and greatest values
    and their means."""
    least: int
    most: int
    mean: int
    memory: int
    """What the rules remember."""
    frames: int
    size: int
    """Of the state."""


_OWN = _Places(
    *accumulate(
        (1, 1, 1, 1, *(_SENSED,) * 4, RULE_MEMORY, FRAMES_SIZE), initial=len(AT)
    )
)
# Numbers of frames (Song 2011, table 5).
_FN_SET, _FN_HEADING, _FN_GAS, _FN_AIRFLOW, _FN_RESULT = 2, 5, 6, 9, 12
# Bits of the faults.
_DEAD_GAS, _STUCK = 1, 8
#: Readings nearer to one another than this in a whole stop come from no live sensor.
_LIFELESS = 1e-9


class PlumeSearchNumbers(NamedTuple):
    """What the step of ``PlumeSearch`` depends on."""

    turn: Callable[..., tuple[float, int, int]]
    """``turn(gas, airflow, memory, rules)``, as ``song2011_turn``."""
    rules: Any
    wait: int
    """Ticks, as those that follow."""
    sense: int
    move: int
    repeat: int
    most_steps: int
    gate: bool
    gate_share: float
    address: int


@register_jitable
def _begin_stop(state: Any, numbers: PlumeSearchNumbers) -> None:
    state[AT.activity], state[AT.left] = _WAIT, numbers.wait
    state[AT.moves] = 0.0
    state[_OWN.readings] = 0.0
    for k in range(_SENSED):
        state[_OWN.sum + k] = 0.0


@register_jitable
def _sense(state: Any, gas: Any, airflow: Any) -> None:
    """Adds a tick's readings."""
    first = state[_OWN.readings] < 0.5
    for k in range(_SENSED):
        value = gas[k] if k < 3 else airflow[k - 3]
        state[_OWN.sum + k] += value
        state[_OWN.least + k] = value if first else min(state[_OWN.least + k], value)
        state[_OWN.most + k] = value if first else max(state[_OWN.most + k], value)
    state[_OWN.readings] += 1.0


@register_jitable
def _average(state: Any) -> int:
    """Means of a stop, without extremes; a dead gas sensor smells as the others do.

    Returns:
        How many gas sensors are alive.
    """
    count = state[_OWN.readings]
    for k in range(_SENSED):
        total = state[_OWN.sum + k]
        if count > 2.5:
            total -= state[_OWN.least + k] + state[_OWN.most + k]
            state[_OWN.mean + k] = total / (count - 2.0)
        else:
            state[_OWN.mean + k] = total / count
    alive, others, bits = 0, 0.0, 0.0
    for k in range(3):
        if state[_OWN.most + k] - state[_OWN.least + k] >= _LIFELESS or count < 1.5:
            alive += 1
            others += state[_OWN.mean + k]
        else:
            bits += _DEAD_GAS << k
    if 0 < alive < 3:
        for k in range(3):
            if (int(bits) >> k) & 1:
                state[_OWN.mean + k] = others / alive
    switches = int(state[AT.fault]) // _STUCK * _STUCK
    state[AT.fault] = switches + bits
    return alive


@register_jitable
def _end(state: Any, ended: int) -> None:
    state[AT.activity], state[AT.left] = _OVER, 0.0
    state[AT.moves] = 0.0
    state[AT.ended] = ended
    state[AT.flag] = 1.0 if ended == FOUND else 0.0


@register_jitable
def _decide(state: Any, heading: float, numbers: PlumeSearchNumbers) -> None:
    """Where to go after a stop."""
    if _average(state) < 2:
        _end(state, NO_NOSE)
        return
    if state[AT.steps] >= numbers.most_steps:
        _end(state, STEPS_GONE)
        return
    mean = state[_OWN.mean], state[_OWN.mean + 1], state[_OWN.mean + 2]
    blown = state[_OWN.mean + 3], state[_OWN.mean + 4]
    memory = state[_OWN.memory : _OWN.memory + RULE_MEMORY]
    turn, phase, ended = numbers.turn(mean, blown, memory, numbers.rules)
    state[AT.phase] = phase
    if ended != UNDECIDED:
        _end(state, ended)
        return
    state[AT.expected] = wrapped_deg(heading + turn)
    state[AT.steps] += 1.0
    state[AT.activity], state[AT.left] = _MOVE, numbers.move
    state[AT.moves] = 1.0
    state[_OWN.unsent] = 2.0
    here = min(mean[0], mean[1], mean[2])
    state[_OWN.smelt], state[_OWN.before] = min(here, state[_OWN.before]), here


@register_jitable
def _check_switches(state: Any, contact: Any) -> bool:
    """Whether something is touched; switches that are closed at the start are stuck."""
    if state[AT.started] < 0.5:
        state[AT.started] = 1.0
        for k in range(2):
            if contact[k] > 0.5:
                state[AT.fault] += _STUCK << k
        if contact[0] > 0.5 and contact[1] > 0.5:
            _end(state, NO_TOUCH)
            return False
    touched = False
    for k in range(2):
        stuck = (int(state[AT.fault]) // (_STUCK << k)) % 2 == 1
        touched = touched or (contact[k] > 0.5 and not stuck)
    return touched


@register_jitable
def _judge_touch(state: Any, numbers: PlumeSearchNumbers) -> None:
    """What is touched is the source, or smells of nothing."""
    found = not numbers.gate or state[_OWN.smelt] < numbers.gate_share
    _end(state, FOUND if found else REFUSED)


@register_jitable
def _add_frames(
    state: Any, tick: int, heading: float, numbers: PlumeSearchNumbers
) -> None:
    """Frames of this tick: what a step has measured, and in the end its result."""
    address = numbers.address
    clear_frames(state, _OWN.frames)
    if state[AT.activity] == _OVER:
        if tick % numbers.repeat == 0:
            add_frame(state, _OWN.frames, address, _FN_RESULT, state[AT.flag])
        return
    if state[_OWN.unsent] == 2.0:
        add_frame(state, _OWN.frames, address, _FN_HEADING, heading)
        add_frame(state, _OWN.frames, address, _FN_SET, state[AT.expected])
        add_frame(state, _OWN.frames, address, _FN_GAS, state[_OWN.mean])
        add_frame(state, _OWN.frames, address, _FN_GAS + 1, state[_OWN.mean + 1])
        state[_OWN.unsent] = 1.0
    elif state[_OWN.unsent] == 1.0:
        add_frame(state, _OWN.frames, address, _FN_GAS + 2, state[_OWN.mean + 2])
        add_frame(state, _OWN.frames, address, _FN_AIRFLOW, state[_OWN.mean + 3])
        add_frame(state, _OWN.frames, address, _FN_AIRFLOW + 1, state[_OWN.mean + 4])
        state[_OWN.unsent] = 0.0


@register_jitable
def plume_search_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: PlumeSearchNumbers
) -> None:
    """One tick of the search."""
    gas, airflow, headings, contact = inputs
    heading = headings[0]
    if state[AT.started] < 0.5:
        state[AT.expected] = heading
        state[_OWN.smelt] = state[_OWN.before] = 1.0
        _begin_stop(state, numbers)
    touched = _check_switches(state, contact)
    state[_OWN.smelt] = min(state[_OWN.smelt], gas[0], gas[1], gas[2])
    if state[AT.activity] != _OVER:
        if touched:
            _judge_touch(state, numbers)
        elif state[AT.activity] == _WAIT and state[AT.left] <= 0.0:
            state[AT.activity], state[AT.left] = _SENSE, numbers.sense
    if state[AT.activity] == _SENSE:
        _sense(state, gas, airflow)
    state[AT.left] -= 1.0
    if state[AT.left] <= 0.0:
        if state[AT.activity] == _SENSE:
            _decide(state, heading, numbers)
        elif state[AT.activity] == _MOVE:
            _begin_stop(state, numbers)
    _add_frames(state, tick, heading, numbers)


@register_jitable
def _publish(state: Any, outputs: Any, numbers: PlumeSearchNumbers) -> None:
    """The outputs of ``plume_search_step``'s state."""
    publish_search(state, outputs, _OWN.frames)


class PlumeSearch(Block):
    """Finds an odor source step by step: waits, smells, turns and moves.

    In each step the robot rests for ``wait_s`` until the gas sensors have settled,
    averages their readings for ``sense_s``, chooses a heading by its rules, and turns
    and drives for ``move_s``. A touch ends the search at once: where it smells, the
    source is found and the robot calls; elsewhere the touch is refused. The numbers of
    endings and faults are in ``systems.search.search_ending``. A gas sensor whose
    readings do not change during a whole stop counts as dead, and gets the mean of the
    others. A switch that is closed at the start counts as stuck, and is ignored; the
    block does not notice a switch that is stuck open. The phases of ``song2011`` are
    those of the paper; in ``upwind_gradient`` 1 is upwind, 2 across.

    Discrete state, every tick: the outputs, the measurements of the stop, and the
    memory of the rules. Latency: a tick.

    Args:
        parameters: ``PlumeSearchParameters``.
        tick_s: Period of the update, s.

    Reference: Song 2011, 2.3.3 and 4.2; the gate and ``upwind_gradient`` are ours.
    """

    part = "controller"
    inputs = (
        Port("gas_ratio", 3, "1, right front, rear and left front"),
        Port("airflow", 2, "1, left and right"),
        Port("heading_deg", 1, "deg, clockwise from north"),
        Port("contact", 2, "0 or 1, left and right"),
    )
    outputs = search_ports("calling", "0 or 1")

    def __init__(
        self,
        *,
        parameters: PlumeSearchParameters = PlumeSearchParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("plume_search")
        own, printed = parameters, parameters.rules == "song2011"
        numbers = PlumeSearchNumbers(
            song2011_turn if printed else upwind_gradient_turn,
            own.song2011 if printed else own.upwind_gradient,
            ticks_of(own.wait_s, tick_s, least=0),
            ticks_of(own.sense_s, tick_s),
            ticks_of(own.move_s, tick_s),
            ticks_of(own.call_every_s, tick_s),
            own.most_steps,
            own.gate,
            own.gate_share,
            own.address,
        )
        self.declare(
            Step(plume_search_step, numbers, [0.0] * _OWN.size, _publish),
            tick_s=tick_s,
            arrays=True,
        )
