"""Parts of the stability report about the gains of a robot on a route."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from analysis.loops.margin_results import LoopMargins
from analysis.report.criterion import Criterion
from analysis.report.plain_values import pick
from analysis.report.section import Cell, Column, Content, Figure, Table, number
from analysis.routes.frozen_gains import (
    WELL_DAMPED,
    FrozenPoint,
    GainBounds,
    frozen_gains,
    gain_bounds,
)
from analysis.routes.route_loop import route_law
from analysis.routes.trajectory_plots import (
    plot_frozen_poles,
    plot_gain_bounds,
)
from analysis.stability.law_analysis import Part, Study
from analysis.stability.margin_parts import margin_criteria
from analysis.stability.requirements import REQUIRED
from systems.ranging.parameters import OBJECT_SLOTS

#: Fields of ``LoopMargins`` that the JSON document contains.
_MARGINS = (
    "stable", "gain_margin_db", "phase_margin_deg", "delay_margin_s",
    "crossover_rad_s", "sensitivity_peak",
)  # fmt: skip


def _frozen_document(data: Sequence[FrozenPoint]) -> list[dict[str, Any]]:
    return [
        {
            **pick(point, "at", "stiffness_n_m", "damping_n_s_m"),
            "poles": point.model.s_poles,
            **pick(point.model, "growth_per_s", "damping_ratio"),
            "margins": {
                axis: pick(margins, *_MARGINS)
                for axis, margins in point.margins.items()
            },
        }
        for point in data
    ]


def _show_frozen(data: Sequence[FrozenPoint]) -> list[Content]:
    return [
        ("The models describe the loop about P's target with constant gains: law, "
         "wheel command, plant and odometry as built, each linearized, over one tick. "
         "On the route the robot drives at the target's speed. In contact a wall at "
         "rest is across its path; K and D act along the path. The safety filter does "
         "not intervene, and no limit is reached."),
        Table.of(
            data,
            {
                "place": "at.name",
                Column("K", "N/m"): "stiffness_n_m",
                Column("D", "N s/m"): "damping_n_s_m",
                Column("poles ln(z)/T", "rad/s"): lambda at: ", ".join(_poles_of(at)),
                Column("growth", "1/s"): "model.growth_per_s",
                "damping ratio": "model.damping_ratio",
            },
        ),
        Table(
            [
                "place", "direction", Column("gain", "dB"), Column("phase", "deg"),
                Column("delay", "s"), "M_s",
            ],
            [
                [point.at.name, axis, each.gain_margin_db, each.phase_margin_deg,
                 each.delay_margin_s, each.sensitivity_peak]
                for point in data
                for axis, each in point.margins.items()
            ],
            "Margins of the loop cut at the acceleration",
        ),
        Figure(lambda: plot_frozen_poles(data), "Poles with frozen gains."),
    ]  # fmt: skip


def _poles_of(point: FrozenPoint) -> list[str]:
    """Returns the poles as texts, slowest first. A conjugate pair gives one text."""
    poles = sorted(point.model.s_poles.tolist(), key=lambda pole: -pole.real)
    shown = [pole for pole in poles if pole.imag >= -1e-9]
    return [number(p if abs(p.imag) > 1e-9 else p.real) for p in shown]


def _all_cuts(data: Sequence[FrozenPoint]) -> list[LoopMargins]:
    return [margins for point in data for margins in point.margins.values()]


FROZEN_GAINS = Part[Sequence[FrozenPoint]](
    "frozen_gains",
    "Frozen gains",
    lambda study: frozen_gains(study.scenario),
    _show_frozen,
    criteria=(
        Criterion(
            "growth with frozen gains", "1/s", "below", 0.0,
            "small deviations die out, on the route, at rest and before a wall",
            "small deviations grow, on the route, at rest or before a wall",
            "stability",
            lambda data: max(point.model.growth_per_s for point in data),
        ),
        Criterion(
            "damping ratio out of contact", "", "at least", WELL_DAMPED,
            "it hardly overshoots its target",
            "it overshoots its target",
            "set by this project: 5 % of overshoot",
            lambda data: min(
                point.model.damping_ratio for point in data if point.at.wall_m is None
            ),
        ),
        Criterion(
            "least damping ratio", "", "at least", 0.4,
            "it does not swing before a wall either",
            "somewhere in the zone of a wall it swings for several cycles",
            "usual: 0.4 to 0.8 (Astrom and Murray)",
            lambda data: min(point.model.damping_ratio for point in data),
        ),
        *margin_criteria(_all_cuts),
        Criterion(
            "least delay margin of the loop without sampling", "s", "at least",
            REQUIRED.delay_margin_s,
            "it tolerates more added delay than the threshold",
            "less added delay than the threshold makes it oscillate",
            "set by this project; phase margin divided by crossover frequency",
            lambda data: min(margins.delay_margin_s for margins in _all_cuts(data)),
        ),
    ),
    document=_frozen_document,
    models=lambda data: [
        replace(point.model, name=f"frozen gains {point.at.name}") for point in data
    ],
)  # fmt: skip


@dataclass(frozen=True)
class SpringBounds:
    """Bounds of stiffness and damping, and the stiffness of the scenario."""

    bounds: GainBounds
    total_stiffness_n_m: float
    """Sum of the stiffness to the target and the stiffness of a contact, N/m."""

    @property
    def share(self) -> float:
        """Total stiffness divided by the largest stable stiffness.

        This limit holds if the springs use positions that are one control period late.
        """
        bound = self.bounds.stable_today_n_m[-1]
        return self.total_stiffness_n_m / bound if bound > 0.0 else math.inf


def _bounds(study: Study) -> SpringBounds:
    own = route_law(study.scenario)
    return SpringBounds(
        gain_bounds(study.scenario), own.stiffness_n_m + own.contact_stiffness_n_m
    )


def _show_bounds(data: SpringBounds) -> list[Content]:
    bounds = data.bounds
    rows: list[list[Cell]] = [
        [
            f"{late} tick{'s' * (late > 1)} late" if late else "as built",
            bounds.stable_today_n_m[k],
            bounds.closed_form_n_m[k],
            bounds.damped_today_n_m[k],
        ]
        for k, late in enumerate(bounds.late_ticks)
    ]
    stiffness, damping = bounds.today["target"]
    contacts = (
        "any number of" if math.isinf(bounds.contacts) else f"{bounds.contacts:g}"
    )
    return [
        (
            f"The bounds are for D = {number(damping)} N s/m (K is set to "
            f"{number(stiffness)} N/m), a motor lag of "
            f"{number(bounds.mass.motor_lag_s)} s and ticks of "
            f"{number(bounds.mass.tick_s * 1e3)} ms. They come from bisection on the "
            "one-period matrix of the blocks, and from the closed form that is used "
            "for warnings before a run."
        ),
        Table(
            [
                "position that springs act on",
                Column("stable below K", "N/m"),
                "closed form",
                Column(f"damping ratio {WELL_DAMPED:g} up to K", "N/m"),
            ],
            rows,
        ),
        (
            "Dampers act on the velocity of the virtual mass. Together they may reach "
            f"{number(bounds.most_damping_n_s_m)} N s/m; 2 M/T is "
            f"{number(bounds.closed_damping_n_s_m)}. Therefore {contacts} contacts may "
            "act at once with full damping: combine a scan of more beams into objects "
            "first."
        ),
        Figure(lambda: plot_gain_bounds(bounds), "Bounds of K over D."),
    ]


GAIN_BOUNDS = Part[SpringBounds](
    "gain_bounds",
    "Bounds of stiffness and damping",
    _bounds,
    _show_bounds,
    criteria=(
        Criterion(
            "sum of all springs, share of the stable limit", "", "below", 1.0,
            "target and contact together are soft enough, even if positions are one "
            "tick late",
            "target and contact together are too stiff if positions are one tick late",
            "stability, with the damping of the target alone",
            lambda data: data.share,
        ),
        Criterion(
            "contacts that may act at once", "", "at least", float(OBJECT_SLOTS),
            "the dampers of all objects that it sees may act at once",
            "the dampers of several objects at once reverse the velocity at each tick",
            "D + n D_e < 2 M/T, with as many objects as the sensor can report",
            lambda data: data.bounds.contacts,
        ),
    ),
    document=lambda data: {
        **vars(data.bounds),
        "mass": data.bounds.mass._asdict(),
        "total_stiffness_n_m": data.total_stiffness_n_m,
    },
)  # fmt: skip
