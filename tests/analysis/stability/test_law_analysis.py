"""Parts of an analysis, and the page and the document that they make."""

from __future__ import annotations

import re
from typing import Any

import pytest

from analysis.report.criterion import Criterion
from analysis.stability.choice import chosen_laws
from analysis.stability.law_analysis import Part, analyze_law
from analysis.stability.linear_parts import OPERATING_POINTS
from analysis.stability.margin_parts import MARGINS
from analysis.stability.report_files import (
    stability_document,
    stability_page,
    stability_text,
)
from diagrams import load_scenario
from docs.building.page_code import page_file
from systems.framework.input_error import InputError

LIGHT = Criterion[float](
    "mass", "kg", "below", 4.0, "light", "heavy", "a test", lambda mass: mass
)
DENSE = Criterion[float](
    "density", "kg/l", "below", 1.0, "floats", "sinks", "a test", lambda mass: mass
)


def show(data):
    return [f"found: {data}"]


def refuse(study):
    raise InputError("law", "cannot; choose another")


MASS = Part(
    "mass",
    "Mass",
    lambda study: study.scenario.only.robot.mass_kg,
    show,
    criteria=(LIGHT,),
)
TWICE = Part("twice", "Twice", lambda study: 2.0 * study.need("mass"), show)
BUILT = Part("built", "Built", lambda study: study.need("refused"), show)
REFUSED = Part("refused", "Refused", refuse, show, criteria=(DENSE,))
SPREAD = Part(
    "spread", "Spread", lambda study: 1.5, show, document=lambda x: {"a": x, "b": 2}
)


def test_parts_run_in_order_and_see_what_was_found():
    titles: list[str] = []
    analysis = analyze_law(
        load_scenario(), [MASS, REFUSED, TWICE, BUILT], step=titles.append
    )
    assert titles == ["Mass", "Refused", "Twice", "Built"]
    assert analysis.found == {"mass": 3.94, "twice": 2.0 * 3.94}
    problems = [section.data for section in analysis.sections]
    assert problems[1] == {"problem": "law: cannot; choose another"}
    assert problems[3]["problem"].startswith("refused: has no result")


def test_nothing_stands_without_the_first_part():
    with pytest.raises(ValueError, match="law: cannot"):
        analyze_law(load_scenario(), [REFUSED, MASS])


def test_laws_are_chosen_once_each():
    base = load_scenario("default", ["law=none", "seed=3"])
    assert [s.only.law for s in chosen_laws(base, [])] == ["none"]
    chosen = chosen_laws(base, ["active", "all"])
    assert [s.only.law for s in chosen] == [
        "active",
        "conventional",
        "conventional2017",
        "active2017",
    ]
    assert {s.seed for s in chosen} == {3}
    with pytest.raises(InputError, match="law: 'magic'"):
        chosen_laws(base, ["magic"])


def test_document_of_one_law_has_its_parts_at_the_top():
    analysis = analyze_law(load_scenario(), [MASS, REFUSED, SPREAD])
    document = stability_document([analysis])
    assert document["law"] == "active"
    assert document["mass"] == 3.94
    assert document["refused"] == {"problem": "law: cannot; choose another"}
    assert document["spread"] == {"a": 1.5, "b": 2}
    light, dense = document["verdicts"]
    assert (light["value"], light["verdict"]) == (3.94, "pass")
    assert (dense["value"], dense["verdict"]) == (None, "not applicable")
    assert dense["text"] == "the part 'Refused' has no result"
    assert document["model"]["seed"] == 1
    header, *rows = stability_text([analysis]).splitlines()
    assert header.split() == ["threshold", "active"]
    assert [row.split() for row in rows] == [
        ["mass", "<", "4", "kg", "3.94", "pass"],
        ["density", "<", "1", "kg/l", "\u2013", "n/a"],
    ]


def test_page_of_several_laws():
    parts = [MASS, REFUSED]
    analyses = [
        analyze_law(each, parts)
        for each in chosen_laws(load_scenario(), ["conventional", "active"])
    ]
    page = stability_page(analyses)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)
    assert page.count("Not computed: law: cannot; choose another.") == 2
    assert page.count("<p>found: 3.94</p>") == 2
    assert "All: light." not in page
    assert "conventional and active: light." in page
    assert not re.findall(r'(?:src|href)="(?!#|data:)', page)


def test_a_section_is_added_as_docs_extending_says():
    """Its numbers are those of the section "Margins"."""
    names: dict[str, Any] = {}
    exec(compile(page_file("extending.md", "nichols.py"), "nichols.py", "exec"), names)
    parts = [OPERATING_POINTS, MARGINS, names["NICHOLS"]]
    analysis = analyze_law(load_scenario("obstacle_free", ["law=none"]), parts)
    document = stability_document([analysis])
    loops = document["margins"]["implemented_loop"]["margins"]
    assert document["nichols"]["L at the sensor, along"] == pytest.approx(
        loops["sensor_along"]["crossover_rad_s"]
    )
    assert len(document["nichols"]) == len(loops)
    page = stability_page([analysis])
    shown = page[page.index('<h3 id="law0-nichols">') :]
    shown = shown[: shown.index("</section>")]
    assert shown.count("<figure>") == shown.count("<table>") == 1
    assert "crossover (rad/s)" in shown


def test_a_body_that_moves_is_named_before_the_numbers() -> None:
    """Everything in the report is about bodies at rest; a run is not."""
    (note,) = analyze_law(load_scenario("one_moving_obstacle"), []).notes
    assert note.startswith("obstacle 1 can move; this whole report is about bodies at")
    assert "obstacle 1 at (2.6, 2.4) m" in note
    assert analyze_law(load_scenario("default"), []).notes == []
