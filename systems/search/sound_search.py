"""The search by sound: the robot waits for a call, listens and moves to the caller."""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.compass import wrapped_deg
from systems.radio.codec import FRAME_BYTES, FRAMES_SIZE, read_frame
from systems.radio.radio_channel import AIR_SIZE
from systems.radio.radio_range import radio_distance
from systems.search.parameters import CALLER, SoundSearchParameters
from systems.search.search_ending import (
    AMBIGUOUS,
    CALLER_LOST,
    DEAF,
    FOUND,
    NOT_CALLED,
    NOT_HEARD,
    STEPS_GONE,
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

#: Activities of the robot. ``search_phase`` in its report is the activity.
_WAITS, _HOLDS, _LISTENS, _COMPUTES, _MOVING, _OVER = range(1, 7)


class _Places(NamedTuple):
    """Indices in the state, for values that only this search has."""

    unsent: int
    """Whether the frames of the step are not sent yet, 0 or 1."""
    levels: int
    """Sum of the radio levels while the robot listens in this step, dBm."""
    readings: int
    """Number of radio levels in the sum."""
    misses: int
    """Number of consecutive steps in which the source was not located."""
    noise_left: int
    """Remaining ticks in which the robot listens to the noise."""
    waited: int
    """Number of ticks that the robot has waited for the call."""
    called: int
    """Report of the caller: 1 found, -1 found nothing, 0 none yet."""
    arrived: int
    """1 if the robot that goes first has reported a result, or if ``HOLD_S`` are over;
    otherwise 0.
    """
    bearing: int
    """Bearing of the source, CCW, deg."""
    distance: int
    """Range of the source, m. 0 if it is not known."""
    away: int
    """Distance from the caller, computed from the radio level, m."""
    frames: int
    size: int
    """Size of the state."""


_OWN = _Places(*accumulate((*(1,) * 11, FRAMES_SIZE), initial=len(AT)))
# Numbers of frames (Song 2011, table 5).
_FN_HEADING, _FN_FOUND_ODOR, _FN_DIRECTION = 5, 12, 13
_FN_DISTANCE, _FN_RADIO_DISTANCE, _FN_RESULT = 14, 15, 16
#: Bit of a lost microphone in the faults.
_LOST_MICROPHONE = 32
#: Values of the port ``listening``.
_NOTHING, _NOISE, _SOUND = 0.0, 1.0, 2.0
#: Computing time of a step, s (Song 2011, 4.3).
COMPUTE_S = 5.0
#: ``_HOLD_WITHIN_M``: distance from the caller within which the robot waits for the
#: robot that goes first, m. ``HOLD_S``: longest time for which it waits, s.
_HOLD_WITHIN_M, HOLD_S = 1.2, 200.0
#: Time without a call after which the robot gives up, s.
CALL_WITHIN_S = 1800.0
#: Distance from the caller below which the robot uses the range that it hears, m. The
#: robot computes the distance from the radio level.
_RADIO_GATE_M = 1.2
#: Number of consecutive steps without a unique direction of the sound after which the
#: robot gives up.
_TRIES = 3
#: ``_TURN_S_DEG``: approximate duration of a turn per degree, s/deg. ``_LAG_S``: lag of
#: the motors, s.
_TURN_S_DEG, _LAG_S = 1.0 / 90.0, 0.1
#: The last move ends at this multiple of ``stop_range_m`` from the caller.
_SHORT_OF = 0.93
#: Shortest duration of a move, s.
_SHORTEST_S = 0.5


class SoundSearchNumbers(NamedTuple):
    """Constants of the step of ``SoundSearch``. Durations are in ticks."""

    own: SoundSearchParameters
    noise: int
    listen: int
    compute: int
    move: int
    hold: int
    call_within: int
    repeat: int
    speed_m_s: float
    tick_s: float


@register_jitable
def _end(state: Any, ended: int) -> None:
    state[AT.activity], state[AT.left] = _OVER, 0.0
    state[AT.moves], state[AT.flag] = 0.0, _NOTHING
    state[AT.ended] = ended


@register_jitable
def _receive(state: Any, air: Any, own: Any) -> None:
    """Reads the reports of the caller and of the robot that goes first."""
    for first in range(1, 1 + int(air[0]), FRAME_BYTES):
        address, function, value = read_frame(air, first)
        if address == CALLER and function == _FN_FOUND_ODOR:
            state[_OWN.called] = 1.0 if value > 0.5 else -1.0
        if address == own.waits_for and function == _FN_RESULT:
            state[_OWN.arrived] = 1.0


@register_jitable
def _wait(state: Any, numbers: SoundSearchNumbers) -> None:
    """Listens to the noise, then waits for the call."""
    if state[_OWN.noise_left] > 0.0:
        state[AT.flag] = _NOISE
        state[_OWN.noise_left] -= 1.0
        return
    state[AT.flag] = _NOTHING
    state[_OWN.waited] += 1.0
    if not numbers.own.await_call or state[_OWN.called] > 0.5:
        _begin_step(state, numbers)
    elif state[_OWN.called] < -0.5:
        _end(state, CALLER_LOST)
    elif state[_OWN.waited] > numbers.call_within:
        _end(state, NOT_CALLED)


@register_jitable
def _begin_step(state: Any, numbers: SoundSearchNumbers) -> None:
    """Begins to listen, or to wait for the robot that goes first."""
    own = numbers.own
    state[AT.moves] = 0.0
    near = 0.0 < state[_OWN.away] < _HOLD_WITHIN_M
    if own.waits_for > 0 and state[_OWN.arrived] < 0.5 and near:
        state[AT.activity], state[AT.left] = _HOLDS, numbers.hold
        return
    state[AT.activity], state[AT.left] = _LISTENS, numbers.listen
    state[AT.flag] = _SOUND
    state[_OWN.levels] = state[_OWN.readings] = 0.0


@register_jitable
def _missed(state: Any, ended: int, numbers: SoundSearchNumbers) -> None:
    """Listens again, or ends the search after ``_TRIES`` misses."""
    state[_OWN.misses] += 1.0
    if state[_OWN.misses] >= _TRIES:
        _end(state, ended)
    else:
        _begin_step(state, numbers)


@register_jitable
def _decide(
    state: Any, heard: Any, heading: float, numbers: SoundSearchNumbers
) -> None:
    """Decides after the computing whether the robot moves, listens again or stops.

    The radio level gives the distance from the caller. The microphones give a bearing,
    and sometimes a range. The first of these rules that applies decides:

    1. If the distance is below its threshold, the robot has arrived.
    2. If the bearing is missing or not unique, the robot listens again. After too many
       such steps in a row, the search ends.
    3. If the distance is small and the range is below its threshold, the robot has
       arrived. This rule applies only if the field ``stop`` is ``range``.
    4. If the robot has made all permitted steps, the search ends.
    5. Otherwise, the robot moves. With ``stop: range``, a move near the caller may be
       shorter than ``MOVE_S``.
    """
    bearing, distance, detected, ranged, ambiguous, lost = heard
    own = numbers.own
    state[AT.fault] = float(_LOST_MICROPHONE) if lost > 0.5 else 0.0
    # Distance from the caller, computed from the mean radio level.
    level = state[_OWN.levels] / max(state[_OWN.readings], 1.0)
    away = radio_distance(level)
    state[_OWN.away] = away
    if away < own.radio_stop_m:
        _end(state, FOUND)
        return
    if detected < 0.5:
        _missed(state, DEAF if lost > 0.5 else NOT_HEARD, numbers)
        return
    if ambiguous > 0.5:
        _missed(state, AMBIGUOUS, numbers)
        return
    # The bearing is unique. Check whether the heard range ends the search.
    state[_OWN.misses] = 0.0
    state[_OWN.bearing] = math.degrees(bearing)
    state[_OWN.distance] = distance if ranged > 0.5 else 0.0
    near = own.stop == "range" and ranged > 0.5 and away < _RADIO_GATE_M
    if near and distance < own.stop_range_m:
        _end(state, FOUND)
        return
    if state[AT.steps] >= own.most_steps:
        _end(state, STEPS_GONE)
        return
    # Duration of the next move.
    move = numbers.move
    if own.stop == "range" and ranged < 0.5 and away < _RADIO_GATE_M:
        move = max(1, move // 2)  # near the caller, but without a range
    if near:
        way = distance - _SHORT_OF * own.stop_range_m
        time = way / numbers.speed_m_s + _LAG_S + _TURN_S_DEG * abs(state[_OWN.bearing])
        move = min(move, int(max(time, _SHORTEST_S) / numbers.tick_s))
    # Headings are clockwise, and bearings are counterclockwise.
    state[AT.expected] = wrapped_deg(heading - state[_OWN.bearing])
    state[AT.steps] += 1.0
    state[AT.activity], state[AT.left] = _MOVING, move
    state[AT.moves] = 1.0
    state[_OWN.unsent] = 1.0


@register_jitable
def _add_frames(
    state: Any, tick: int, heading: float, numbers: SoundSearchNumbers
) -> None:
    """Adds the frames of this tick: the data of the step, or the final result."""
    address = numbers.own.address
    state[_OWN.frames] = 0.0
    if state[AT.activity] == _OVER:
        if tick % numbers.repeat == 0:
            found = 1.0 if state[AT.ended] == FOUND else 0.0
            add_frame(state, _OWN.frames, address, _FN_RESULT, found)
    elif state[_OWN.unsent] > 0.5:
        add_frame(state, _OWN.frames, address, _FN_HEADING, heading)
        add_frame(state, _OWN.frames, address, _FN_DIRECTION, -state[_OWN.bearing])
        distance = min(state[_OWN.distance], 99.0)
        add_frame(state, _OWN.frames, address, _FN_DISTANCE, distance)
        away = min(state[_OWN.away], 99.0)
        add_frame(state, _OWN.frames, address, _FN_RADIO_DISTANCE, away)
        state[_OWN.unsent] = 0.0


@register_jitable
def _end_activity(
    state: Any, heard: Any, heading: float, numbers: SoundSearchNumbers
) -> None:
    """Starts the next activity."""
    activity = state[AT.activity]
    if activity == _LISTENS:
        state[AT.activity], state[AT.left] = _COMPUTES, numbers.compute
        state[AT.flag] = _NOTHING
    elif activity == _COMPUTES:
        _decide(state, heard, heading, numbers)
    elif activity == _MOVING:
        _begin_step(state, numbers)
    elif activity == _HOLDS:
        state[_OWN.arrived] = 1.0
        _begin_step(state, numbers)


@register_jitable
def sound_search_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: SoundSearchNumbers
) -> None:
    """Computes one tick (control period) of the search by sound.

    The robot first waits for the call. Then each step of the search has three
    activities: listen, compute and move. ``AT.left`` counts the remaining ticks of the
    present activity.
    """
    bearing, distance, detected, ranged, ambiguous, lost, levels, headings, air = inputs
    heard = bearing[0], distance[0], detected[0], ranged[0], ambiguous[0], lost[0]
    heading = headings[0]
    if state[AT.started] < 0.5:
        state[AT.started], state[AT.expected] = 1.0, heading
        state[AT.activity], state[_OWN.noise_left] = _WAITS, numbers.noise
    _receive(state, air, numbers.own)
    if state[AT.activity] == _WAITS:
        _wait(state, numbers)
    elif state[AT.activity] != _OVER:
        if state[AT.activity] == _LISTENS:
            state[_OWN.levels] += levels[0]
            state[_OWN.readings] += 1.0
        state[AT.left] -= 1.0
        held = state[AT.activity] == _HOLDS and state[_OWN.arrived] > 0.5
        if held or state[AT.left] <= 0.0:
            _end_activity(state, heard, heading, numbers)
    state[AT.phase] = state[AT.activity]
    _add_frames(state, tick, heading, numbers)


@register_jitable
def _publish(state: Any, outputs: Any, numbers: SoundSearchNumbers) -> None:
    """Copies the outputs from the state of ``sound_search_step``."""
    publish_search(state, outputs, _OWN.frames)


class SoundSearch(Block):
    """Searches for a calling robot in steps of listening, computing and moving.

    First, the robot listens to the noise for ``noise_s``. It then waits for the call: a
    radio frame from the robot with the address ``CALLER``, which has found the odor
    source. In each step, the robot listens for ``listen_s`` and computes for
    ``COMPUTE_S``. It then turns and drives for ``MOVE_S``, or for a shorter time near
    the caller.

    Two robots approach the same caller one after the other. The field ``waits_for`` of
    the second robot is the address of the first robot. Near the caller, the second
    robot waits until the first robot has reported its result, or until ``HOLD_S`` are
    over.

    If the sound fits several directions, the robot does not move, but listens again.
    After three such steps in a row, it gives up. ``systems.search.search_ending`` lists
    the numbers of the endings and faults.

    The phase in the report is the activity: 1 waiting for the call, 2 waiting for the
    first robot, 3 listening, 4 computing, 5 moving, 6 finished.

    The discrete state contains the outputs and the measurements of the step. The
    latency is one tick (control period).

    Args:
        parameters: Radio addresses, times of listening, and conditions that end the
            search.
        speed_m_s: Speed of the robot at full motor duty, m/s.
        tick_s: Control period, s.

    Reference: Song 2011, 3.2.3 and 4.3. The stop by range and ``waits_for`` are ours.
    """

    part = "controller"
    inputs = (
        Port("source_bearing", 1, "rad"),
        Port("source_range", 1, "m"),
        Port("detected", 1, "0 or 1"),
        Port("range_valid", 1, "0 or 1"),
        Port("ambiguous", 1, "0 or 1"),
        Port("lost_microphone", 1, "number, 0 none"),
        Port("rssi_dbm", 1, "dBm"),
        Port("heading_deg", 1, "deg, clockwise from north"),
        Port("air", AIR_SIZE, "number of bytes, and bytes, see systems.radio"),
    )
    outputs = search_ports("listening", "number, 0 nothing, 1 noise, 2 sound")

    def __init__(
        self,
        *,
        parameters: SoundSearchParameters = SoundSearchParameters(),
        speed_m_s: float = 0.14,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("sound_search")
        own = parameters
        numbers = SoundSearchNumbers(
            own,
            ticks_of(own.noise_s, tick_s, least=0),
            ticks_of(own.listen_s, tick_s),
            ticks_of(COMPUTE_S, tick_s),
            ticks_of(MOVE_S, tick_s),
            ticks_of(HOLD_S, tick_s),
            ticks_of(CALL_WITHIN_S, tick_s),
            ticks_of(REPORT_EVERY_S, tick_s),
            speed_m_s,
            tick_s,
        )
        self.declare(
            Step(sound_search_step, numbers, [0.0] * _OWN.size, _publish),
            tick_s=tick_s,
            arrays=True,
        )
