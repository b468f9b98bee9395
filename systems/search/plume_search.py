"""The olfactory robot's search: wait, smell, decide, move, until it touches."""

from __future__ import annotations

from collections.abc import Callable
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
    ACTIVITY,
    ENDED,
    EXPECTED,
    FAULT,
    FLAG,
    LEFT,
    MOVES,
    OWN,
    PHASE,
    STARTED,
    STEPS,
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
# Places in the state, after those of both searches.
_TOLD, _COUNT, _SMELT, _BEFORE, _SUM = range(OWN, OWN + 5)
_LEAST = _SUM + _SENSED
_MOST = _LEAST + _SENSED
_MEAN = _MOST + _SENSED
_MEMORY = _MEAN + _SENSED
_FRAMES = _MEMORY + RULE_MEMORY
_SIZE = _FRAMES + FRAMES_SIZE
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
    state[ACTIVITY], state[LEFT] = _WAIT, numbers.wait
    state[MOVES] = 0.0
    state[_COUNT] = 0.0
    for k in range(_SENSED):
        state[_SUM + k] = 0.0


@register_jitable
def _sense(state: Any, gas: Any, airflow: Any) -> None:
    """Adds a tick's readings."""
    first = state[_COUNT] < 0.5
    for k in range(_SENSED):
        value = gas[k] if k < 3 else airflow[k - 3]
        state[_SUM + k] += value
        state[_LEAST + k] = value if first else min(state[_LEAST + k], value)
        state[_MOST + k] = value if first else max(state[_MOST + k], value)
    state[_COUNT] += 1.0


@register_jitable
def _average(state: Any) -> int:
    """Means of a stop, without extremes; a dead gas sensor smells as the others do.

    Returns:
        How many gas sensors are alive.
    """
    count = state[_COUNT]
    for k in range(_SENSED):
        total = state[_SUM + k]
        if count > 2.5:
            total -= state[_LEAST + k] + state[_MOST + k]
            state[_MEAN + k] = total / (count - 2.0)
        else:
            state[_MEAN + k] = total / count
    alive, others, bits = 0, 0.0, 0.0
    for k in range(3):
        if state[_MOST + k] - state[_LEAST + k] >= _LIFELESS or count < 1.5:
            alive += 1
            others += state[_MEAN + k]
        else:
            bits += _DEAD_GAS << k
    if 0 < alive < 3:
        for k in range(3):
            if (int(bits) >> k) & 1:
                state[_MEAN + k] = others / alive
    switches = int(state[FAULT]) // _STUCK * _STUCK
    state[FAULT] = switches + bits
    return alive


@register_jitable
def _end(state: Any, ended: int) -> None:
    state[ACTIVITY], state[LEFT] = _OVER, 0.0
    state[MOVES] = 0.0
    state[ENDED] = ended
    state[FLAG] = 1.0 if ended == FOUND else 0.0


@register_jitable
def _decide(state: Any, heading: float, numbers: PlumeSearchNumbers) -> None:
    """Where to go after a stop."""
    if _average(state) < 2:
        _end(state, NO_NOSE)
        return
    if state[STEPS] >= numbers.most_steps:
        _end(state, STEPS_GONE)
        return
    mean = state[_MEAN], state[_MEAN + 1], state[_MEAN + 2]
    blown = state[_MEAN + 3], state[_MEAN + 4]
    memory = state[_MEMORY : _MEMORY + RULE_MEMORY]
    turn, phase, ended = numbers.turn(mean, blown, memory, numbers.rules)
    state[PHASE] = phase
    if ended != UNDECIDED:
        _end(state, ended)
        return
    state[EXPECTED] = wrapped_deg(heading + turn)
    state[STEPS] += 1.0
    state[ACTIVITY], state[LEFT] = _MOVE, numbers.move
    state[MOVES] = 1.0
    state[_TOLD] = 2.0
    here = min(mean[0], mean[1], mean[2])
    state[_SMELT], state[_BEFORE] = min(here, state[_BEFORE]), here


@register_jitable
def _check_switches(state: Any, contact: Any) -> bool:
    """Whether something is touched; switches that are closed at the start are stuck."""
    if state[STARTED] < 0.5:
        state[STARTED] = 1.0
        for k in range(2):
            if contact[k] > 0.5:
                state[FAULT] += _STUCK << k
        if contact[0] > 0.5 and contact[1] > 0.5:
            _end(state, NO_TOUCH)
            return False
    touched = False
    for k in range(2):
        stuck = (int(state[FAULT]) // (_STUCK << k)) % 2 == 1
        touched = touched or (contact[k] > 0.5 and not stuck)
    return touched


@register_jitable
def _judge_touch(state: Any, numbers: PlumeSearchNumbers) -> None:
    """What is touched is the source, or smells of nothing."""
    found = not numbers.gate or state[_SMELT] < numbers.gate_share
    _end(state, FOUND if found else REFUSED)


@register_jitable
def _tell(state: Any, tick: int, heading: float, numbers: PlumeSearchNumbers) -> None:
    """Frames of this tick: what a step has measured, and in the end its result."""
    address = numbers.address
    clear_frames(state, _FRAMES)
    if state[ACTIVITY] == _OVER:
        if tick % numbers.repeat == 0:
            add_frame(state, _FRAMES, address, _FN_RESULT, state[FLAG])
        return
    if state[_TOLD] == 2.0:
        add_frame(state, _FRAMES, address, _FN_HEADING, heading)
        add_frame(state, _FRAMES, address, _FN_SET, state[EXPECTED])
        add_frame(state, _FRAMES, address, _FN_GAS, state[_MEAN])
        add_frame(state, _FRAMES, address, _FN_GAS + 1, state[_MEAN + 1])
        state[_TOLD] = 1.0
    elif state[_TOLD] == 1.0:
        add_frame(state, _FRAMES, address, _FN_GAS + 2, state[_MEAN + 2])
        add_frame(state, _FRAMES, address, _FN_AIRFLOW, state[_MEAN + 3])
        add_frame(state, _FRAMES, address, _FN_AIRFLOW + 1, state[_MEAN + 4])
        state[_TOLD] = 0.0


@register_jitable
def plume_search_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: PlumeSearchNumbers
) -> None:
    """One tick of the search."""
    gas, airflow, headings, contact = inputs
    heading = headings[0]
    if state[STARTED] < 0.5:
        state[EXPECTED] = heading
        state[_SMELT] = state[_BEFORE] = 1.0
        _begin_stop(state, numbers)
    touched = _check_switches(state, contact)
    state[_SMELT] = min(state[_SMELT], gas[0], gas[1], gas[2])
    if state[ACTIVITY] != _OVER:
        if touched:
            _judge_touch(state, numbers)
        elif state[ACTIVITY] == _WAIT and state[LEFT] <= 0.0:
            state[ACTIVITY], state[LEFT] = _SENSE, numbers.sense
    if state[ACTIVITY] == _SENSE:
        _sense(state, gas, airflow)
    state[LEFT] -= 1.0
    if state[LEFT] <= 0.0:
        if state[ACTIVITY] == _SENSE:
            _decide(state, heading, numbers)
        elif state[ACTIVITY] == _MOVE:
            _begin_stop(state, numbers)
    _tell(state, tick, heading, numbers)


@register_jitable
def _publish(state: Any, outputs: Any, numbers: PlumeSearchNumbers) -> None:
    """The outputs of ``plume_search_step``'s state."""
    publish_search(state, outputs, _FRAMES)


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
            Step(plume_search_step, numbers, [0.0] * _SIZE, _publish),
            tick_s=tick_s,
            arrays=True,
        )
