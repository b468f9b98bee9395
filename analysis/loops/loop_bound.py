"""Proven bounds beside the worst case that random parameters and corners show."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.growth_bound import Family, bound_growth
from analysis.loops.linear_models import growth_per_s
from analysis.loops.motion_families import Box, BoxFamilies
from analysis.loops.robustness import PoleCloud, UncertainParameter
from analysis.loops.stable_scale import stable_scale
from analysis.loops.worst_margins import (
    MarginBound,
    bound_delay_margin,
    bound_disk_margin,
)
from systems.framework.input_error import InputError

#: Largest difference between the growth rates of a loop and of its family, 1/s.
_SAME = 1e-4
#: Assumed ratio of the largest difference in the box and at its random points.
_SAFETY = 10.0
#: Ratio of the two scales at which their search ends.
_CLOSE = 1.02

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class WorstOf:
    """Smallest margin of all loops in the box, from both sides."""

    found: float
    """Smallest margin that was found; 0 if an unstable loop was found."""
    proven: float
    """Margin that every loop has; 0 if nothing was proven."""
    frequency_rad_s: float
    """Frequency of the oscillation at the margin that was found, rad/s."""


@dataclass(frozen=True)
class LoopBound:
    """Growth rate that no parameters in the box exceed, stable scale, and margins."""

    proven_growth_per_s: float
    """Growth rate that is not exceeded, 1/s. Infinite if nothing was proven."""
    model_error_per_s: float
    """Largest difference of the growth rates of the loop and of the family of loops,
    1/s, where they were compared: at the random points of the box, or at the nominal
    parameters. ``proven_growth_per_s`` contains ten times this difference."""
    scale_proven: float
    """The box may grow by this factor about the nominal parameters, and all loops are
    still proven stable."""
    scale_unstable: float
    """Smallest factor for which an unstable loop was found; infinite if none was."""
    scale_largest: float
    """Largest factor that was examined."""
    disk_margin: WorstOf
    """Disk margin with skew 0 of the loops, opened at the acceleration that the law
    commands, or at the deviation of the heading."""
    delay_margin_s: WorstOf
    """Delay margin of the same loops, s. A delay is a whole number of ticks."""
    parts: int
    """Number of parts of box and frequencies in the proof of the growth rate."""
    computing_time_s: float


def bound_loop(
    families_of: BoxFamilies, cloud: PoleCloud, known_error_per_s: float = 0.0
) -> LoopBound:
    """Proves a bound of the growth rate over the box of a pole cloud.

    Args:
        families_of: The loops in a box. Their poles must be those of the cloud.
        cloud: Poles at random points.
        known_error_per_s: Difference of the growth rates of the loop and of the family,
            1/s, if the poles of the cloud are those of the family.

    Returns:
        The bound, the scale of the box up to which all loops are stable, and margins.

    Raises:
        InputError: The families do not describe the loop.
    """
    start = time.perf_counter()
    scale = _scale(families_of, cloud.parameters)
    box = _box(cloud.parameters, [(p.low, p.high) for p in cloud.parameters])
    families = families_of(box)
    bounds = [bound_growth(family) for family in families]
    error = max(known_error_per_s, _model_error(families_of, cloud))
    if error > _SAME:
        raise InputError(
            "law",
            f"no reduced loop has the poles of this loop: the growth rates differ by "
            f"{error:.1e} 1/s",
        )
    return LoopBound(
        max(bound.proven_per_s for bound in bounds) + _SAFETY * error,
        error,
        *scale,
        _worst([bound_disk_margin(family.opened) for family in families]),
        _worst([bound_delay_margin(family.opened) for family in families]),
        sum(bound.parts for bound in bounds),
        round(time.perf_counter() - start, 3),
    )


def _worst(bounds: Sequence[MarginBound]) -> WorstOf:
    worst = min(bounds, key=lambda bound: bound.found)
    proven = min(bound.proven for bound in bounds)
    return WorstOf(worst.found, proven, worst.frequency_rad_s)


def _box(
    parameters: Sequence[UncertainParameter], ends: Sequence[tuple[float, float]]
) -> Box:
    return {p.name: each for p, each in zip(parameters, ends, strict=True)}


def _model_error(families_of: BoxFamilies, cloud: PoleCloud) -> float:
    names = [p.name for p in cloud.parameters]
    worst = tuple(cloud.worst_values[name] for name in names)
    points = [*map(tuple, cloud.values.tolist()), worst]
    radii = [*cloud.radii.tolist(), cloud.worst_radius]
    differences = []
    for point, radius in zip(points, radii, strict=True):
        box = _box(cloud.parameters, [(value, value) for value in point])
        found = max(f.exact_growth(0.5 * (f.low + f.high)) for f in families_of(box))
        differences.append(abs(found - growth_per_s(radius, cloud.period_s)))
    return float(max(differences))


def _scale(
    families_of: BoxFamilies, parameters: Sequence[UncertainParameter]
) -> tuple[float, float, float]:
    """Scales proven, unstable and largest. Other intervals stay the same."""
    free = [p for p in parameters if p.scaled and not p.whole]
    others = [p for p in parameters if p not in free]
    fixed = _box(others, [(p.low, p.high) for p in others])

    def families(low: Vector, high: Vector) -> Sequence[Family]:
        ends = list(zip(low.tolist(), high.tolist(), strict=True))
        return families_of({**fixed, **_box(free, ends)})

    found = stable_scale(
        families,
        np.array([p.low for p in free]),
        np.array([p.nominal for p in free]),
        np.array([p.high for p in free]),
        close=_CLOSE,
    )
    return found.proven, found.unstable, found.largest
