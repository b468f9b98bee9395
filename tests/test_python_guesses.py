"""Natural guesses in Python: they work, or the message names what does."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

import phonotaxis
from phonotaxis import InputError
from systems import Block
from systems.laws.catalog import LAWS
from tests import guesses

SHORT: dict[str, Any] = {"duration_s": 0.2, "hearing": "ideal"}


def test_fields_are_keywords():
    """By keyword, by mapping and by a list of texts: one scenario, and one run."""
    ways: list[Any] = [
        phonotaxis.load_scenario("default", law="conventional", duration_s=3.0),
        phonotaxis.load_scenario("default", {"law": "conventional"}, duration_s=3.0),
        phonotaxis.load_scenario("default", ["law=conventional", "duration_s=3.0"]),
        phonotaxis.load_scenario("default").with_(law="conventional", duration_s=3.0),
        phonotaxis.load_scenario("default").with_(
            {"law": "conventional"}, duration_s=3
        ),
    ]
    assert all(way == ways[0] for way in ways)
    assert ways[0] != phonotaxis.load_scenario("default", duration_s=3.0)
    assert (ways[0].law, ways[0].source.speed_m_s) == ("conventional", 0.3)
    result = phonotaxis.simulate("default", SHORT, law="conventional")
    assert result.scenario == phonotaxis.load_scenario("default", SHORT).with_(
        law="conventional"
    )
    assert result.success
    assert result.metrics == result.document()["metrics"]


def soft(c, s, push_n=14.0, reach_m=0.45):
    return push_n * 2.0 ** (-c / reach_m)


class Still(Block):
    """A block of a user's."""

    part = "still"


def test_functions_and_classes_are_laws_and_blocks():
    """And their arguments are fields; ``tests/diagrams/scenario`` has the details."""
    own: Any = phonotaxis.load_scenario("default", law=soft, blocks=[Still])
    assert own.law == f"{__name__}:soft"
    assert own.blocks == (f"{__name__}:Still",)
    ways: list[Any] = [
        own.with_({"own_gains.push_n": 3}),
        own.with_(own_gains={"push_n": 3.0}),
        phonotaxis.Scenario(own_gains={"push_n": 3.0}),
        phonotaxis.load_scenario("default", ["own_gains.push_n=3"]),
    ]
    assert all(way.own_gains == {"push_n": 3.0} for way in ways)
    for guess in ({"own_gain.push_n": 3}, {"gains.push_n": 3}, {"soft.push_n": 3}):
        with pytest.raises(InputError, match="is not a field"):
            own.with_(guess)


def test_dotted_paths_are_keywords_too():
    scenario: Any = phonotaxis.load_scenario("default")
    faster = scenario.with_(**{"source.speed_m_s": 0.2, "obstacles.box.size_m": [1, 1]})
    assert faster.source.speed_m_s == 0.2
    assert faster.obstacles[0].size_m == (1.0, 1.0)
    assert scenario.source.speed_m_s == 0.3


def test_a_mapping_is_a_scenario():
    written = {"law": "none", "obstacles": [], "source": {"waypoints_m": [[2.0, 1.0]]}}
    scenario: Any = phonotaxis.load_scenario(written)
    assert scenario.law == "none"
    assert scenario.source.waypoints_m == ((2.0, 1.0),)


def test_assignment_names_the_copy():
    scenario: Any = phonotaxis.load_scenario("default")
    for changed, name in ((scenario, "law"), (scenario.source, "speed_m_s")):
        with pytest.raises(InputError, match=rf"{name}: .*with_\(law='active'"):
            setattr(changed, name, "active")
    with pytest.raises(AttributeError, match="lawn"):
        getattr(scenario, "law" + "n")
    with pytest.raises(InputError, match=r"lawn: did you mean 'law'"):
        scenario.with_(lawn="active")
    with pytest.raises(InputError, match="law: 'activ' is not known"):
        phonotaxis.Scenario(law="activ")


def test_copies_are_equal_after_their_caches_are_filled():
    scenario: Any = phonotaxis.load_scenario("default")
    phonotaxis.simulate(scenario.with_(SHORT))
    scenario.surroundings()
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_lists_are_tables_in_notebooks():
    laws, scenarios = phonotaxis.laws(), phonotaxis.scenarios()
    assert list(laws) == list(LAWS)
    assert laws["active"] == LAWS["active"].title
    assert set(scenarios) == set(phonotaxis.library_scenarios())
    assert repr(laws).splitlines()[0].split() == ["none", "No", "avoidance"]
    assert laws._repr_html_().count("<tr>") == len(laws)


@pytest.mark.parametrize(
    "laws", ["all", "active,conventional", ["active"], "active", soft, [soft, "active"]]
)
def test_laws_are_named_alike_everywhere(laws, monkeypatch):
    """One name, a list, a text with commas, or all: in stability and comparisons."""
    from analysis.batches.comparison_plans import comparison_plan
    from phonotaxis import loops

    found = []
    monkeypatch.setattr(
        loops, "analyze_law", lambda scenario, *_, **__: found.append(scenario.law)
    )
    phonotaxis.stability("default", laws=laws)
    plan = comparison_plan("default", laws=laws)
    assert set(found) <= set(plan.grid["law"])
    if laws == "all":
        followers = {name for name, law in LAWS.items() if law.robot == "follower"}
        assert set(plan.grid["law"]) == followers - {"none"}
    else:
        assert list(plan.grid["law"]) == found
    found.clear()
    phonotaxis.stability("default", law=laws)
    assert found


PYTHON = guesses.NOTED_PYTHON | guesses.OWN_PYTHON


@pytest.fixture(scope="module")
def result() -> phonotaxis.RunResult:
    return phonotaxis.simulate("default", SHORT, duration_s=2.0)


@pytest.mark.parametrize("code", PYTHON)
def test_a_guess_in_python(code, result):
    from analysis.batches.comparison_plans import comparison_plan

    names = {
        "phonotaxis": phonotaxis,
        "comparison_plan": comparison_plan,
        "result": result,
        "scenario": result.scenario,
        "SHORT": SHORT,
    }
    try:
        answer = repr(eval(code, names))
    except (AttributeError, TypeError, InputError) as error:
        answer = str(error)
    assert (PYTHON[code] or "") in answer
