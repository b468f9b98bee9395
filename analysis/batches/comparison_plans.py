"""Plans of comparisons: which laws and other fields to compare on which layouts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import diagrams
from analysis.batches.changed_plan import split_settings, with_fields
from analysis.batches.plan import SweepPlan, load_sweep
from diagrams.scenario.laws_of_kind import chosen_names, is_routed
from diagrams.scenario.loading import load_scenario, read_mapping
from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from diagrams.scenario.settings import parse_setting
from diagrams.scenario.suggestions import Laws
from systems.framework.input_error import InputError
from systems.laws.catalog import FORCE_LAWS, ROUTE_LAWS

#: Names of the scenarios of the papers' experiments.
EXPERIMENTS = (
    "obstacle_free",
    "two_static_obstacles",
    "one_moving_obstacle",
    "two_moving_obstacles",
)
#: Scenario and laws of a comparison in worlds that names none.
WORLD_SCENARIO, WORLD_LAWS = "barn", ("guarded", "dwa")
_LIBRARY = Path(diagrams.__file__).parent / "layouts"
#: Fields of a sweep file that a comparison sets itself. A file of layouts, which is a
#: sweep file otherwise, must not contain them.
_OURS = ("grid", "runs", "pair")


def library_layouts() -> dict[str, Path]:
    """Returns the files of layouts that come with the package, by name."""
    return {path.stem: path for path in sorted(_LIBRARY.glob("*.yaml"))}


def comparison_plan(
    scenario: str,
    *,
    laws: Laws | None = None,
    runs: int | None = None,
    seed: int = 1,
    settings: dict[str, Any] | None = None,
    grid: Mapping[str, Sequence[Any]] | None = None,
    worlds: Sequence[str] = (),
) -> SweepPlan:
    """Plans the runs that compare control laws on the layouts of one scenario.

    A layout is one variant of the positions and motions of all bodies. Every law meets
    the same layouts with the same seeds. In each run, all robots have the same law.

    Args:
        scenario: Name of layouts in the library, a YAML file of layouts, or a scenario
            (a name in the library or a YAML file). A file of layouts is a sweep file
            without ``grid``, ``runs`` and ``pair``. A scenario has a single layout, and
            its runs differ only in their random numbers.
        laws: Names of the laws, or functions and classes. ``all`` means every law for
            robots of this kind. None means the laws of the papers and driving without
            avoidance. For a scenario with routes, None means the laws for routes. In
            worlds, None means ``guarded`` and ``dwa``.
        runs: Number of layouts. In worlds, it is the number of runs in each world. None
            means 50 layouts, or one run in each world.
        seed: Seed of the layouts and of the noise.
        settings: Values of other fields, by dotted path.
        grid: Lists of values of other fields to compare, by dotted path.
        worlds: Worlds, as values for the field ``world``. Every law meets each of them.
            They replace the obstacles, the start and the goal of the scenario.

    Returns:
        Plan of a paired sweep over the laws and over ``grid``.

    Raises:
        InputError: An argument or a file is not valid.
    """
    plan = _layouts(scenario)
    base = scenario_from_mapping(plan.base)
    _require_one_law(base, plan.base)
    if laws is None:
        ours = WORLD_LAWS if worlds else FORCE_LAWS
        laws = ROUTE_LAWS if is_routed(base) else ours
    if runs is None:
        runs = 1 if worlds else 50
    for key, values in (grid or {}).items():
        if isinstance(values, str):  # it would become a list of its letters
            raise InputError(f"grid.{key}", f"is {values!r}; give a list of values")
    changed = {
        "set": plan.set | (settings or {}),
        "grid": {
            "law": tuple(chosen_names(laws, base)),
            **{k: tuple(v) for k, v in (grid or {}).items()},
        },
        "runs": runs * max(len(worlds), 1),
        "seed": seed,
        "pair": True,
    }
    if worlds:
        changed["draw"] = plan.draw | {"world": {"in_turn": tuple(worlds)}}
    return with_fields(plan, changed, "a comparison")


def _require_one_law(base: Scenario, written: Mapping[str, Any]) -> None:
    """Rejects scenarios whose robots cannot all get the same law."""
    for name, robot in base.robots.items():
        if robot.searches is not None:
            raise InputError(
                "scenario",
                f"{base.name!r} is a search by law {robot.law!r}, and no other law can "
                "replace it; sweep its fields instead, for example search.rules "
                "(docs/searches.md)",
            )
        if "law" in written.get("robots", {}).get(name, {}):
            raise InputError(
                f"robots.{name}.law",
                f"is {robot.law!r}, but a comparison sets the laws of all robots; "
                "leave it out",
            )


def comparison_plans(
    scenarios: Sequence[str] = (),
    *,
    laws: Laws | None = None,
    runs: int | None = None,
    seed: int = 1,
    settings: Iterable[str] = (),
    grid: Iterable[str] = (),
    worlds: Sequence[str] = (),
) -> dict[str, SweepPlan]:
    """Makes the plans of ``phonotaxis compare`` from its command line.

    Args:
        scenarios: Scenarios, see ``comparison_plan``. If there are none, the result has
            plans for the experiments of the papers. In worlds, it has one for ``barn``.
        laws: Names of the laws, separated by commas.
        runs: Number of layouts per scenario, see ``comparison_plan``.
        seed: Seed of the layouts and of the noise.
        settings: Texts of the form ``key=value``. Several values of
            ``collision_vector.velocity_term``, separated by commas, are compared.
        grid: Texts of the form ``key=[value, ...]``.
        worlds: See ``comparison_plan``.

    Returns:
        Plan of each scenario, by its name without folder and file ending.

    Raises:
        InputError: An argument is not valid. The error names the option or the field.
    """
    fields, compared = split_settings(settings)
    varied = dict(_listed_values(text) for text in grid) | compared
    plans: dict[str, SweepPlan] = {}
    for scenario in scenarios or ((WORLD_SCENARIO,) if worlds else EXPERIMENTS):
        name = Path(scenario).stem
        if name in plans:
            raise InputError("scenario", f"{name} is listed twice; remove one")
        plans[name] = comparison_plan(
            scenario,
            laws=laws,
            runs=runs,
            seed=seed,
            settings=fields,
            grid=varied,
            worlds=worlds,
        )
    return plans


def _layouts(scenario: str) -> SweepPlan:
    library = library_layouts()
    if scenario in library:
        return load_sweep(library[scenario])
    path = Path(scenario)
    if path.suffix in (".yaml", ".yml") and path.is_file():
        data = read_mapping(path)
        if "scenario" in data:
            for key in _OURS:
                if key in data:
                    raise InputError(
                        f"{scenario}: {key}",
                        "is set by the comparison; remove it, or use sweep",
                    )
            return load_sweep(path)
    load_scenario(scenario)
    return SweepPlan(name=path.stem, scenario=scenario)


def _listed_values(text: str) -> tuple[str, list[Any]]:
    """Splits ``key=[value, ...]`` into the key and the list of values."""
    key, values = parse_setting(text)
    if not isinstance(values, list):
        raise InputError(key, f"{values!r} is not a list of values; write [a, b]")
    return key, values
