"""The heading controller: duties of the motors from the expected heading."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.compass import wrapped_deg
from systems.heading.parameters import HeadingControlParameters

#: Methods to compute duties from the output of the PID controller: corrected, as
#: printed, and as printed with only the missing ``else`` added.
PULSE_WIDTHS = ("mended", "printed", "else_only")
_MENDED, _PRINTED, _ELSE_ONLY = range(len(PULSE_WIDTHS))


@register_jitable
def _limited(value: float, largest: float) -> float:
    return min(max(value, -largest), largest)


@register_jitable
def heading_error(
    deviation: float, change: float, integral: float, tick_s: float, own: Any
) -> tuple[float, float]:
    """Computes the output of the PID controller (Song 2011, table 1).

    Args:
        deviation: gamma, expected heading minus present heading, (-180, 180] deg.
        change: Change of the deviation since the last tick, wrapped, deg.
        integral: I, integral part at the last tick, deg.
        tick_s: Period of the control, s.
        own: ``HeadingControlParameters``.

    Returns:
        The output epsilon, deg, and the new integral part I, deg.
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
    """Computes the duties of the motors (Song 2011, table 2).

    In the corrected form, the left duty is v + w and the right duty is v - w, with
    v = max(0, 1 - |e|/L) and w = 0.01 e.

    Args:
        error: epsilon, output of the PID controller, clockwise, deg.
        limit: L, output beyond which the robot turns on the spot, deg.
        kind: Index in ``PULSE_WIDTHS``.

    Returns:
        The left and the right duty. They are not limited to -1 to 1.
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
    """Constants of the step of ``HeadingController``."""

    own: HeadingControlParameters
    kind: int
    tick_s: float


@register_jitable
def heading_controller_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: HeadingNumbers
) -> None:
    """Computes the duties of the motors.

    The state holds three numbers: the integral part, deg; the deviation at the last
    tick, deg; and whether the robot moved at the last tick, 0 or 1.
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
    """Turns the robot to the expected heading, and drives it in this direction.

    A PID controller computes an output from the deviation of the heading. The block
    then converts this output to the duties of the motors. The smaller the deviation,
    the faster the robot drives. While ``move`` is 0, the duties are 0.

    At the first tick of a move, the integral part starts at 0. The differential part is
    also 0 at this tick, so that it does not jump.

    The discrete state holds the integral part, the last deviation, and whether the
    robot moved at the last tick. It is updated every tick. There is no latency. The
    paper uses a period of 10 ms. Our tick of 25 ms reduces the phase margin by one
    degree (``analysis.linear.heading_loop``).

    Args:
        parameters: Gains and limits.
        tick_s: Period of the control, s.

    Reference: Song 2011, 2.3.2, tables 1 to 3, with the errata in docs/errata.md.
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
