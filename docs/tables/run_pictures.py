"""Pictures of runs in the pages, but for those of the gallery.

``python -m docs.tables.run_pictures [NAME ...]`` draws them anew, in some three
minutes. Which layouts of the guarded law are worst, typical and best, ``phonotaxis
compare two_moving_obstacles --laws guarded --runs 1000 --seed 2026 --set
hearing=ideal`` tells at its end, in some ten minutes: when the law has changed, write
their numbers into ``LAYOUTS``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from analysis.comparison.plans import comparison_plan
from analysis.runs.run_plots import plot_trajectory
from diagrams import Scenario, load_scenario, simulate

__all__ = ["IMAGES", "LAYOUTS", "PICTURES"]

_DOCS = Path(__file__).resolve().parents[1]
IMAGES = _DOCS / "images"
#: Numbers of layouts of ``two_moving_obstacles``, as the comparison tells them.
LAYOUTS = {"worst": 686, "typical": 899, "best": 85}
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
    """The scenario that docs/write_a_scenario.md builds, as that page runs it."""
    text = (_DOCS / "write_a_scenario.md").read_text("utf-8")
    found = re.search(r"(?ms)^```yaml\n(.*?)^```$", text.partition("`office.yaml`:")[2])
    assert found
    with TemporaryDirectory() as folder:
        path = Path(folder, "office.yaml")
        path.write_text(found[1], "utf-8")
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


if __name__ == "__main__":
    for picture in sys.argv[1:] or PICTURES:
        result = simulate(PICTURES[picture](), engine="compiled")
        plot_trajectory(result).savefig(IMAGES / f"{picture}.png", dpi=150)
