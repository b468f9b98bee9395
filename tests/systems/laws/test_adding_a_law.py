"""docs/your_law.md is true: a law is its own file, a place in the list, and a schema.

A tree of links to ours, in which the page's law is added, answers for every list.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from docs.building.page_code import page_file

ROOT = Path(__file__).resolve().parents[3]

#: Asks each part of the program for its list, with the law in it.
QUESTIONS = """
import contextlib, io, json

import phonotaxis
from analysis.batches.comparison_plans import comparison_plans
from analysis.stability.gain_search import search_gains
from analysis.stability.requirements import Requirements, check_law
from analysis.loops.law_curves import law_curves, plot_law_curves
from analysis.loops.push_and_pull import DESIGNED_LAWS
from analysis.loops.radial_law import radial_law
from studies.linear.root_locus import root_loci
from analysis.stability.choice import chosen_laws
from analysis.stability.law_analysis import analyze_law
from analysis.stability.model_sheet import model_sheet
from analysis.stability.report_files import stability_page
from diagrams import build_sound_follower, load_scenario
from diagrams.scenario.fields.shipped import SCHEMA_FILE
from tools.scenario_schema import make_schema, schema_file_text

# As tools.schemas does.
SCHEMA_FILE.write_text(schema_file_text(make_schema()), "utf-8")


def printed(*words):
    with contextlib.redirect_stdout(io.StringIO()) as text:
        phonotaxis.main(words)
    return json.loads(text.getvalue())


settings = ["law=gaussian", "laws.gaussian.width_m=0.4"]
scenario = load_scenario("default", [*settings, "hearing=ideal"])
sheet = model_sheet(scenario)
curves = law_curves(scenario, DESIGNED_LAWS)
lines = plot_law_curves(curves).axes[0].lines
default = load_scenario("default")
designed = search_gains(default, Requirements().within_goal(default))
tuned = scenario.with_robot(laws=designed)
checks = check_law(tuned, "gaussian", Requirements())
print(json.dumps({
    "listed": printed("laws", "--json")["laws"],
    "unknown": printed("simulate", "--law", "magic", "--json")["error"]["message"],
    "block": build_sound_follower(scenario).blocks["controller"].get_name(),
    "force": radial_law(scenario).force(0.4, 0.5),
    "equations": [each.text for each in sheet.law_equations],
    "parameters": [row.field for row in sheet.parameters if row.of_law],
    "heading": stability_page([analyze_law(scenario, [])]),
    "all": [each.only.law for each in chosen_laws(scenario, ["all"])],
    "loci": [locus.parameter for locus in root_loci(scenario)],
    "lines": {line.get_label(): line.get_color() for line in lines},
    "compared": {name: plan.grid["law"] for name, plan in comparison_plans().items()},
    "strength": designed.gaussian.strength_n,
    "barrier": checks.check("barrier").ratio,
}))
"""


def add_law(tree: Path) -> None:
    """Ours by links, but for the room of the laws: that is a copy with one more."""
    tree.mkdir()
    for name in ("analysis", "phonotaxis", "studies", "tools"):
        (tree / name).symlink_to(ROOT / name)
    own = {"laws", "__pycache__", "scenario.schema.json"}
    for package in ("systems", "diagrams"):
        (tree / package).mkdir()
        for part in (ROOT / package).iterdir():
            if part.name not in own:
                (tree / package / part.name).symlink_to(part)
    laws = tree / "systems/laws"
    shutil.copytree(
        ROOT / "systems/laws", laws, ignore=shutil.ignore_patterns("__pycache__")
    )
    code = page_file("your_law.md", "gaussian.py")
    (laws / "gaussian.py").write_text(code, "utf-8")
    listed = (laws / "catalog.py").read_text("utf-8")
    for before, added in (
        (
            "from systems.laws.guarded import GUARDED\n",
            "from systems.laws.gaussian import GAUSSIAN\n{}",
        ),
        ("        ACTIVE_2017,\n", "{}        GAUSSIAN,\n"),
    ):
        assert listed.count(before) == 1
        listed = listed.replace(before, added.format(before))
    (laws / "catalog.py").write_text(listed, "utf-8")
    (tree / "questions.py").write_text(QUESTIONS, "utf-8")


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Any:
    tree = tmp_path_factory.mktemp("adding") / "tree"
    add_law(tree)
    run = subprocess.run(
        [sys.executable, "questions.py"],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


OURS = ["conventional", "active", "conventional2017", "active2017"]
BASELINES = ["stop_when_near", "dwa", "vfh_plus", "mppi", "orca"]
ON_ROUTES = [f"trajectory_{how}" for how in ("conventional", "adaptive", "filtered")]
SEARCHES = ["plume_search", "sound_search"]


def test_commands_name_it(answers):
    names = ["none", *OURS, "gaussian", "guarded", *BASELINES, *ON_ROUTES, *SEARCHES]
    assert [law["name"] for law in answers["listed"]] == names
    assert answers["listed"][len(OURS) + 1]["title"] == "Gaussian law"
    assert ", ".join(names) in answers["unknown"]


def test_it_runs_in_the_general_block_with_its_own_gains(answers):
    """F_0/e at its width, and 0.5 m/s times D_0."""
    assert answers["block"] == "radial_law_controller"
    assert answers["force"] == pytest.approx(6.4 * 0.36787944117 + 0.4)


def test_model_sheet_and_report_have_it(answers):
    assert answers["equations"] == ["f = F_0 exp(-c^2/w^2) + D_0 s"]
    own = {"strength_n", "width_m", "damping_n_s_m"}
    fields = {f"laws.gaussian.{name}" for name in own}
    assert set(answers["parameters"]) == fields | {"collision_vector.velocity_term"}
    assert "Gaussian law" in answers["heading"]
    assert answers["all"] == [*OURS, "gaussian"]


def test_root_loci_vary_its_gains(answers):
    assert answers["loci"][2:] == [
        "laws.gaussian.strength_n",
        "laws.gaussian.damping_n_s_m",
    ]


def test_pictures_draw_it_in_a_color_of_its_own(answers):
    assert answers["lines"].pop("bell curve") == "#009E73"
    assert answers["lines"] == {
        "conventional": "#D55E00",
        "active 2019": "#0072B2",
        "conventional 2017": "#7A5200",
        "active 2017": "#A8498A",
    }


def test_comparisons_count_it_in(answers):
    assert answers["compared"]
    for laws in answers["compared"].values():
        assert laws == ["none", *OURS, "gaussian"]


def test_design_finds_its_gain(answers):
    """Three figures, rounded up."""
    assert answers["strength"] != 6.4
    assert 1.0 <= answers["barrier"] < 1.02
