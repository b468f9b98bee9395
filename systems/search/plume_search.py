"""The search by smell: the robot waits, senses and moves until it touches an object."""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.compass import wrapped_deg
from systems.radio.codec import FRAMES_SIZE
from systems.search.parameters import PlumeSearchParameters
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
    MOVE_S,
    REPORT_EVERY_S,
    add_frame,
    publish_search,
    search_ports,
    ticks_of,
)
from systems.search.song_rules import song2011_turn
from systems.search.upwind_gradient import RULE_MEMORY, upwind_gradient_turn

#: Averaging time of the readings, s (Song 2011, 4.2). The mean excludes the largest and
#: the smallest reading.
SENSE_S = 2.0
#: A touched object smells if the lowest gas ratio is below this value. The ratio of
#: clean air is 1. The lowest ratio is the minimum over the mean ratios of the last two
#: stops and over all readings since the last stop.
_GATE_SHARE = 0.95
#: Number of readings that a stop averages: R1, R2, R3, F1, F2.
_SENSED = 5
_WAIT, _SENSE, _MOVE, _OVER = range(4)


class _Places(NamedTuple):
    """Indices in the state, for values that only this search has."""

    unsent: int
    """Frames of the step not sent yet: 2 all, 1 the second half, 0 none."""
    readings: int
    """Number of readings in this stop."""
    smelt: int
    """Lowest gas ratio: the minimum of the mean ratios of the last two stops and of all
    readings since the last stop.
    """
    before: int
    """Lowest mean gas ratio at the last stop."""
    sum: int
    """Sums of the five readings in this stop. The next three fields are the first
    indices of the smallest, the largest and the mean readings.
    """
    least: int
    most: int
    mean: int
    memory: int
    """Memory of the rules."""
    frames: int
    size: int
    """Size of the state."""


_OWN = _Places(
    *accumulate(
        (1, 1, 1, 1, *(_SENSED,) * 4, RULE_MEMORY, FRAMES_SIZE), initial=len(AT)
    )
)
# Numbers of frames (Song 2011, table 5).
_FN_SET, _FN_HEADING, _FN_GAS, _FN_AIRFLOW, _FN_RESULT = 2, 5, 6, 9, 12
# Bits of the first dead gas sensor and of the first stuck switch in the faults.
_DEAD_GAS, _STUCK = 1, 8
#: A sensor is dead if its readings differ by less than this during a whole stop.
_LIFELESS = 1e-9


class PlumeSearchNumbers(NamedTuple):
    """Constants of the step of ``PlumeSearch``."""

    turn: Callable[..., tuple[float, int, int]]
    """``turn(gas, airflow, memory)``, for example ``song2011_turn``."""
    wait: int
    """Duration, ticks. The next three fields are also in ticks."""
    sense: int
    move: int
    repeat: int
    most_steps: int
    gate: bool
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
    """Updates the sums and the extremes with the readings of a tick."""
    first = state[_OWN.readings] < 0.5
    for k in range(_SENSED):
        value = gas[k] if k < 3 else airflow[k - 3]
        state[_OWN.sum + k] += value
        state[_OWN.least + k] = value if first else min(state[_OWN.least + k], value)
        state[_OWN.most + k] = value if first else max(state[_OWN.most + k], value)
    state[_OWN.readings] += 1.0


@register_jitable
def _average(state: Any) -> int:
    """Computes the mean readings of a stop, and detects dead gas sensors.

    Each mean excludes the largest and the smallest reading. The mean of the other gas
    sensors replaces that of a dead gas sensor.

    Returns:
        Number of gas sensors that work.
    """
    count = state[_OWN.readings]
    for k in range(_SENSED):
        total = state[_OWN.sum + k]
        if count > 2.5:
            total -= state[_OWN.least + k] + state[_OWN.most + k]
            state[_OWN.mean + k] = total / (count - 2.0)
        else:
            state[_OWN.mean + k] = total / count
    # A sensor that works has noise. A dead sensor repeats the same reading.
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
    # Replaces the bits of the gas sensors, and keeps the bits of the switches.
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
    """Chooses the next heading after a stop, or ends the search."""
    if _average(state) < 2:
        _end(state, NO_NOSE)
        return
    if state[AT.steps] >= numbers.most_steps:
        _end(state, STEPS_GONE)
        return
    mean = state[_OWN.mean], state[_OWN.mean + 1], state[_OWN.mean + 2]
    blown = state[_OWN.mean + 3], state[_OWN.mean + 4]
    memory = state[_OWN.memory : _OWN.memory + RULE_MEMORY]
    turn, phase, ended = numbers.turn(mean, blown, memory)
    state[AT.phase] = phase
    if ended != UNDECIDED:
        _end(state, ended)
        return
    state[AT.expected] = wrapped_deg(heading + turn)
    state[AT.steps] += 1.0
    state[AT.activity], state[AT.left] = _MOVE, numbers.move
    state[AT.moves] = 1.0
    state[_OWN.unsent] = 2.0
    # Lowest ratio of this stop and of the stop before it.
    here = min(mean[0], mean[1], mean[2])
    state[_OWN.smelt], state[_OWN.before] = min(here, state[_OWN.before]), here


@register_jitable
def _check_switches(state: Any, contact: Any) -> bool:
    """Returns whether the robot touches an object, according to its contact switches.

    A switch that is closed at the first tick (control period) is stuck, and does not
    count. If both switches are stuck, the search ends.
    """
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
    """Ends the search: the touched object is the source, or does not smell."""
    found = not numbers.gate or state[_OWN.smelt] < _GATE_SHARE
    _end(state, FOUND if found else REFUSED)


@register_jitable
def _add_frames(
    state: Any, tick: int, heading: float, numbers: PlumeSearchNumbers
) -> None:
    """Adds the frames of this tick: the readings of the step, or the final result."""
    address = numbers.address
    state[_OWN.frames] = 0.0
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
    """Computes one tick (control period) of the search by smell.

    Each step of the search has three activities: wait, sense and move. ``AT.left``
    counts the remaining ticks of the present activity. If the robot touches an object
    during any activity, the search ends.
    """
    gas, airflow, headings, contact = inputs
    heading = headings[0]
    if state[AT.started] < 0.5:
        state[AT.expected] = heading
        state[_OWN.smelt] = state[_OWN.before] = 1.0
        _begin_stop(state, numbers)
    # Detects a touch, and judges it by the lowest gas ratio.
    touched = _check_switches(state, contact)
    state[_OWN.smelt] = min(state[_OWN.smelt], gas[0], gas[1], gas[2])
    if state[AT.activity] != _OVER:
        if touched:
            _judge_touch(state, numbers)
        elif state[AT.activity] == _WAIT and state[AT.left] <= 0.0:
            state[AT.activity], state[AT.left] = _SENSE, numbers.sense
    if state[AT.activity] == _SENSE:
        _sense(state, gas, airflow)
    # Starts the next activity at the end of the present one.
    state[AT.left] -= 1.0
    if state[AT.left] <= 0.0:
        if state[AT.activity] == _SENSE:
            _decide(state, heading, numbers)
        elif state[AT.activity] == _MOVE:
            _begin_stop(state, numbers)
    _add_frames(state, tick, heading, numbers)


@register_jitable
def _publish(state: Any, outputs: Any, numbers: PlumeSearchNumbers) -> None:
    """Copies the outputs from the state of ``plume_search_step``."""
    publish_search(state, outputs, _OWN.frames)


class PlumeSearch(Block):
    """Searches for an odor source with a robot that stops, smells and moves in steps.

    In each step, the robot first rests for ``wait_s``, until the gas sensors have
    settled. It then averages its readings for ``SENSE_S``, and the selected rules
    choose a heading from the averages. Finally, it turns and drives for ``MOVE_S``.

    When the robot touches an object, the search ends. If the object smells, it counts
    as the odor source, and the robot calls other robots by sound. Otherwise the robot
    gives up. ``systems.search.search_ending`` lists the numbers of the endings and
    faults.

    A gas sensor is dead if its readings do not change during a whole stop. The block
    then uses the mean of the other gas sensors instead. A contact switch that is closed
    at the start is stuck, and the block ignores it. The block does not detect a switch
    that never closes.

    The rules ``song2011`` have the four phases of the paper. The rules
    ``upwind_gradient`` have two phases: 1 upwind and 2 across the wind.

    The discrete state contains the outputs, the measurements of the stop, and the
    memory of the rules. The latency is one tick (control period).

    Args:
        parameters: Rules, and conditions that end the search.
        tick_s: Control period, s.

    Reference: Song 2011, 2.3.3 and 4.2. The rules ``upwind_gradient`` and the test
    whether the object smells are ours.
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
            ticks_of(own.wait_s, tick_s, least=0),
            ticks_of(SENSE_S, tick_s),
            ticks_of(MOVE_S, tick_s),
            ticks_of(REPORT_EVERY_S, tick_s),
            own.most_steps,
            own.gate,
            own.address,
        )
        self.declare(
            Step(plume_search_step, numbers, [0.0] * _OWN.size, _publish),
            tick_s=tick_s,
            arrays=True,
        )
