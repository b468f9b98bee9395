"""Delay margins of loops that users give: models, or Drake diagrams cut at a port."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import System
from scipy.optimize import brentq

from analysis.loops.diagram_linearization import linearized, map_over_period
from analysis.loops.given_loops import (
    Loop,
    OpenedLoop,
    as_linear_model,
    is_response,
    opened_loop,
    refuse_place_without_diagram,
)
from analysis.loops.linear_models import NEUTRAL, LinearModel
from analysis.loops.loop_margins import loop_margins
from analysis.loops.margin_results import LoopMargins
from analysis.loops.response_margins import (
    measured_response,
    nyquist_stable,
    response_margins,
    response_period,
)
from systems.framework.input_error import InputError

#: Longest delay of a sampled loop that the search tries, in periods.
_MOST_PERIODS = 1_000


@dataclass(frozen=True)
class LoopDelayMargin:
    """Smallest delay of a signal in a loop that makes the closed loop unstable."""

    name: str
    """Name of the loop."""
    delay_s: float
    """Smallest destabilizing delay, s; infinite if there is none, or none of less than
    1,000 periods in a sampled loop."""
    frequency_rad_s: float
    """Frequency of the oscillation at this delay, rad/s; NaN for an infinite delay."""
    period_s: float | None
    """Period of a sampled loop, s; None for a continuous loop."""
    whole_periods: bool
    """Whether only whole periods of delay count, because a sampled block, or a model
    without the motion between two samples, reads the signal once per period."""

    def __str__(self) -> str:
        if not math.isfinite(self.delay_s):
            return f"{self.name}: no delay makes it unstable"
        text = (
            f"{self.name}: unstable from a delay of {self.delay_s:.4g} s on, "
            f"at {self.frequency_rad_s:.4g} rad/s"
        )
        if self.period_s is None:
            return text
        periods = f"{self.delay_s / self.period_s:.4g} periods of {self.period_s:g} s"
        return f"{text} ({periods}{'; a whole number' if self.whole_periods else ''})"

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; infinity and NaN become None."""
        finite = math.isfinite(self.delay_s)
        return {
            "name": self.name,
            "delay_s": self.delay_s if finite else None,
            "frequency_rad_s": self.frequency_rad_s if finite else None,
            "period_s": self.period_s,
            "whole_periods": self.whole_periods,
        }


def delay_margin(
    loop: Loop, context: Any = None, port: Any = None, *, unstable_poles: int = 0
) -> LoopDelayMargin:
    """Computes the smallest delay that makes a closed loop unstable.

    - Continuous model: exact, from the phases at all gain crossovers.
    - Sampled model: the model says nothing about the motion between two samples, so
      that the delay is a whole number of periods. It is exact, by the spectral radius
      of the loop with its past signals as additional states.
    - Drake diagram and port: the signal that the port receives arrives late, by any
      number of periods and a part of a period. It is exact: the diagram is simulated
      over one period in which the input changes at the end of this part. If the port
      belongs to a sampled block, only whole periods count, because the block reads its
      input once per period.
    - Frequency response: as for a model, from its interpolation and the Nyquist
      criterion.

    Args:
        loop: Loop transfer function with one input and one output, of the types of
            ``margins``.
        context: Root context of the diagram at the operating point; None: the default
            context. Only for diagrams.
        port: Input port inside the diagram, as for ``loop_at``. Only for diagrams.
        unstable_poles: Number of growing poles of L. It is needed only for frequency
            responses.

    Returns:
        Smallest destabilizing delay, and the frequency of the oscillation.

    Raises:
        InputError: The loop is unstable without a delay.
        InputError: A port is missing, or ``loop`` is not one loop.
    """
    if is_response(loop):
        refuse_place_without_diagram(loop, context, port)
        return _of_response(loop, unstable_poles)
    if isinstance(loop, System):
        opened = opened_loop(loop, context, port)
        model = opened.model
    else:
        opened, model = None, as_linear_model(loop, context, port)
    if model.period_s is None:
        return _continuous(loop_margins(model))
    if opened is not None and opened.read_after:
        step_at = partial(_diagram_step, loop, context, port, opened)
        return _sampled(model, step_at, whole_periods=False)
    return _sampled(model, partial(_model_step, model), whole_periods=True)


def _continuous(found: LoopMargins) -> LoopDelayMargin:
    if not found.stable:
        raise _unstable(found.name)
    delay, omega = found.delay_margin_s, found.delay_frequency_rad_s
    return LoopDelayMargin(found.name, delay, omega, None, whole_periods=False)


def _of_response(data: Any, unstable_poles: int) -> LoopDelayMargin:
    response, stable = measured_response(data, unstable_poles, 0.0)
    margin = _continuous(response_margins(response, stable=stable))
    period = response_period(data)
    if period is None:
        return margin
    late = replace(margin, delay_s=math.inf, period_s=period, whole_periods=True)
    if not margin.delay_s < _MOST_PERIODS * period:
        return replace(late, frequency_rad_s=math.nan)
    omega = response.omega
    for count in range(math.floor(margin.delay_s / period), _MOST_PERIODS):
        L = response.at(omega) * np.exp(-1j * omega * count * period)
        if not nyquist_stable(omega, L, unstable_poles):
            return replace(late, delay_s=count * period)
    return replace(late, frequency_rad_s=math.nan)


def _unstable(name: str) -> InputError:
    return InputError(
        "loop",
        f"{name} is unstable without a delay, and has no delay margin; check the "
        "sign of the feedback (it is negative) and the operating point",
    )


class _Step(NamedTuple):
    """Motion of the opened loop over one period, whose input changes after a part."""

    A: NDArray[np.float64]
    """(n, n) derivative of the next state by the state."""
    older: NDArray[np.float64]
    """(n,) derivative by the input of the first part; zero if the part is 0."""
    newer: NDArray[np.float64]
    """(n,) derivative by the input of the rest of the period."""
    C: NDArray[np.float64]
    """(n,) derivative of the signal that returns, by the state."""
    D: float
    """Derivative of the signal that returns, by the input at the same time."""


def _model_step(model: LinearModel, part: float = 0.0) -> _Step:
    B, C = model.B[:, 0], -model.C[0]
    return _Step(model.A, np.zeros_like(B), B, C, -float(model.D[0, 0]))


def _diagram_step(
    diagram: Any, context: Any, port: Any, opened: OpenedLoop, part: float
) -> _Step:
    """Simulates one period of the diagram whose input changes after ``part`` of it."""
    if part == 0.0:
        return _model_step(opened.model)
    mapped = map_over_period(
        diagram,
        context,
        [port],
        [opened.source],
        read_after=True,
        older_for_s=part * (opened.model.period_s or 0.0),
    )
    late = linearized(mapped).model
    return _Step(late.A, late.B[:, 0], late.B[:, 1], late.C[0], float(late.D[0, 0]))


def _sampled(
    model: LinearModel, step_at: Callable[[float], _Step], *, whole_periods: bool
) -> LoopDelayMargin:
    """Searches the smallest delay at which the largest |z| reaches 1."""
    period = model.period_s or 0.0
    if _largest_pole(_model_step(model), 0)[0] >= 1.0:
        raise _unstable(model.name)
    guess = loop_margins(model).delay_margin_s / period
    none = LoopDelayMargin(model.name, math.inf, math.nan, period, whole_periods)
    if not guess < _MOST_PERIODS:
        return none

    def excess(delay: float) -> float:
        late, part = divmod(delay, 1.0)
        return _largest_pole(step_at(part), int(late))[0] - 1.0

    low = float(math.floor(guess))
    while excess(low) >= 0.0:
        low -= 1.0
    high = low + 1.0
    while excess(high) < 0.0:
        low, high = high, high + 1.0
        if high > _MOST_PERIODS:
            return none
    delay = high if whole_periods else float(brentq(excess, low, high, xtol=1e-9))
    late, part = divmod(delay, 1.0)
    _, pole = _largest_pole(step_at(part), int(late))
    omega = abs(float(np.angle(pole))) / period
    return LoopDelayMargin(model.name, delay * period, omega, period, whole_periods)


def _largest_pole(step: _Step, late: int) -> tuple[float, complex]:
    """Returns the largest |z| with ``late`` periods of delay and a part, and its pole.

    The part of a period is that of the step. Past signals are additional states.
    Neutral poles (z = 1), for example of states that nothing controls, are left out.
    """
    count, with_part = len(step.A), bool(step.older.any())
    depth = late + with_part
    matrix = np.zeros((count + depth, count + depth))
    matrix[:count, :count] = step.A
    if depth == 0:
        matrix += np.outer(step.newer, step.C) / (1.0 - step.D)
    else:
        matrix[count, :count] = step.C
        # The signal returns at the beginning of the period, in its first part.
        matrix[count, -1] += step.D
        matrix[count + 1 :, count:-1] = np.eye(depth - 1)
        if with_part:
            matrix[:count, -1] = step.older
        if late:
            matrix[:count, count + late - 1] += step.newer
        else:
            matrix[:count, :count] += np.outer(step.newer, step.C)
            matrix[:count, -1] += step.newer * step.D
    poles = np.linalg.eigvals(matrix)
    poles = poles[np.abs(poles - 1.0) > NEUTRAL]
    if not len(poles):
        return 0.0, 0j
    largest = complex(poles[np.abs(poles).argmax()])
    return abs(largest), largest
