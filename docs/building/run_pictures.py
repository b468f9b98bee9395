"""Pictures of runs and comparisons in the pages, except for those of the gallery.

``python -m docs.building.run_pictures [NAME ...]`` draws them anew, in about three
minutes. If the guarded law has changed, run ``phonotaxis compare two_moving_obstacles
--laws guarded --runs 150 --seed 2026 --set hearing=ideal``. It prints which layouts are
the worst, a typical one and the best. Write their numbers into ``LAYOUTS``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from analysis.batches.comparison_plans import comparison_plan
from analysis.views.block_diagram import block_svg
from analysis.views.picture import plot_trajectory
from diagrams import Scenario, build_sound_follower, load_scenario, simulate
from docs.building.law_rates import plot_law_rates
from docs.building.page_code import page_file
from phonotaxis import main

_DOCS = Path(__file__).resolve().parents[1]
IMAGES = _DOCS / "images"
#: The moving picture of README.
FILM = "default_run"
#: The picture of the rates of the papers' laws, which ``docs/results`` has.
RATES = "laws"
#: Numbers of layouts of ``two_moving_obstacles``, as the comparison prints them.
LAYOUTS = {"worst": 39, "typical": 33, "best": 54}
_SEED = 2026


def _layout(number: int) -> Scenario:
    """One of the comparison's layouts: it does not depend on how many there are."""
    plan = comparison_plan(
        "two_moving_obstacles",
        laws=["guarded"],
        runs=number + 1,
        seed=_SEED,
        settings={"hearing": "ideal"},
    )
    return plan.scenario_of(plan.points()[number])


def _office() -> Scenario:
    """The scenario that docs/your_scenario.md builds, as that page runs it."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "office.yaml")
        path.write_text(page_file("your_scenario.md", "office.yaml"), "utf-8")
        return load_scenario(path, {"law": "guarded"})


def _named(name: str, **overrides: Any) -> Callable[[], Scenario]:
    return partial(load_scenario, name, overrides)


#: Scenarios of the pictures, by their names.
PICTURES: Mapping[str, Callable[[], Scenario]] = {
    "trajectory": _named("default"),
    "convoy": _named("convoy"),
    "robots_4": _named("robots_4"),
    "odor_then_sound": _named("odor_then_sound"),
    "office": _office,
    "guarded_run": _named("clutter", law="guarded", hearing="ideal"),
    **{f"guarded_{kind}": partial(_layout, n) for kind, n in LAYOUTS.items()},
}


#: Scenarios of the block diagrams.
DIAGRAMS: Mapping[str, Scenario] = {
    "diagram": load_scenario("default"),
    "diagram_guard": load_scenario("default", {"guard": {}}),
    "diagram_route": load_scenario("unknown_block"),
}


def draw(name: str) -> None:
    """Draws one picture: of a run, of a diagram, of rates, or README's film."""
    if name in DIAGRAMS:
        diagram = build_sound_follower(DIAGRAMS[name]).diagram
        (IMAGES / f"{name}.svg").write_text(block_svg(diagram), "utf-8")
    elif name == RATES:
        plot_law_rates().savefig(IMAGES / f"{name}.png", dpi=150)
    elif name == FILM:
        (IMAGES / f"{name}.gif").unlink(missing_ok=True)
        with TemporaryDirectory() as folder:
            words = f"simulate --set duration_s=16 --no-plots --out {folder}/run"
            main([*words.split(), "--movie", str(IMAGES / f"{name}.gif")])
    else:
        result = simulate(PICTURES[name](), engine="compiled")
        plot_trajectory(result).savefig(IMAGES / f"{name}.png", dpi=150)


if __name__ == "__main__":
    for picture in sys.argv[1:] or [*PICTURES, *DIAGRAMS, RATES, FILM]:
        draw(picture)
