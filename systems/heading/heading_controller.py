"""The heading controller: duties of the motors from the expected heading."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.compass import wrapped_deg

# Gains and limits of Song 2011, 2.3.2 and tables 1 and 2.
#: K_P, gain of the proportional part.
PROPORTIONAL = 2.0
#: K_I, gain of the integral part, 1/s.
INTEGRAL_1_S = 0.5
#: K_D, gain of the differential part, s.
DIFFERENTIAL_S = 0.01
#: L, output of the PID controller beyond which the robot turns on the spot, deg.
TURNING_BEYOND_DEG = 50.0
#: Deviation below which the integral part accumulates, deg. At larger deviations, the
#: integral part is 0.
_INTEGRAL_WITHIN_DEG = 20.0
#: Limits of the absolute values of the integral part and of the differential part, deg.
_LARGEST_INTEGRAL_DEG, _LARGEST_DIFFERENTIAL_DEG = 30.0, 20.0
#: Limit of the output, deg. The text states this limit, but table 1 does not.
_LARGEST_OUTPUT_DEG = 100.0


@register_jitable
def _limited(value: float, largest: float) -> float:
    return min(max(value, -largest), largest)


@register_jitable
def heading_error(
    deviation: float, change: float, integral: float, tick_s: float
) -> tuple[float, float]:
    """Computes the output of the PID controller for the heading (Song 2011, table 1).

    Args:
        deviation: Deviation gamma: expected heading minus present heading, deg, in
            (-180, 180].
        change: Wrapped change of the deviation since the last tick (control period),
            deg.
        integral: Integral part I at the last tick, deg.
        tick_s: Control period, s.

    Returns:
        Two values: the output epsilon of the controller, deg; and the new integral part
        I, deg.
    """
    if abs(deviation) < _INTEGRAL_WITHIN_DEG:
        integral += INTEGRAL_1_S * deviation * tick_s
        integral = _limited(integral, _LARGEST_INTEGRAL_DEG)
    else:
        integral = 0.0
    rate = DIFFERENTIAL_S * change / tick_s
    rate = _limited(rate, _LARGEST_DIFFERENTIAL_DEG)
    total = PROPORTIONAL * deviation + integral + rate
    return _limited(total, _LARGEST_OUTPUT_DEG), integral


@register_jitable
def motor_duties(error: float) -> tuple[float, float]:
    """Computes the duties of the two motors (Song 2011, table 2, corrected).

    Let e be the output of the PID controller, deg, and L be ``TURNING_BEYOND_DEG``.
    With v = max(0, 1 - |e|/L) and w = 0.01 e, the left duty is v + w and the right duty
    is v - w. The duties therefore change without a jump from driving at full speed to
    turning on the spot. docs/errata.md states the errors in the printed table.

    Args:
        error: Output e of the controller, deg, positive clockwise.

    Returns:
        Left duty and right duty. They are not yet limited to the range -1 to 1.
    """
    ahead, turn = max(0.0, 1.0 - abs(error) / TURNING_BEYOND_DEG), 0.01 * error
    return ahead + turn, ahead - turn


class HeadingNumbers(NamedTuple):
    """Constants of the step of ``HeadingController``."""

    tick_s: float


@register_jitable
def heading_controller_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: HeadingNumbers
) -> None:
    """Computes the duties of the two motors in one tick (control period).

    The state has three numbers, in this order:

    - the integral part, deg;
    - the deviation of the heading at the last tick, deg;
    - whether the robot moved at the last tick, 0 or 1.
    """
    expected, heading, move = inputs
    duty = outputs[0]
    if move[0] < 0.5:
        state[0], state[2] = 0.0, 0.0
        duty[0], duty[1] = 0.0, 0.0
        return
    deviation = wrapped_deg(expected[0] - heading[0])
    change = wrapped_deg(deviation - state[1]) if state[2] > 0.5 else 0.0
    error, state[0] = heading_error(deviation, change, state[0], numbers.tick_s)
    state[1], state[2] = deviation, 1.0
    left, right = motor_duties(error)
    duty[0], duty[1] = _limited(left, 1.0), _limited(right, 1.0)


class HeadingController(Block):
    """Turns the robot to the expected heading, and drives the robot in this direction.

    A PID controller computes an output from the deviation of the heading. The block
    then converts this output to the duties of the motors. The smaller the deviation is,
    the faster the robot drives. While the input ``move`` is 0, the duties are 0.

    At the first tick (control period) of a move, the integral part starts at 0. The
    differential part is 0 at this tick, so that the output does not jump.

    The discrete state has the integral part, the last deviation, and whether the robot
    moved at the last tick. The block updates the state at every tick. There is no
    latency. The paper uses a control period of 10 ms. Our control period of 25 ms
    reduces the phase margin by one degree (``analysis.loops.heading_loop``).

    Args:
        tick_s: Control period, s.

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

    def __init__(self, *, tick_s: float = TICK_S) -> None:
        super().__init__()
        self.set_name("heading_controller")
        step = Step(heading_controller_step, HeadingNumbers(tick_s), [0.0] * 3)
        self.declare(step, tick_s=tick_s)
