"""Changes the plan of a sweep by what a user has given on the command line."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import ValidationError

from analysis.batches.plan import SweepPlan
from diagrams.scenario.fields.explain import explain
from diagrams.scenario.laws_of_kind import chosen_names
from diagrams.scenario.scenario import scenario_from_mapping
from diagrams.scenario.settings import parse_setting

#: Field whose values may be given as one text with commas.
VELOCITY_TERM = "collision_vector.velocity_term"


def split_settings(
    texts: Iterable[str],
) -> tuple[dict[str, Any], dict[str, list[str]]]:
    """Reads texts ``key=value`` as fields of all runs and fields to compare.

    Args:
        texts: Settings. Several velocity terms, separated by commas, are compared.

    Returns:
        Values by dotted path, and lists of values by dotted path.

    Raises:
        InputError: A text has another form.
    """
    fields = dict(map(parse_setting, texts))
    term = fields.get(VELOCITY_TERM)
    if isinstance(term, str) and "," in term:
        del fields[VELOCITY_TERM]
        return fields, {VELOCITY_TERM: [each.strip() for each in term.split(",")]}
    return fields, {}


def changed_plan(
    plan: SweepPlan,
    *,
    laws: Iterable[str] = (),
    runs: int | None = None,
    seed: int | None = None,
    settings: Iterable[str] = (),
) -> SweepPlan:
    """Returns a plan with other laws, runs, seed and fields.

    Args:
        plan: The plan, for example from ``load_sweep``.
        laws: Names of the laws, also with commas; they replace those of the plan.
            ``all`` means every law for robots of this kind.
        runs: Number of runs in each cell; None leaves that of the plan.
        seed: Seed of all draws; None leaves that of the plan.
        settings: Texts of the form ``key=value``. They replace values of ``set``.

    Returns:
        The changed plan.

    Raises:
        InputError: A value is not valid, or a setting contradicts the grid or a draw.
    """
    fields, compared = split_settings(settings)
    grid = plan.grid | {key: tuple(values) for key, values in compared.items()}
    fields = plan.set | fields
    if names := chosen_names(laws, scenario_from_mapping(plan.base)):
        fields.pop("law", None)
        grid["law"] = tuple(names)
    changed: dict[str, Any] = {"set": fields, "grid": grid}
    changed |= {} if runs is None else {"runs": runs}
    changed |= {} if seed is None else {"seed": seed}
    return with_fields(plan, changed, "a sweep")


def with_fields(plan: SweepPlan, changed: dict[str, Any], what: str) -> SweepPlan:
    """Returns a plan with changed fields, which are checked.

    Args:
        plan: The plan.
        changed: New values by field of the plan.
        what: Name of the plan in messages, for example 'a comparison'.

    Returns:
        The changed plan.

    Raises:
        InputError: A value is not valid.
    """
    fields = {name: getattr(plan, name) for name in SweepPlan.model_fields}
    try:
        return SweepPlan.model_validate(fields | changed)
    except ValidationError as error:
        raise explain(error, SweepPlan.model_json_schema(), what) from None
