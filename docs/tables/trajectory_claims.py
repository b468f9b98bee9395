"""What the claims of Engelbrecht 2021 are judged by, as tables.

``python -m docs.tables.trajectory_claims [RUNS]`` prints the tables of
docs/trajectory.md, "Claims"; RUNS layouts of each scenario, 300 unless told.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.comparison import library_layouts
from analysis.comparison.paired_statistics import paired_median, paired_rate
from analysis.reporting.intervals import (
    median_interval,
    wilson_interval,
    with_interval,
)
from analysis.reporting.markdown import markdown_table
from analysis.runs.metrics import run_metrics
from analysis.sweeps.plan import load_sweep
from diagrams import Scenario, simulate
from systems.framework.input_error import InputError

__all__ = ["BLIND", "VARIANTS", "Ran", "blind_table", "pairs_table", "run_layouts"]

_CONVENTIONAL, _ADAPTIVE = "trajectory_conventional", "trajectory_adaptive"


def _gains(law: str, **fields: Any) -> dict[str, Any]:
    return {"law": law, "repulsion": {law: fields}}


#: Settings by what the tables call them.
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "signs of eq. 10": _gains(_CONVENTIONAL, reading="printed_state"),
    "signs of eq. 4, 5": _gains(_CONVENTIONAL, reading="printed_force"),
    "conventional": {"law": _CONVENTIONAL},
    "conventional, damping fades": _gains(_CONVENTIONAL, damping_fades=True),
    "adaptive, eq. 40 to 42": {"law": _ADAPTIVE},
    "adaptive, gradient": _gains(
        _ADAPTIVE, damping_fades=True, adaptation={"rule": "sensitivity"}
    ),
    "conventional, $K_e$ = 12": _gains(
        _CONVENTIONAL, damping_fades=True, contact_stiffness_n_m=12.0
    ),
    "filtered": {"law": "trajectory_filtered"},
}
#: What adapts without bounds has become infinite, and stopped the run.
RAN_AWAY = "ran away"
#: One of two robots sees nothing.
BLIND = {"robots.second.objects.maximum_range_m": 0.001}


@dataclass(frozen=True)
class Ran:
    """What a run of a layout did."""

    cause: str
    robots: tuple[Mapping[str, float | None], ...]
    """Metrics of each."""

    @property
    def collided(self) -> bool:
        """Whether any robot was touched."""
        return self.cause == "collision"

    def figure(self, name: str, pick: Callable[[Sequence[float]], float]) -> float:
        """One of all robots; NaN where none has it."""
        values = [float(v) for own in self.robots if (v := own.get(name)) is not None]
        return float(pick(values)) if values else float("nan")


def run_layouts(
    scenario: str, settings: Mapping[str, Any], runs: int, seed: int = 2026
) -> list[Ran]:
    """Runs a scenario's random layouts, compiled.

    Args:
        scenario: Name in the library.
        settings: Fields that differ.
        runs: Layouts.
        seed: Of all of them.

    Returns:
        In the order of the layouts, which are the same for all settings.
    """
    plan = load_sweep(library_layouts()[scenario])
    fields = {"set": {**plan.set, **settings}, "runs": runs, "seed": seed}
    plan = plan.model_copy(update=fields)
    return [_ran(plan.scenario_of(point)) for point in plan.points()]


def _ran(scenario: Scenario) -> Ran:
    try:
        result = simulate(scenario, engine="compiled")
    except InputError as error:
        if error.field != "engine":
            raise
        return Ran(RAN_AWAY, ())
    each = result.several.values() or (result,)
    return Ran(result.cause, tuple(run_metrics(own) for own in each))


def _rate(hits: int, runs: int) -> str:
    interval = wilson_interval(hits, runs)
    return with_interval(hits / runs, interval.low, interval.high, ".1f", factor=100.0)


def _median(values: Sequence[float], form: str) -> str:
    kept = np.asarray(values)[np.isfinite(values)]
    if not len(kept):
        return "-"
    ends = median_interval(kept)
    # Adding zero makes -0 into 0.
    median, low, high = (
        round(float(value), int(form[1])) + 0.0
        for value in (np.median(kept), ends.low, ends.high)
    )
    return with_interval(median, low, high, form)


def claims_table(scenario: str, runs: int) -> tuple[str, dict[str, list[Ran]]]:
    """All variants on one scenario's layouts, in Markdown.

    Args:
        scenario: Name in the library.
        runs: Layouts.

    Returns:
        The table, and the runs by variant.
    """
    found = {name: run_layouts(scenario, own, runs) for name, own in VARIANTS.items()}
    rows = [
        [
            name,
            _rate(sum(ran.collided for ran in rans), runs),
            f"{100.0 * sum(ran.cause == 'reached' for ran in rans) / runs:.1f}",
            f"{100.0 * sum(ran.cause == RAN_AWAY for ran in rans) / runs:.1f}",
            _median(
                [r.figure("minimum_obstacle_clearance_m", min) for r in rans], ".2f"
            ),
            _median([r.figure("route_deviation_max_m", max) for r in rans], ".2f"),
            _median([r.figure("yaw_ripple_rad_s", np.mean) for r in rans], ".3f"),
        ]
        for name, rans in found.items()
    ]
    headings = (
        f"`{scenario}`",
        "collisions, %",
        "goals, %",
        "ran away, %",
        "clearance, m",
        "off the way, m",
        "ripple, rad/s",
    )
    return markdown_table(headings, rows), found


def pairs_table(found: Mapping[str, Mapping[str, list[Ran]]]) -> str:
    """Variants in pairs on the same layouts, in Markdown.

    Args:
        found: Runs by variant, by scenario.

    Returns:
        A row a pair and scenario: collisions of one of both alone with the p of
        McNemar's test, and the ripple of the first less that of the second.
    """
    pairs = (
        ("adaptive, eq. 40 to 42", "conventional"),
        ("adaptive, gradient", "conventional, damping fades"),
        ("signs of eq. 4, 5", "conventional"),
        ("signs of eq. 4, 5", "adaptive, eq. 40 to 42"),
        ("filtered", "conventional"),
    )
    rows = []
    for first, second in pairs:
        for scenario, by_variant in found.items():
            one, other = by_variant[first], by_variant[second]
            hits = paired_rate([r.collided for r in one], [r.collided for r in other])
            ripple = paired_median(
                [r.figure("yaw_ripple_rad_s", np.mean) for r in one],
                [r.figure("yaw_ripple_rad_s", np.mean) for r in other],
            )
            change = "-"
            if ripple.difference is not None:
                assert ripple.low is not None
                assert ripple.high is not None
                change = with_interval(
                    ripple.difference, ripple.low, ripple.high, "+.4f"
                )
            rows.append(
                [
                    f"{first} / {second}",
                    f"`{scenario}`",
                    f"{hits.only_first} / {hits.only_second}",
                    f"{hits.p_value:.1g}",
                    change,
                ]
            )
    headings = (
        "pair",
        "layouts",
        "collided alone",
        "p",
        "ripple, first less second, rad/s",
    )
    return markdown_table(headings, rows)


def blind_table(runs: int) -> str:
    """Whether a partner that reacts makes it easier, in Markdown.

    Args:
        runs: Layouts of each scenario.

    Returns:
        A row a scenario: collisions where both see and where one does not.
    """
    rows = []
    for scenario in ("robots_2", "head_on"):
        for name in ("conventional", "filtered"):
            seeing = run_layouts(scenario, VARIANTS[name], runs)
            blind = run_layouts(scenario, {**VARIANTS[name], **BLIND}, runs)
            both = [r.collided for r in seeing], [r.collided for r in blind]
            own = [
                [ran.robots[0]["minimum_obstacle_clearance_m"] for ran in rans]
                for rans in (seeing, blind)
            ]
            rows.append(
                [
                    f"`{scenario}`, {name}",
                    *(_rate(sum(hits), runs) for hits in both),
                    f"{paired_rate(*both).p_value:.1g}",
                    *(_median([v or 0.0 for v in each], ".2f") for each in own),
                ]
            )
    headings = (
        "layouts, law",
        "collisions, both see, %",
        "one is blind, %",
        "p",
        "clearance, both see, m",
        "one is blind, m",
    )
    return markdown_table(headings, rows)


def main(runs: int) -> None:
    """Prints the tables."""
    found = {}
    for scenario in ("unknown_block", "crossing_obstacle", "robots_4", "mapped_room"):
        text, found[scenario] = claims_table(scenario, runs)
        sys.stdout.write(f"{text}\n\n")
    sys.stdout.write(f"{pairs_table(found)}\n\n{blind_table(runs)}\n")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
