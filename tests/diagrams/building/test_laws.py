"""From the name of a law to its block."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from diagrams import build_sound_follower, load_scenario
from diagrams.building.laws import make_controller
from diagrams.scenario.scenario import Scenario
from phonotaxis.testing import evaluate
from systems.framework.input_error import InputError
from systems.laws.catalog import FORCE_LAWS, LAWS

OWN_LAWS = """
from systems import ConventionalImpedanceController
from diagrams.scenario.participants import LawGains

number = 5


def inverse(c, s, laws: LawGains):
    return 1.5 / c


class Doubled(ConventionalImpedanceController):
    pass
"""


@pytest.fixture
def own_laws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A module in the working directory, which is no entry of sys.path."""
    (tmp_path / "own_laws_for_test.py").write_text(OWN_LAWS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "own_laws_for_test", raising=False)
    return "own_laws_for_test"


def repulsion_of(controller) -> float:
    """Force along x by a new obstacle 0.4 m ahead, N."""
    outputs = evaluate(
        controller,
        p_WS_estimated=[5.0, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.4, 0, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0, 0],
    )
    return float(outputs["forces_W"][2])


@pytest.mark.parametrize(
    ("law", "force"),
    [
        ("none", 0.0),
        ("conventional", -15.0 * 0.4),
        ("active", -16.0 * 0.4 - 0.2 * 0.72),
        ("conventional2017", -0.9 / 0.4),
        ("active2017", -1.2 / 0.4),
    ],
)
def test_laws_of_the_package_read_their_own_gains(law, force):
    """At rho_0/2, at rest: K_0 rho_0/2; the same and d_ref mu_0; K_0/c."""
    data = {
        "law": law,
        "laws": {
            "conventional": {"stiffness_n_m": 15.0},
            "active": {
                "matched_stiffness_n_m": 16.0,
                "reference_stiffness_n_m": 64.0,
                "reference_damping_n_s_m": 0.2,
                "speed_limit_m_s": 0.72,
            },
            "conventional2017": {"distance_gain_j": 0.9},
            "active2017": {"distance_gain_j": 1.2},
        },
    }
    controller = make_controller(Scenario.model_validate(data))
    assert repulsion_of(controller) == pytest.approx(force)
    assert law in LAWS


def test_own_function_in_the_working_directory(own_laws):
    controller = make_controller(Scenario(law=f"{own_laws}:inverse"))
    assert repulsion_of(controller) == pytest.approx(-1.5 / 0.4)


def test_own_law_is_built_into_the_diagram(own_laws):
    scenario = Scenario(law=f"{own_laws}:inverse", hearing="ideal")
    controller = build_sound_follower(scenario).blocks["controller"]
    assert controller.get_name() == "radial_law_controller"


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (
            "activ",
            "use none, conventional, active, conventional2017, active2017, guarded, s",
        ),
        (":inverse", "is not known"),
        ("own_laws_for_test:", "is not known"),
        ("no_such_module_anywhere:law", "cannot be imported: ModuleNotFoundError"),
        ("own_laws_for_test:missing", "has no function or class 'missing'"),
        ("own_laws_for_test:number", "has no function or class 'number'"),
    ],
)
def test_unknown_laws(own_laws, law, message):
    assert own_laws
    with pytest.raises(InputError, match=message) as error:
        make_controller(load_scenario("default", {"law": law}))
    assert error.value.field == "law"


@pytest.mark.parametrize(
    ("sensing", "firing", "rounds"),
    [
        ("ultrasonic", "sequential", 3),
        ("ultrasonic", "simultaneous", 1),
        ("ideal", "sequential", 1),
    ],
)
def test_laws_remember_a_round_of_the_sensors(sensing, firing, rounds):
    """Three numbers of three slots a tick; exact sensing has no order of firing."""
    for law in FORCE_LAWS:
        scenario = Scenario.model_validate(
            {
                "law": law,
                "obstacle_sensing": sensing,
                "ultrasonic": {"firing": firing},
            }
        )
        context = make_controller(scenario).CreateDefaultContext()
        assert context.get_discrete_state(0).size() == 9 * rounds


@pytest.mark.parametrize("law", ["stop_when_near", "dwa", "vfh_plus", "mppi"])
def test_laws_that_read_ranges_need_them(law):
    scenario = Scenario(law=law, hearing="ideal", obstacle_sensing="ideal")
    with pytest.raises(InputError, match="set it to ultrasonic") as error:
        build_sound_follower(scenario)
    assert error.value.field == "obstacle_sensing"


OWN_BLOCKS = """
from systems import ActiveImpedanceController, StopWhenNearController


class Anything(ActiveImpedanceController):
    def __init__(self, **options):
        super().__init__(**options)


class Asking(StopWhenNearController):
    asked = {}

    def __init__(self, gains, guard, bodies, seed, tick_s):
        Asking.asked = {"bodies": bodies, "seed": seed, "cell": guard.cell_m}
        super().__init__(gains=gains, tick_s=tick_s)
"""


def test_own_blocks_get_what_they_name(tmp_path):
    """One that takes any keyword gets what its base takes, with the base's gains."""
    file = tmp_path / "own_blocks.py"
    file.write_text(OWN_BLOCKS, encoding="utf-8")
    laws = {
        "active": {"reference_damping_n_s_m": 0.2, "matched_stiffness_n_m": 16.0},
        "stop_when_near": {"stop_m": 0.3},
    }
    own = {"law": f"{file}:Anything", "laws": laws}
    block = make_controller(Scenario.model_validate(own))
    assert repulsion_of(block) == pytest.approx(-16.0 * 0.4 - 0.2 * 0.72)
    own = {"law": f"{file}:Asking", "laws": laws}
    block = make_controller(Scenario.model_validate(own), bodies=3, seed=7)
    assert block.step.numbers.own.stop_m == 0.3
    assert type(block).asked == {"bodies": 3, "seed": 7, "cell": 0.05}
