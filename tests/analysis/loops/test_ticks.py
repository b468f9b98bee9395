"""Other ticks than 25 ms: poles and margins against own models and simulated decay."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.loops.burst_cycle import burst_cycle, simulate_burst_cycle
from analysis.loops.contact_mode import contact_model, largest_contact_stiffness
from analysis.loops.delay_margin import delay_margin
from analysis.loops.delayed_run import check_delay_margin
from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.linearization import compare_routes, continuous_model
from analysis.loops.loop_margins import loop_margins
from analysis.loops.open_loops import open_loop
from analysis.loops.radial_law import radial_law
from analysis.loops.robustness import following_poles
from analysis.loops.step_response import check_step
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from tests.block_forces import block_force
from tests.operating_points import follow_point

M, K, D, LAG = 3.94, 2.0, 1.0, 0.05
TICKS_S = (0.0125, 0.05)


def scenario(tick_s: float, **data) -> Scenario:
    rates = {
        "tick_s": tick_s,
        "microphones": {"frame_s": tick_s},
        "ultrasonic": {"period_s": tick_s},
    }
    return Scenario.model_validate({"law": "none"} | rates | data)


def held_over_a_tick(stiffness: float, tick_s: float) -> np.ndarray:
    """(3, 3) of p, wheels' speed w and v: w' = (v - w)/lag, p' = w, v held."""
    flow = expm(tick_s * np.array([[0, 1, 0], [0, -1 / LAG, 1 / LAG], [0, 0, 0]]))
    kick = np.eye(3)
    kick[2] -= tick_s / M * np.array([stiffness, 0.0, D])
    return flow @ kick


def by_size(poles: np.ndarray) -> np.ndarray:
    return poles[np.lexsort((poles.imag, -np.abs(poles).round(9)))]


@pytest.mark.parametrize("tick_s", TICKS_S)
def test_contact_mode_is_the_matrix_exponentials(tick_s):
    for stiffness in (K, 12.0):
        np.testing.assert_allclose(
            by_size(contact_model(scenario(tick_s), stiffness).poles),
            by_size(np.linalg.eigvals(held_over_a_tick(stiffness, tick_s))),
            atol=1e-9,
        )
    limit = largest_contact_stiffness(scenario(tick_s))
    radius = np.abs(np.linalg.eigvals(held_over_a_tick(limit, tick_s))).max()
    assert radius == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("tick_s", TICKS_S)
def test_target_motion_is_the_matrix_exponentials(tick_s):
    """Exact hearing, placed by odometry: the loop along the line has no delay.

    To the error of the integrator, which the wheels' own pole shows most.
    """
    at = follow_point(scenario(tick_s))
    own = np.log(np.linalg.eigvals(held_over_a_tick(K, tick_s)).astype(complex))
    for pole in own / tick_s:
        error = 1e-5 if abs(pole) < 1.0 else 0.2
        assert np.abs(at.eigenvalues - pole).min() < error
    assert at.motion.period_s == tick_s
    assert compare_routes(at).matrix_difference < 1e-10
    nominal = np.abs(following_poles(at)({}))
    assert nominal.max() == pytest.approx(np.exp(tick_s * at.eigenvalues.real.max()))


def test_poles_tend_to_those_of_continuous_time():
    """To first order in the tick, since what is held is half a tick old."""

    def off(tick_s: float) -> float:
        at = follow_point(scenario(tick_s))
        slow = continuous_model(at).poles
        slow = slow[np.abs(slow.imag) > 0.5]
        return float(np.abs(at.eigenvalues[:, None] - slow).min(axis=0).max())

    assert off(0.05) / off(0.0125) == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("tick_s", TICKS_S)
def test_step_of_the_diagram_decays_as_predicted(tick_s):
    found = check_step(scenario(tick_s))
    assert abs(found.frequency_error) < 2e-3
    assert abs(found.damping_error) < 5e-3


@pytest.mark.parametrize("tick_s", [0.05, pytest.param(0.0125, marks=pytest.mark.long)])
def test_delay_margin_is_where_the_diagram_begins_to_grow(tick_s):
    """A spring of 8 N/m leaves little damping, so that growth shows soon."""
    at = follow_point(scenario(tick_s, attraction={"stiffness_n_m": 8.0}))
    assert check_delay_margin(at, "wheels", duration_s=60.0).confirmed
    # That of the cut loop counts the phase at one frequency, and holds nearly.
    margin = delay_margin(at, "wheels")
    phase = loop_margins(open_loop(at, "wheels", "along"))
    assert phase.delay_margin_s == pytest.approx(margin.delay_s, rel=0.05)


@pytest.mark.parametrize("tick_s", TICKS_S)
def test_burst_cycle_is_that_of_a_simulated_run(tick_s):
    case = scenario(tick_s)
    cycle = burst_cycle(case, "robot", point=follow_point(case))
    assert cycle.matrices.shape[0] == round(cycle.period_s / tick_s)
    run = simulate_burst_cycle(cycle, 20)
    assert run.time_s[-1] == pytest.approx(20 * cycle.period_s)
    assert run.factor == pytest.approx(np.abs(cycle.along).max(), rel=1e-3)


@pytest.mark.parametrize("tick_s", TICKS_S)
@pytest.mark.parametrize("law", ["conventional", "active"])
def test_obstacle_speed_is_that_of_a_tick(tick_s, law):
    """The controller's block divides by its own tick: the slope of f(c, s) in s."""
    case = scenario(tick_s, law=law)
    at_rest, slow = (block_force(case, 0.4, speed) for speed in (0.0, 1e-4))
    _, damping = radial_law(case).gradient(0.4, 0.0)
    assert (slow - at_rest) / 1e-4 == pytest.approx(damping, rel=1e-3)
    if law == "conventional":
        assert damping == case.follower.laws.conventional.damping_n_s_m


@pytest.mark.parametrize("field", ["microphones", "ultrasonic"])
def test_other_rates_than_the_tick_have_no_linear_model(field):
    rates = {"microphones": {"frame_s": 0.0125}, "ultrasonic": {"period_s": 0.0125}}
    rates[field] = dict.fromkeys(rates[field], 0.025)
    case = Scenario.model_validate({"law": "none", "tick_s": 0.0125} | rates)
    with pytest.raises(InputError, match=f"{field}.*one rate"):
        follow_equilibrium(case)
