"""From a wanted heading to the motors' duties: PID and pulse widths."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.compass import wrapped_deg
from systems.heading.parameters import HeadingControlParameters

#: How an error becomes duties: mended, as printed, and with the missing ``else`` alone.
PULSE_WIDTHS = ("mended", "printed", "else_only")
_MENDED, _PRINTED, _ELSE_ONLY = range(len(PULSE_WIDTHS))


@register_jitable
def _limited(value: float, largest: float) -> float:
    return min(max(value, -largest), largest)


@register_jitable
def heading_error(
    deviation: float, change: float, integral: float, tick_s: float, own: Any
) -> tuple[float, float]:
    """Output of the PID (Song 2011, table 1).

    Args:
        deviation: gamma, expected less present heading, (-180, 180] deg.
        change: Of it since the last tick, wrapped, deg.
        integral: I of the last tick, deg.
        tick_s: s.
        own: ``HeadingControlParameters``.

    Returns:
        epsilon, deg, and I.
    """
    if abs(deviation) < own.integral_within_deg:
        integral += own.integral * deviation * tick_s
        integral = _limited(integral, own.largest_integral_deg)
    else:
        integral = 0.0
    rate = own.differential * change / tick_s
    rate = _limited(rate, own.largest_differential_deg)
    total = own.proportional * deviation + integral + rate
    return _limited(total, own.largest_error_deg), integral


@register_jitable
def motor_duties(error: float, limit: float, kind: int) -> tuple[float, float]:
    """Duties of the motors (Song 2011, table 2).

    Mended it is v = max(0, 1 - |e|/L), w = 0.01 e, left and right v + w and v - w.

    Args:
        error: epsilon, clockwise, deg.
        limit: L, deg.
        kind: Place in ``PULSE_WIDTHS``.

    Returns:
        Left and right; beyond -1 to 1 as printed.
    """
    if kind == _MENDED:
        ahead, turn = max(0.0, 1.0 - abs(error) / limit), 0.01 * error
        return ahead + turn, ahead - turn
    left, right = 0.01 * error, -0.01 * error
    if kind == _ELSE_ONLY and abs(error) > limit:
        return left, right
    if error >= 0.0:
        left = (0.01 - 1.0) / limit * error + 1.0
        right = -(0.01 + 1.0 / limit) * error + 1.0
    else:
        left = (0.01 + 1.0) / limit * error + 1.0
        right = (-0.01 + 1.0 / limit) * error + 1.0
    return left, right


class HeadingNumbers(NamedTuple):
    """What the step of ``HeadingController`` depends on."""

    own: HeadingControlParameters
    kind: int
    tick_s: float


@register_jitable
def heading_controller_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: HeadingNumbers
) -> None:
    """The duties of the motors.

    State: integral, deg; deviation at the last tick, deg; whether the robot moved.
    """
    expected, heading, move = inputs
    duty = outputs[0]
    if move[0] < 0.5:
        state[0], state[2] = 0.0, 0.0
        duty[0], duty[1] = 0.0, 0.0
        return
    deviation = wrapped_deg(expected[0] - heading[0])
    change = wrapped_deg(deviation - state[1]) if state[2] > 0.5 else 0.0
    own = numbers.own
    error, state[0] = heading_error(deviation, change, state[0], numbers.tick_s, own)
    state[1], state[2] = deviation, 1.0
    left, right = motor_duties(error, own.turning_beyond_deg, numbers.kind)
    duty[0], duty[1] = _limited(left, 1.0), _limited(right, 1.0)


class HeadingController(Block):
    """Turns the robot to a heading, and drives it on as it comes near to it.

    The block has a PID controller of the deviation, and maps its output to the duties
    of the motors; while ``move`` is 0 the duties are 0. The change of the deviation is
    wrapped. At the first tick of a move it is 0, so that the differential part has no
    kick, and the integral starts again at 0.

    Discrete state, every tick: integral, last deviation, and whether the robot moved.
    Latency: none. The paper's period is 10 ms; our tick of 25 ms costs a degree of
    margin (``analysis.linear.heading_loop``).

    Args:
        parameters: ``HeadingControlParameters``.
        tick_s: Period of the control, s.

    Reference: Song 2011, 2.3.2, tables 1 to 3, with the errata of docs/errata.md.
    """

    part = "heading"
    inputs = (
        Port("expected_heading_deg", 1, "deg, clockwise from north"),
        Port("heading_deg", 1, "deg, clockwise from north"),
        Port("move", 1, "0 or 1"),
    )
    outputs = (
        Port("duty", 2, "1, left and right, -1 to 1", ("duty_left", "duty_right")),
    )

    def __init__(
        self,
        *,
        parameters: HeadingControlParameters = HeadingControlParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("heading_controller")
        kind = PULSE_WIDTHS.index(parameters.pulse_widths)
        numbers = HeadingNumbers(parameters, kind, tick_s)
        self.declare(Step(heading_controller_step, numbers, [0.0] * 3), tick_s=tick_s)
