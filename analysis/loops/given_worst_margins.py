"""Worst margins of a family of loops that a user gives."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.given_box import box_ends, named
from analysis.loops.given_loops import as_linear_model
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_family import LoopFamily
from analysis.loops.worst_margins import (
    MOST_PARTS,
    MarginBound,
    bound_delay_margin,
    bound_disk_margin,
)
from analysis.report.plain_values import pick, plain
from systems.framework.input_error import InputError


@dataclass(frozen=True)
class WorstMargin:
    """One margin of the worst loop of a family, from both sides."""

    found: float
    """Smallest margin that was found; 0 if an unstable loop was found. The delay margin
    is infinite if no delay makes a loop unstable."""
    proven: float
    """Margin that every loop of the family has; 0 if nothing was proven."""
    worst_values: dict[str, float]
    """Parameters of the worst loop that was found."""
    frequency_rad_s: float
    """Frequency of the oscillation of this loop at its margin, rad/s."""
    parts: int
    """Number of parts of the box, the frequencies and the phases in the proofs."""

    @property
    def gap(self) -> float:
        """Difference of both margins, as a share of the one that was found."""
        if self.found == self.proven:
            return 0.0
        return 1.0 - self.proven / self.found

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; infinity and NaN become None."""
        names = [each.name for each in fields(self)]
        found: dict[str, Any] = plain(pick(self, "gap", *names))
        return found


@dataclass(frozen=True)
class WorstMargins:
    """Disk margin and delay margin of the worst loops of a family, from both sides."""

    disk: WorstMargin
    """Size of the disk with the skew that was asked for."""
    delay: WorstMargin
    """Delay margin, s."""
    period_s: float | None
    """Period of sampled loops, s; None for continuous loops."""
    fit_error: float
    """Assumed error of the polynomials that replace the dependence on the parameters,
    as a share of the largest coefficient. The proofs allow for this error."""
    computing_time_s: float

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; infinity and NaN become None."""
        return {
            "disk": self.disk.document(),
            "delay_s": self.delay.document(),
            **pick(self, "period_s", "fit_error", "computing_time_s"),
        }

    def __str__(self) -> str:
        parts = self.disk.parts + self.delay.parts
        effort = f"{parts} parts, {self.computing_time_s:.2f} s"
        delay = _text("delay margin", "s", self.delay)
        if self.period_s and math.isfinite(self.delay.proven):
            whole = math.floor(self.delay.proven / self.period_s + 1e-9)
            delay += f"; proven for {whole} periods of {self.period_s:g} s"
        return f"""{_text("disk margin", "", self.disk)}
{delay}
{effort}, error of the polynomials {self.fit_error:.1e}"""


def _text(name: str, unit: str, margin: WorstMargin) -> str:
    if margin.found == 0.0:
        what = "0: an unstable loop was found"
    elif math.isinf(margin.proven):
        return f"{name}: proven that it has no limit"
    else:
        least, found = (
            f"{value:.4g} {unit}".strip() for value in (margin.proven, margin.found)
        )
        what = f"at least {least} proven, {found} found (gap {100 * margin.gap:.2g} %)"
    values = ", ".join(f"{k} = {v:.6g}" for k, v in margin.worst_values.items())
    return f"{name}: {what}, with {values}"


def worst_margins(
    loop_of: Callable[[dict[str, float]], Any],
    box: Mapping[str, Sequence[float]],
    *,
    skew: float = 0.0,
    most_parts: int = MOST_PARTS,
) -> WorstMargins:
    """Bounds the disk margin and the delay margin over a box of uncertain parameters.

    A search finds a loop with a small margin. A proof by zero exclusion with Bernstein
    coefficients shows that no loop of the box has a margin much smaller (Barmish 1994;
    Garloff 1993). The phase of the factor in the disk, or of the delay, is one more
    parameter of the proof. As for ``robustness``, the coefficients of the polynomials
    of L are fitted, and the proofs assume an error of ten times the largest one at 40
    random points.

    Args:
        loop_of: Returns the loop transfer function L for parameters by name, with one
            input and one output, for negative feedback: one of the types of ``margins``
            except a frequency response, or (diagram, context, port) for a Drake
            diagram. The number of states must not depend on the parameters.
        box: Interval of each parameter: (low, high).
        skew: Skew of the disk, -1 to 1.
        most_parts: Largest number of parts into which one proof divides the box.

    Returns:
        Margins found and proven. A delay of a sampled loop is a whole number of
        periods: it is proven stable if it is not above the proven delay.

    Raises:
        InputError: The box is empty or not in order, or L is not one loop, has no
            states, or is not a smooth function of the parameters.
    """
    start = time.perf_counter()
    if not -1.0 <= skew <= 1.0:
        raise InputError("skew", f"is {skew:g}; give a number from -1 to 1")
    names = list(box)
    low, nominal, high = box_ends(box)
    first = _as_loop(loop_of(named(names, nominal)))

    def model_of(values: NDArray[np.float64]) -> LinearModel:
        model = _as_loop(loop_of(named(names, values)))
        if model.A.shape != first.A.shape or model.period_s != first.period_s:
            raise InputError(
                "loop_of",
                "the number of states or the period depends on the parameters; analyze "
                "each case alone",
            )
        return model

    family = LoopFamily(model_of, low, high)
    bounds = (
        bound_disk_margin(family, skew, most_parts),
        bound_delay_margin(family, most_parts),
    )
    disk, delay = (_result(names, each) for each in bounds)
    return WorstMargins(
        disk, delay, first.period_s, family.fit_error, time.perf_counter() - start
    )


def _as_loop(loop: Any) -> LinearModel:
    model = as_linear_model(*loop) if isinstance(loop, tuple) else as_linear_model(loop)
    if model.D.shape != (1, 1):
        raise InputError(
            "loop_of",
            f"returns {model.D.shape[1]} inputs and {model.D.shape[0]} outputs; open "
            "one loop at a time",
        )
    return model


def _result(names: list[str], bound: MarginBound) -> WorstMargin:
    return WorstMargin(
        bound.found,
        bound.proven,
        named(names, bound.worst),
        bound.frequency_rad_s,
        bound.parts,
    )
