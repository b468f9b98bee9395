"""From words of the command line to the plans of a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from analysis.comparison.compare import EXPERIMENTS, comparison_plan
from analysis.sweeps.plan import SweepPlan
from diagrams.loading import parse_setting
from systems.framework.input_error import InputError
from systems.laws.catalogue import LAWS

__all__ = ["comparison_plans"]

VELOCITY_TERM = "repulsion.velocity_term"


def comparison_plans(
    scenarios: Sequence[str] = (),
    *,
    laws: str | None = None,
    velocity_terms: str | None = None,
    runs: int = 50,
    seed: str | None = None,
    settings: Iterable[str] = (),
    grid: Iterable[str] = (),
) -> dict[str, SweepPlan]:
    """A plan for each scenario, by its name.

    Args:
        scenarios: See ``comparison_plan``; none: the papers' experiments.
        laws: Names parted by commas; none: all that come with the package.
        velocity_terms: ``printed``, ``closing``, or both parted by a comma.
        runs: Layouts a scenario.
        seed: A whole number.
        settings: ``key=value``.
        grid: ``key=[value, ...]``.

    Returns:
        In the order of ``scenarios``; names without folder and ending.

    Raises:
        InputError: A word is no good; names the option or the field.
    """
    fields = dict(parse_setting(text) for text in settings)
    varied = dict(_values(text) for text in grid)
    if velocity_terms is not None:
        terms = velocity_terms.split(",")
        if len(terms) == 1:
            fields[VELOCITY_TERM] = terms[0]
        else:
            varied[VELOCITY_TERM] = terms
    plans: dict[str, SweepPlan] = {}
    for scenario in scenarios or EXPERIMENTS:
        name = Path(scenario).stem
        if name in plans:
            raise InputError("scenario", f"{name} stands there twice; drop one")
        plans[name] = comparison_plan(
            scenario,
            laws=laws.split(",") if laws is not None else LAWS,
            runs=runs,
            seed=_seed(seed),
            settings=fields,
            grid=varied,
        )
    return plans


def _values(text: str) -> tuple[str, list[Any]]:
    key, values = parse_setting(text)
    if not isinstance(values, list):
        raise InputError(key, f"{values!r} is no list of values; write [a, b]")
    return key, values


def _seed(text: str | None) -> int:
    if text is None:
        return 1
    if not text.isdigit():
        raise InputError("seed", f"{text!r} is not a whole number; give 0 or more")
    return int(text)
