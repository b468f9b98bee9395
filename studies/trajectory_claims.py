"""What the claims of Engelbrecht 2021 are judged by.

``python -m studies trajectory_claims`` prints the tables of docs/results_routes.md,
"Claims"; ``--help`` lists the options that print parts of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.batches.comparison_plans import library_layouts
from analysis.batches.pairs import paired_median, paired_rate
from analysis.batches.plan import load_sweep
from analysis.report.intervals import (
    estimate_median,
    estimate_rate,
)
from analysis.runs.metric_table import run_metrics
from diagrams import Scenario, simulate
from studies.tables import Table
from systems.framework.input_error import InputError

_CONVENTIONAL, _ADAPTIVE = "trajectory_conventional", "trajectory_adaptive"


def _gains(law: str, **fields: Any) -> dict[str, Any]:
    return {"law": law, "laws": {law: fields}}


def _gradient(
    penalty: float, contact_rate: float = 0.0, *, boxes: bool = True
) -> dict[str, Any]:
    """The gradient with the safety term of eq. 27; its d_sec is S of table 1."""
    return _gains(
        _ADAPTIVE,
        rule="sensitivity",
        penalty=penalty,
        contact_rate=contact_rate,
        projected=boxes,
    )


def _changed(block: str, **fields: Any) -> dict[str, Any]:
    """The conventional law, whose block ``printed_impedance`` replaces."""
    blocks = [f"studies.support.printed_impedance:{block}"]
    return {"law": _CONVENTIONAL, "impedance": fields, "blocks": blocks}


#: Settings by what the tables call them. Each that adapts names lambda, the weight of
#: the safety term.
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "signs of eq. 10": _changed("SignsOfEq10"),
    "signs of eq. 4, 5": _changed("SignsOfEq4And5"),
    "conventional": {"law": _CONVENTIONAL},
    "conventional, damping fades": _changed("FadingDamping"),
    r"eq. 40 to 42, $\lambda$ = 0": {"law": _ADAPTIVE},
    r"gradient, $\lambda$ = 0, no boxes": _gradient(0.0, boxes=False),
    r"gradient, $\lambda$ = 0": _gradient(0.0),
    r"gradient, $\lambda$ = 0, $K_e$ adapts": _gradient(0.0, 10.0),
    r"gradient, $\lambda$ = 3": _gradient(3.0),
    r"gradient, $\lambda$ = 3, $K_e$ adapts": _gradient(3.0, 10.0),
    r"gradient, $\lambda$ = 3, $K_e$ adapts, no boxes": _gradient(
        3.0, 10.0, boxes=False
    ),
    r"gradient, $\lambda$ = 10": _gradient(10.0),
    r"gradient, $\lambda$ = 10, $K_e$ adapts": _gradient(10.0, 10.0),
    r"gradient, $\lambda$ = 10, $K_e$ adapts, no boxes": _gradient(
        10.0, 10.0, boxes=False
    ),
    "conventional, $K_e$ = 12": _changed("FadingDamping", contact_stiffness_n_m=12.0),
    "filtered": {"law": "trajectory_filtered"},
}
#: Pairs of them that are compared layout by layout.
PAIRS = (
    (r"eq. 40 to 42, $\lambda$ = 0", "conventional"),
    (r"gradient, $\lambda$ = 0", "conventional, damping fades"),
    (r"gradient, $\lambda$ = 3, $K_e$ adapts", "conventional, damping fades"),
    (r"gradient, $\lambda$ = 10, $K_e$ adapts", "conventional, damping fades"),
    ("signs of eq. 4, 5", "conventional"),
    ("signs of eq. 4, 5", r"eq. 40 to 42, $\lambda$ = 0"),
    ("filtered", "conventional"),
)
#: How eq. 6 is set: L_block, m, and whether a robot that stalls plans anew.
BLOCKS: Mapping[str, tuple[float | None, bool]] = {
    "off": (None, True),
    "0.20 m, the route stays": (0.2, False),
    "0.30 m, the route stays": (0.3, False),
    "0.20 m, replanned": (0.2, True),
}
#: Of the layouts.
SEED = 2026
SCENARIOS = ("unknown_block", "crossing_obstacle", "robots_4", "mapped_room")
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
    scenario: str, settings: Mapping[str, Any], runs: int, seed: int = SEED
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
    return estimate_rate(hits, runs).text(".1f", factor=100.0)


def _median(values: Sequence[float], form: str) -> str:
    kept = np.asarray(values)[np.isfinite(values)]
    return estimate_median(kept).text(form)


def claims_table(scenario: str, found: Mapping[str, Sequence[Ran]]) -> Table:
    """Variants on one scenario's layouts.

    Args:
        scenario: Name in the library.
        found: Its runs by variant.

    Returns:
        A row a variant.
    """
    rows = [
        [
            name,
            _rate(sum(ran.collided for ran in rans), len(rans)),
            f"{100.0 * sum(ran.cause == 'reached' for ran in rans) / len(rans):.1f}",
            f"{100.0 * sum(ran.cause == RAN_AWAY for ran in rans) / len(rans):.1f}",
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
        "off the path, m",
        "ripple, rad/s",
    )
    return Table(scenario, headings, rows)


def pairs_table(found: Mapping[str, Mapping[str, list[Ran]]]) -> Table:
    """Variants in pairs on the same layouts.

    Args:
        found: Runs by variant, by scenario.

    Returns:
        A row a pair and scenario: collisions of one of both alone with the p of
        McNemar's test, and the ripple of the first less that of the second.
    """
    rows = []
    for first, second in PAIRS:
        for scenario, by_variant in found.items():
            if first not in by_variant or second not in by_variant:
                continue
            one, other = by_variant[first], by_variant[second]
            hits = paired_rate([r.collided for r in one], [r.collided for r in other])
            ripple = paired_median(
                [r.figure("yaw_ripple_rad_s", np.mean) for r in one],
                [r.figure("yaw_ripple_rad_s", np.mean) for r in other],
            )
            change = "-" if ripple is None else ripple.difference.text("+.4f")
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
    return Table("pairs", headings, rows)


def blind_table(runs: int) -> Table:
    """Whether a partner that reacts makes it easier.

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
    return Table("blind", headings, rows)


def block_settings(law: str, name: str) -> dict[str, Any]:
    """Fields of a law with eq. 6 as one of ``BLOCKS`` sets it."""
    block_m, replans = BLOCKS[name]
    return {
        "law": law,
        "impedance": {"block_distance_m": block_m},
        "route.replan": replans,
    }


def block_table(runs: int, scenarios: Sequence[str] = SCENARIOS[:2]) -> Table:
    """What eq. 6 changes.

    Args:
        runs: Layouts of each scenario.
        scenarios: Names in the library.

    Returns:
        A row a scenario and law: collisions, then goals reached, by ``BLOCKS``.
    """
    rows = []
    for scenario in scenarios:
        for law in (_CONVENTIONAL, _ADAPTIVE):
            cells = []
            for name in BLOCKS:
                rans = run_layouts(scenario, block_settings(law, name), runs)
                goals = sum(ran.cause == "reached" for ran in rans) / runs
                hits = _rate(sum(ran.collided for ran in rans), runs)
                cells.append(f"{hits}; {100.0 * goals:.1f} %")
            rows.append([f"`{scenario}`, `{law}`", *cells])
    return Table("block", ("layouts, law", *BLOCKS), rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--runs", type=int, default=300, help="layouts per scenario")
    parser.add_argument("--only", default="", help="variants whose name has this in it")
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS)
    parser.add_argument(
        "--table", choices=("claims", "block", "blind"), help="this one instead of all"
    )


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The tables that are asked for."""
    if options.table in ("claims", None):
        found = {}
        for scenario in options.scenarios:
            found[scenario] = {
                name: run_layouts(scenario, own, options.runs)
                for name, own in VARIANTS.items()
                if options.only in name
            }
            yield claims_table(scenario, found[scenario])
        yield pairs_table(found)
    if options.table in ("block", None):
        yield block_table(options.runs)
    if options.table in ("blind", None):
        yield blind_table(options.runs)
