"""Loops of users that are closed only part of the time, for example during a sound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from analysis.loops.given_loops import Loop, as_linear_model
from analysis.loops.linear_models import LinearModel
from systems.framework.input_error import InputError

#: Largest distance of a number of periods from a whole number.
_WHOLE = 1e-6


@dataclass(frozen=True)
class LoopBurstCycle:
    """Growth of a loop that is closed for a time and then open, again and again."""

    name: str
    """Name of the loop."""
    on_s: float
    """Time per cycle for which the loop is closed, s."""
    off_s: float
    """Time per cycle for which the loop is open, s."""
    multipliers: NDArray[np.complex128]
    """(n,) eigenvalues of the map over one cycle, the largest first."""

    @property
    def largest(self) -> float:
        """Largest |multiplier|. If it is below 1, deviations decay."""
        return float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def stable(self) -> bool:
        """Whether all deviations decay from cycle to cycle."""
        return self.largest < 1.0

    def __str__(self) -> str:
        return (
            f"{self.name}: closed for {self.on_s:g} s, open for {self.off_s:g} s: "
            f"{'stable' if self.stable else 'unstable'}, largest factor per cycle "
            f"{self.largest:.4g}"
        )

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; multipliers are [real, imaginary]."""
        return {
            "name": self.name,
            "on_s": self.on_s,
            "off_s": self.off_s,
            "largest": self.largest,
            "stable": self.stable,
            "multipliers": [[z.real, z.imag] for z in self.multipliers.tolist()],
        }


def burst_cycle(
    loop: Loop,
    on_s: float,
    off_s: float,
    context: Any = None,
    port: Any = None,
    *,
    hold: Literal["zero", "last"] = "last",
) -> LoopBurstCycle:
    """Computes the growth of a loop that is closed only part of the time.

    A cycle begins with ``on_s`` seconds in which the feedback acts (u = -y). In the
    following ``off_s`` seconds, the input u is zero or keeps its last value. For
    example, a robot that follows a sound has no new measurement while the source is
    silent.

    Args:
        loop: Loop transfer function L, of the types of ``margins`` except frequency
            responses, with as many outputs as inputs.
        on_s: Time per cycle for which the loop is closed, s, > 0.
        off_s: Time per cycle for which the loop is open, s, >= 0.
        context: Root context of the diagram; None: the default context. Only for
            diagrams.
        port: Input port inside the diagram, as for ``loop_at``. Only for diagrams.
        hold: Input while the loop is open: ``zero``, or the ``last`` value.

    Returns:
        Eigenvalues of the map over one cycle.

    Raises:
        InputError: The times are negative or, in a sampled loop, no whole numbers of
            periods.
        InputError: ``hold`` is unknown, or the loop is not square.
    """
    model = as_linear_model(loop, context, port)
    width = model.B.shape[1]
    if model.C.shape[0] != width:
        raise InputError(
            "loop",
            f"has {width} inputs and {model.C.shape[0]} outputs; give as many outputs "
            "as inputs",
        )
    if hold not in ("zero", "last"):
        raise InputError("hold", f"is {hold!r}; give 'zero' or 'last'")
    for name, time_s, least in (("on_s", on_s, 0.0), ("off_s", off_s, -1e-300)):
        if not least < time_s < np.inf:
            raise InputError(name, f"is {time_s:g} s; give a positive time in s")
    # States: those of the model, and the input, which is -y while the loop is closed.
    n = len(model.A)
    feedback = -np.linalg.solve(np.eye(width) + model.D, model.C)
    closed = _over(model, model.A + model.B @ feedback, np.zeros((n, 0)), on_s, "on_s")
    free = _over(model, model.A, model.B, off_s, "off_s")
    moved = closed[:n, :n]
    if model.period_s:
        # The last input of a sampled loop is that of the last period.
        last = _over(
            model,
            model.A + model.B @ feedback,
            np.zeros((n, 0)),
            on_s - model.period_s,
            "on_s",
        )
        final = feedback @ last[:n, :n]
    else:
        final = feedback @ moved
    cycle = free[:n, :n] @ moved
    if hold == "last":
        cycle = cycle + free[:n, n:] @ final
    multipliers = np.linalg.eigvals(cycle).astype(complex)
    order = np.argsort(-np.abs(multipliers))
    return LoopBurstCycle(model.name, on_s, off_s, multipliers[order])


def _over(
    model: LinearModel,
    A: NDArray[np.float64],
    B: NDArray[np.float64],
    time_s: float,
    name: str,
) -> NDArray[np.float64]:
    """Map of state and constant input over some time."""
    n, width = B.shape
    block = np.zeros((n + width, n + width))
    block[:n, :n], block[:n, n:] = A, B
    if not model.period_s:
        return np.asarray(expm(block * time_s))
    periods = time_s / model.period_s
    if abs(periods - round(periods)) > _WHOLE:
        raise InputError(
            name,
            f"is {time_s:g} s; give a multiple of the period, {model.period_s:g} s",
        )
    block[n:, n:] = np.eye(width)
    return np.linalg.matrix_power(block, round(periods))
