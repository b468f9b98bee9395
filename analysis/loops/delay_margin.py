"""Delay margin of the sampled loop, exact to fractions of a control period.

One matrix maps the state of the loop over one control period. Delayed signals become
additional states of this matrix. A delay may be any number of periods plus a fraction
of a period. A root search finds the delay at which the spectral radius of the matrix is
1.

The method is similar to semi-discretization, but contains no approximation: commands
are constant between control updates, and a matrix exponential gives the motion of the
plant in between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from analysis.loops.linear_models import NEUTRAL, LinearModel, minimal_model
from analysis.loops.linearization import plant_jacobians
from analysis.loops.loop_margins import is_loop, loop_margins
from analysis.loops.open_loops import Direction, closed, cut_model, open_loop
from analysis.loops.operating_points import OperatingPoint
from systems.framework.input_error import InputError

DelayPlace = Literal["sensor", "wheels"]

#: Places of a delay:
#: - sensor: estimates of the source arrive later than the tracker assumes
#: - wheels: wheel commands reach the motors later than in the diagram
DELAY_PLACES: tuple[DelayPlace, ...] = ("sensor", "wheels")

#: Largest delay margin that the search can find, s.
_LONGEST_S = 10.0


@dataclass(frozen=True)
class DelayMargin:
    """Smallest additional delay that makes a stable loop unstable."""

    at: DelayPlace
    direction: Direction
    delay_s: float
    """Delay in addition to that of the diagram, s. If no delay up to 10 s makes the
    loop unstable: infinity."""
    frequency_rad_s: float
    """Frequency of the oscillation at this delay, rad/s. If the delay is infinite:
    NaN."""


class DelayedLoop:
    """Sampled loop with an arbitrary delay of one signal in one direction."""

    def __init__(
        self,
        point: OperatingPoint,
        at: DelayPlace = "sensor",
        direction: Direction = "along",
    ) -> None:
        own = f"{at}_{direction}"
        whole = cut_model(point, at)
        (other,) = [name for name in whole.input_names if name != own]
        # Only the loop of this direction is cut. No state is removed from the model.
        self._cut = closed(whole, (other,))
        self._column = whole.input_names.index(own)
        self._at = at
        loop = point.loop
        self._tick_s = loop.tick_s
        self._plant = loop.indices("plant")
        self._A_plant, self._B_plant = plant_jacobians(point)
        names = loop.state_names
        self._wheels = [names.index(f"command.wheel_{s}") for s in ("left", "right")]
        self._hearing = names.index(
            "hearing.p_PS_B_x" if direction == "along" else "hearing.p_PS_B_y"
        )
        self._turn = np.array([[1.0, 1.0], [-1.0, 1.0]]) / math.sqrt(2.0)

    def _flow(self, seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Derivatives of the plant's state after some seconds of constant commands.

        The two matrices are the derivatives by the initial state, and by the commanded
        wheel speeds.
        """
        n, m = self._B_plant.shape
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = self._A_plant, self._B_plant
        moved = expm(block * seconds)
        return moved[:n, :n], moved[:n, n:]

    def period_matrix(self, delay_s: float) -> NDArray[np.float64]:
        """Returns the matrix of one control period with a delay of ``delay_s`` >= 0.

        Its state consists of the states of the loop and the delayed signals.
        """
        ticks, part = divmod(delay_s, self._tick_s)
        late = int(ticks)
        return (self._wheel_delay if self._at == "wheels" else self._sensor_delay)(
            late, part
        )

    def _wheel_delay(self, late: int, part: float) -> NDArray[np.float64]:
        """Matrix of one period for wheel commands that arrive late.

        The delay is ``late`` periods plus ``part`` seconds. In the first ``part``
        seconds of each period, the wheels still follow the older command.
        """
        cut, column = self._cut, self._column
        rest, _ = self._flow(self._tick_s - part)
        _, first = self._flow(part)
        older = np.zeros(len(cut.A))
        older[self._plant] = rest @ first @ self._turn[column]
        newer = cut.B[:, column] - older
        return _with_delays(cut, cut.C[column], [(newer, late), (older, late + 1)])

    def _sensor_delay(self, late: int, part: float) -> NDArray[np.float64]:
        """Matrix of one period for estimates of the source that arrive late.

        The delay is ``late`` periods plus ``part`` seconds. Hearing therefore measures
        the position of the source relative to an earlier pose of the robot.
        """
        cut, column = self._cut, self._column
        state, held = self._flow(self._tick_s - part)
        measured = np.zeros(len(cut.A))
        by_plant = cut.A[self._hearing, self._plant]
        measured[self._plant] = by_plant @ state
        measured += by_plant @ held @ cut.A[self._wheels]
        # ``measured`` is the measurement ``part`` seconds before the end of period k.
        # Without a delay, the tracker reads it at the start of period k + 2.
        return _with_delays(cut, measured, [(cut.B[:, column], late + 2)])

    def spectral_radius(self, delay_s: float) -> float:
        """Returns the largest |z| of all poles except neutral ones (z = 1)."""
        return self._largest(delay_s)[0]

    def _largest(self, delay_s: float) -> tuple[float, complex]:
        poles = np.linalg.eigvals(self.period_matrix(delay_s))
        poles = poles[np.abs(poles - 1.0) > NEUTRAL]
        largest = complex(poles[np.abs(poles).argmax()])
        return abs(largest), largest

    def critical_frequency(self, delay_s: float) -> float:
        """Returns the frequency of the pole with the largest |z|, rad/s."""
        return abs(float(np.angle(self._largest(delay_s)[1]))) / self._tick_s


def _with_delays(
    model: LinearModel,
    row: NDArray[np.float64],
    columns: list[tuple[NDArray[np.float64], int]],
) -> NDArray[np.float64]:
    """Matrix of the system x[k + 1] = A x[k] + sum of b_i y[k - n_i], with y = row x.

    ``columns`` has the pairs (b_i, n_i). The past values of y are states of the matrix,
    in addition to the controllable and observable states of ``model``.
    """
    B = np.column_stack([column for column, _ in columns])
    part = replace(
        model,
        B=B,
        C=row[None],
        D=np.zeros((1, len(columns))),
        input_names=tuple(f"late_{lag}" for _, lag in columns),
        output_names=("signal",),
    )
    small = minimal_model(part)
    count, longest = len(small.A), max(lag for _, lag in columns)
    matrix = np.zeros((count + longest, count + longest))
    matrix[:count, :count] = small.A
    for (_, lag), b in zip(columns, small.B.T, strict=True):
        if lag == 0:
            matrix[:count, :count] += np.outer(b, small.C[0])
        else:
            matrix[:count, count + lag - 1] += b
    if longest:
        matrix[count, :count] = small.C[0]
        matrix[count + 1 :, count:-1] = np.eye(longest - 1)
    return matrix


def delay_margin(
    point: OperatingPoint,
    at: DelayPlace = "sensor",
    direction: Direction = "along",
) -> DelayMargin:
    """Returns the smallest additional delay that makes a stable loop unstable.

    Raises InputError if the loop is unstable without this delay.
    """
    loop = DelayedLoop(point, at, direction)
    if loop.spectral_radius(0.0) >= 1.0:
        raise InputError(
            f"{at}, {direction}",
            "the loop is unstable without a delay, and has no delay margin; use a "
            "stable operating point (follow_equilibrium)",
        )
    tick_s = point.loop.tick_s
    none = DelayMargin(at, direction, math.inf, math.nan)
    opened = open_loop(point, at, direction)
    if not is_loop(opened):
        return none
    guess = loop_margins(opened).delay_margin_s
    if not guess < _LONGEST_S:
        return none

    def excess(delay_s: float) -> float:
        return loop.spectral_radius(delay_s) - 1.0

    low, high = guess, guess
    while excess(low) >= 0.0:
        low = max(0.0, low - tick_s)
    while excess(high) < 0.0:
        high += tick_s
        if high > _LONGEST_S + tick_s:
            return none
    found = float(brentq(excess, low, high, xtol=1e-9))
    return DelayMargin(at, direction, found, loop.critical_frequency(found))
