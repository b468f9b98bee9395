"""Margins of a loop, as numbers, text, JSON documents and plots.

Gain and phase margins are two-sided, because a loop with an unstable plant also becomes
unstable if its gain is too low.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.frequency_levels import GRID_POINTS, frequency_grid
from analysis.loops.linear_models import LinearModel
from analysis.loops.margin_plots import PlotKind, plot_margins
from analysis.report.plain_values import pick, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Skews of the disk margins. -1 emphasizes reductions of the gain, 1 emphasizes
#: increases, and 0 treats reductions and increases alike.
SKEWS = (-1.0, 0.0, 1.0)


@dataclass(frozen=True)
class FrequencyResponse:
    """Frequency response of a loop transfer function L."""

    omega: NDArray[np.float64]
    """(n,) frequencies, rad/s."""
    L: NDArray[np.complex128]
    """(n,) values of L at these frequencies."""


@dataclass(frozen=True)
class DiskMargin:
    """Disk margin: largest disk of gain and phase changes that keeps the loop stable.

    The loop stays stable if L is multiplied by any factor

        (1 + (1 - skew)/2 d) / (1 - (1 + skew)/2 d)

    with a complex |d| < alpha (Seiler, Packard and Gahinet 2020).
    """

    skew: float
    """Skew of the disk. With 0, gain increase and gain reduction count alike."""
    alpha: float
    """Largest size of the disk for which the loop stays stable. If the closed loop
    itself is unstable: 0."""
    frequency_rad_s: float
    """Frequency at which the smallest destabilizing factor acts, rad/s."""

    def __str__(self) -> str:
        """Size of the disk, and the changes of gain or phase that it permits."""
        return (
            f"alpha {self.alpha:.4g}, skew {self.skew:g}: gain {self.gain_low:.4g} to "
            f"{self.gain_high:.4g}, phase {self.phase_margin_deg:.4g} deg"
        )

    def to_dict(self) -> dict[str, float]:
        """Values for the JSON document."""
        names = (
            "skew", "alpha", "gain_low", "gain_high", "gain_margin_db",
            "phase_margin_deg", "frequency_rad_s",
        )  # fmt: skip
        return pick(self, *names)

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; infinity and NaN become None."""
        found: dict[str, Any] = plain(self)
        return found

    @property
    def gain_low(self) -> float:
        """Smallest gain factor in the disk; 0 if even a vanishing gain is in it."""
        return max(0.0, self._ends[0])

    @property
    def gain_high(self) -> float:
        """Largest gain factor in the disk; infinite if there is no limit."""
        return self._ends[1]

    @property
    def gain_margin_db(self) -> float:
        """Change of the gain that is permitted in both directions, dB."""
        return _least_db(self.gain_low, self.gain_high)

    @property
    def phase_margin_deg(self) -> float:
        """Change of the phase that is permitted in both directions, deg."""
        # Some d with |d| = alpha gives the factor exp(j phase) with this phase.
        if self.alpha == math.inf:
            return math.inf
        squared = self.alpha**2
        cosine = 4.0 - squared * (1.0 + self.skew**2)
        cosine /= 4.0 + squared * (1.0 - self.skew**2)
        return math.degrees(math.acos(cosine)) if cosine > -1.0 else math.inf

    @property
    def _ends(self) -> tuple[float, float]:
        """Gain factors at which the disk meets the real axis: smallest and largest."""
        if self.alpha == math.inf:
            return -math.inf, math.inf
        less, more = self.alpha * (1.0 - self.skew), self.alpha * (1.0 + self.skew)
        high = (2.0 + less) / (2.0 - more) if more < 2.0 else math.inf
        return (2.0 - less) / (2.0 + more), high


@dataclass(frozen=True)
class LoopMargins:
    """Stability margins of a loop.

    The default values of the fields are those of an unstable closed loop.
    """

    name: str
    """Name of the loop."""
    model: LinearModel | FrequencyResponse = field(repr=False)
    """Loop transfer function L. It is a frequency response if the loop was given as
    one, or has a pure delay."""
    stable: bool = False
    """Whether the closed loop is stable."""
    gain_increase_margin: float = 1.0
    """Gain factor above 1 at which the loop becomes unstable; infinite if none does."""
    gain_reduction_margin: float = 1.0
    """Gain factor below 1 at which the loop becomes unstable; 0 if none does."""
    phase_lag_margin_deg: float = 0.0
    """Smallest phase lag, deg, at a gain crossover that makes the loop unstable.
    Without a crossover: infinity."""
    phase_lead_margin_deg: float = 0.0
    """Smallest phase lead, deg, at a gain crossover that makes the loop unstable.
    Without a crossover: infinity."""
    crossover_rad_s: float = math.nan
    """Gain crossover that determines the phase margin, rad/s. Without a crossover:
    NaN."""
    delay_margin_s: float = 0.0
    """Delay margin, s: smallest ratio of phase lag, rad, to frequency, rad/s, over all
    gain crossovers. The value is exact for continuous loops. Module
    ``analysis.loops.delay_margin`` computes the exact value for sampled loops."""
    delay_frequency_rad_s: float = math.nan
    """Gain crossover that determines the delay margin, rad/s. Without a crossover:
    NaN."""
    modulus_margin: float = 0.0
    """Smallest distance of L from -1 over all frequencies."""
    modulus_frequency_rad_s: float = math.nan
    """Frequency at which L is nearest to -1, rad/s."""
    sensitivity_peak: float = math.inf
    """Largest |S| over all frequencies (M_s), where S = 1/(1 + L)."""
    complementary_peak: float = math.inf
    """Largest |T| over all frequencies (M_t), where T = L/(1 + L)."""
    disks: tuple[DiskMargin, ...] = tuple(
        DiskMargin(skew, 0.0, math.nan) for skew in SKEWS
    )
    """One disk margin for each of ``SKEWS``."""

    def __str__(self) -> str:
        """The margins, one per line, with their units."""
        if not self.stable:
            return f"{self.name}: the closed loop is unstable"
        up, down = self.gain_increase_margin, self.gain_reduction_margin
        rows = {
            "gain": f"{_in_db(up)} up, {_in_db(down)} down",
            "phase": f"{self.phase_lag_margin_deg:.4g} deg lag, "
            f"{self.phase_lead_margin_deg:.4g} deg lead, "
            f"at {self.crossover_rad_s:.4g} rad/s",
            "delay": f"{self.delay_margin_s:.4g} s",
            "modulus": f"{self.modulus_margin:.4g} "
            f"at {self.modulus_frequency_rad_s:.4g} rad/s",
            "peaks": f"M_s {self.sensitivity_peak:.4g}, "
            f"M_t {self.complementary_peak:.4g}",
            "disk": str(self.disk),
        }
        return "\n".join([f"{self.name}: the closed loop is stable", *_aligned(rows)])

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; infinity and NaN become None."""
        names = (
            "name", "stable", "gain_increase_margin", "gain_reduction_margin",
            "gain_margin_db", "phase_lag_margin_deg", "phase_lead_margin_deg",
            "crossover_rad_s", "phase_margin_deg", "delay_margin_s", "modulus_margin",
            "modulus_frequency_rad_s", "sensitivity_peak", "complementary_peak",
            "disks",
        )  # fmt: skip
        found: dict[str, Any] = plain(pick(self, *names))
        return found

    def plot(self, kind: PlotKind = "bode") -> Figure:
        """Plots the loop transfer function and marks the points behind the margins.

        Args:
            kind: Kind of the plot: ``bode``, ``nyquist`` or ``nichols``.

        Returns:
            The figure. The curves are those of the package ``control``.

        Raises:
            InputError: The kind is not known.
        """
        return plot_margins(self, kind)

    @cached_property
    def response(self) -> FrequencyResponse:
        """Frequency response with enough points for figures."""
        if isinstance(self.model, FrequencyResponse):
            return self.model
        return frequency_response(self.model)

    @property
    def gain_increase_margin_db(self) -> float:
        """Gain increase at which the loop becomes unstable, dB."""
        return _least_db(0.0, self.gain_increase_margin)

    @property
    def gain_reduction_margin_db(self) -> float:
        """Gain reduction at which the loop becomes unstable, dB; positive."""
        return _least_db(self.gain_reduction_margin, math.inf)

    @property
    def gain_margin_db(self) -> float:
        """Smallest destabilizing change of the gain, up or down, dB."""
        return _least_db(self.gain_reduction_margin, self.gain_increase_margin)

    @property
    def phase_margin_deg(self) -> float:
        """Smallest destabilizing change of the phase, lag or lead, deg."""
        return min(self.phase_lag_margin_deg, self.phase_lead_margin_deg)

    @property
    def disk(self) -> DiskMargin:
        """Disk margin with skew 0."""
        return next(disk for disk in self.disks if disk.skew == 0.0)


def _aligned(rows: dict[str, str]) -> list[str]:
    width = max(map(len, rows))
    return [f"{name:<{width}}  {value}" for name, value in rows.items()]


def _in_db(factor: float) -> str:
    """Writes a gain factor with its size in dB; the factor may be 0 or infinite."""
    if factor in {0.0, math.inf}:
        return "no limit"
    return f"{factor:.4g} ({20.0 * math.log10(factor):+.4g} dB)"


def _least_db(low: float, high: float) -> float:
    """Distance from 1 to the nearer end of an interval of gain factors, dB."""
    down = 20.0 * math.log10(1.0 / low) if low > 0.0 else math.inf
    return min(down, 20.0 * math.log10(high))


def frequency_response(model: LinearModel) -> FrequencyResponse:
    """Returns the response on a grid that shows all modes of open and closed loop."""
    omega = loop_grid(model, GRID_POINTS)
    return FrequencyResponse(omega, model.response(omega)[0, 0])


def loop_grid(model: LinearModel, points: int) -> NDArray[np.float64]:
    """(n,) frequencies, rad/s, that show the modes of the open and the closed loop."""
    poles = np.concatenate((model.poles, complementary(model).poles))
    return frequency_grid(poles, model.period_s, points=points)


def complementary(model: LinearModel) -> LinearModel:
    """T = L/(1 + L). If the closed loop is stable, all poles of T decay."""
    share = 1.0 / (1.0 + model.D[0, 0])
    return replace(
        model,
        A=model.A - model.B @ model.C * share,
        B=share * model.B,
        C=share * model.C,
        D=share * model.D,
    )
