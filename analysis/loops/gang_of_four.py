"""The four closed-loop responses S, T, PS and CS of a feedback loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.frequency_levels import frequency_grid, peak
from analysis.loops.linear_models import minimal_model
from analysis.loops.open_loops import Direction, closed, cut_model
from analysis.loops.operating_points import OperatingPoint

#: First: number of points of the frequency grid, without those near modes and peaks.
#: Second: lowest frequency of the grid, rad/s.
_POINTS, _LOWEST = 800, 1e-2


@dataclass(frozen=True)
class GangOfFour:
    """Closed-loop frequency responses in one direction."""

    direction: Direction
    omega: NDArray[np.float64]
    """(n,) frequencies up to the Nyquist frequency, rad/s. They show all modes and
    peaks."""
    S: NDArray[np.complex128]
    """(n,) sensitivity: from an error that hearing adds to the source position, to the
    error that remains in the closed loop."""
    T: NDArray[np.complex128]
    """(n,) complementary sensitivity 1 - S."""
    PS: NDArray[np.complex128]
    """(n,) from a disturbing acceleration of the virtual mass to the source position
    relative to P that hearing reports, m / (m/s^2)."""
    CS: NDArray[np.complex128]
    """(n,) from an error of hearing to the acceleration from the law, (m/s^2) / m."""

    @property
    def peaks(self) -> dict[str, float]:
        """Largest magnitude of each response by name."""
        return {
            name: float(np.abs(getattr(self, name)).max())
            for name in ("S", "T", "PS", "CS")
        }


def gang_of_four(point: OperatingPoint, direction: Direction = "along") -> GangOfFour:
    """Returns the closed-loop frequency responses S, T, PS and CS in one direction.

    The disturbances are errors of hearing, and accelerations that are added to that of
    the virtual mass.
    """
    cut = cut_model(point, "sensor", "actuator")
    whole = closed(cut, cut.input_names)
    own, push = f"sensor_{direction}", f"actuator_{direction}"
    part = minimal_model(whole.part([own, push], [own, push]))
    grid = frequency_grid(part.poles, part.period_s, lowest=_LOWEST, points=_POINTS)
    peaks = [
        peak(part.part([u], [y]), offset)[1]
        for u, y, offset in (
            (own, own, -1.0),
            (own, own, 0.0),
            (push, own, 0.0),
            (own, push, 0.0),
        )
    ]
    within = [omega for omega in peaks if 0.0 < omega <= grid[-1]]
    omega = np.union1d(grid, within)
    response = part.response(omega)
    # The signal that comes back to the cut is -T times the error. It does not contain
    # the error itself.
    T = -response[0, 0]
    return GangOfFour(
        direction=direction,
        omega=omega,
        S=1.0 - T,
        T=T,
        PS=response[0, 1],
        CS=response[1, 0],
    )
