"""Margins against closed forms and python-control."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import all_margins, loop_margins
from analysis.loops.margin_results import DiskMargin
from analysis.loops.open_loops import closed, cut_model, open_loop, target_loop
from analysis.loops.operating_points import moving_equilibrium
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point

M, K, D = 3.94, 2.0, 1.0


def test_target_loop_has_the_printed_gains_figures():
    """omega_n 0.712 rad/s, damping ratio 0.178, poles -0.1269 +- 0.7011j."""
    model = target_loop(Scenario(), "sensor")
    poles = np.linalg.eigvals(model.A - model.B @ model.C)
    expected = np.roots([M, D, K])
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(expected))
    assert abs(poles[0].real) == pytest.approx(0.1269, abs=5e-5)
    assert abs(poles[0].imag) == pytest.approx(0.7011, abs=5e-5)


def test_margins_of_the_target_loop():
    """Phase margin 20.19 deg at sensor and actuator; 0.5105 s and 0.479 s."""
    sensor, actuator = (
        loop_margins(target_loop(Scenario(), at)) for at in ("sensor", "actuator")
    )
    assert sensor.phase_margin_deg == pytest.approx(20.19, abs=0.005)
    assert actuator.phase_margin_deg == pytest.approx(20.19, abs=0.005)
    assert sensor.crossover_rad_s == pytest.approx(0.690, abs=5e-4)
    assert sensor.delay_margin_s == pytest.approx(0.5105, abs=5e-5)
    assert actuator.delay_margin_s == pytest.approx(0.479, abs=5e-4)
    # (D s + K)/(M s^2) crosses 1 where M^2 w^4 = D^2 w^2 + K^2.
    squared = (D**2 + math.sqrt(D**4 + 4 * K**2 * M**2)) / (2 * M**2)
    assert actuator.crossover_rad_s == pytest.approx(math.sqrt(squared), rel=1e-9)


@settings(max_examples=15)
@given(
    st.floats(0.2, 30.0), st.floats(0.1, 10.0), st.sampled_from(["sensor", "actuator"])
)
def test_margins_are_those_of_control(stiffness, damping, at):
    gains = {"stiffness_n_m": stiffness, "damping_n_s_m": damping}
    model = target_loop(Scenario.model_validate({"attraction": gains}), at)
    ours = loop_margins(model)
    theirs = control.stability_margins(model.to_control())
    _, phase, modulus, _, crossover, modulus_at = theirs
    assert ours.phase_margin_deg == pytest.approx(phase, rel=1e-6)
    assert ours.crossover_rad_s == pytest.approx(crossover, rel=1e-6)
    if ours.modulus_margin < 0.99:  # else nearest at infinite frequency
        assert ours.modulus_margin == pytest.approx(modulus, rel=1e-6)
        assert ours.modulus_frequency_rad_s == pytest.approx(modulus_at, rel=1e-3)
    # A second-order loop never reaches -180.
    assert ours.gain_increase_margin == math.inf
    assert ours.gain_reduction_margin == 0.0
    for disk in ours.disks:
        # control cannot evaluate a response at infinity, where the peak may be.
        nearest = min(disk.frequency_rad_s, 1e12)
        omega = nearest * np.geomspace(0.8, 1.25, 401)
        alpha = control.disk_margins(model.to_control(), omega, skew=disk.skew)[0]
        assert disk.alpha <= alpha * (1 + 1e-5)
        assert disk.alpha == pytest.approx(alpha, rel=1e-3)
        alpha, gain_db, phase_deg = control.disk_margins(
            model.to_control(), np.array([nearest]), skew=disk.skew
        )
        assert disk.alpha == pytest.approx(alpha, rel=1e-9)
        # Past a factor of 0, or of infinity, control's gain is no number and phase odd.
        if disk.alpha * (1.0 + abs(disk.skew)) < 1.999:
            assert disk.gain_margin_db == pytest.approx(gain_db, rel=1e-6)
            assert disk.phase_margin_deg == pytest.approx(phase_deg, rel=1e-6)


@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.5])
def test_margins_of_a_loop_of_second_order(ratio):
    """L = w^2/(s (s + 2 z w)): crossover and M_t of the textbook, T has no zero."""
    natural = 3.0
    found = loop_margins(transfer_loop([natural**2], [1.0, 2 * ratio * natural, 0.0]))
    crossover = natural * math.sqrt(math.sqrt(1 + 4 * ratio**4) - 2 * ratio**2)
    phase = math.atan2(2 * ratio * natural, crossover)
    assert found.crossover_rad_s == pytest.approx(crossover, rel=1e-9)
    assert found.phase_margin_deg == pytest.approx(math.degrees(phase), rel=1e-9)
    assert found.delay_margin_s == pytest.approx(phase / crossover, rel=1e-9)
    peak = 1.0 / (2.0 * ratio * math.sqrt(1.0 - ratio**2))
    assert found.complementary_peak == pytest.approx(peak, rel=1e-9)
    # S = s (s + 2 z w)/(s^2 + 2 z w s + w^2), whose modulus is stationary in w^2 at
    # x^2 - x - 2 z^2 = 0, x = (frequency / w)^2.
    x = (1.0 + math.sqrt(1.0 + 8.0 * ratio**2)) / 2.0
    peak = math.sqrt((x**2 + 4 * ratio**2 * x) / ((1 - x) ** 2 + 4 * ratio**2 * x))
    assert found.sensitivity_peak == pytest.approx(peak, rel=1e-9)
    assert found.modulus_frequency_rad_s == pytest.approx(
        natural * math.sqrt(x), rel=1e-4
    )
    # The guard of the gain's fall is the reciprocal of M_t.
    assert found.disks[0].alpha == pytest.approx(1.0 / found.complementary_peak)


@pytest.mark.parametrize(
    ("skew", "alpha", "low", "high", "phase_deg"),
    [
        # |f - 1| < alpha, a chord of the unit circle
        (-1.0, 0.5, 0.5, 1.5, 2 * math.degrees(math.asin(0.25))),
        (-1.0, 1.5, 0.0, 2.5, 2 * math.degrees(math.asin(0.75))),
        (-1.0, 2.5, 0.0, 3.5, math.inf),
        # the same of 1 / f
        (1.0, 0.5, 2 / 3, 2.0, 2 * math.degrees(math.asin(0.25))),
        (1.0, 1.0, 0.5, math.inf, 60.0),
        (1.0, 1.5, 0.4, math.inf, 2 * math.degrees(math.asin(0.75))),
        # (1 + d/2)/(1 - d/2) = exp(j phase) for d = 2 j tan(phase/2)
        (0.0, 1.0, 1 / 3, 3.0, 2 * math.degrees(math.atan(0.5))),
        (0.0, 2.0, 0.0, math.inf, 90.0),
        (0.0, 3.0, 0.0, math.inf, 2 * math.degrees(math.atan(1.5))),
    ],
)
def test_disks_of_gain_and_phase(skew, alpha, low, high, phase_deg):
    disk = DiskMargin(skew, alpha, 1.0)
    assert (disk.gain_low, disk.gain_high) == pytest.approx((low, high))
    assert disk.phase_margin_deg == pytest.approx(phase_deg)
    down = math.inf if low == 0.0 else -20.0 * math.log10(low)
    assert disk.gain_margin_db == pytest.approx(min(down, 20.0 * math.log10(high)))


@settings(max_examples=15)
@given(st.floats(1.1, 20.0))
def test_gain_margin_of_a_known_loop(margin):
    """L = k / (s (s + 1)^2) has gain margin 2 / k at 1 rad/s."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -2.0]])
    B, C = np.array([[0.0], [0.0], [2.0 / margin]]), np.array([[1.0, 0.0, 0.0]])
    names = ("a", "b", "c"), ("u",), ("y",)
    found = loop_margins(LinearModel("L", A, B, C, np.zeros((1, 1)), *names))
    assert found.gain_increase_margin == pytest.approx(margin, rel=1e-9)
    assert found.gain_reduction_margin == 0.0
    assert found.gain_margin_db == pytest.approx(20.0 * math.log10(margin), rel=1e-9)
    assert found.stable


def transfer_loop(numerator, denominator):
    system = control.ss(control.tf(numerator, denominator))
    names = tuple(f"x{k}" for k in range(system.nstates)), ("u",), ("y",)
    return LinearModel("L", system.A, system.B, system.C, system.D, *names)


def test_an_unstable_plant_needs_a_least_gain():
    """L = 2 / (s - 1): stable for gains above a half."""
    found = loop_margins(transfer_loop([2.0], [1.0, -1.0]))
    assert found.stable
    assert found.gain_reduction_margin == pytest.approx(0.5, rel=1e-6)
    assert found.gain_increase_margin == math.inf
    assert found.gain_margin_db == pytest.approx(6.0206, abs=1e-4)


@pytest.mark.parametrize("gain", [9.5, 10.0, 14.0, 15.0, 23.0])
def test_gain_margin_is_the_lesser_of_both_directions(gain):
    """L = k / ((s - 1)(s + 3)^2): s^3 + 5 s^2 + 3 s + k - 9, stable for 9 < k < 24."""
    found = loop_margins(transfer_loop([gain], np.poly([1.0, -3.0, -3.0])))
    assert found.gain_reduction_margin == pytest.approx(9.0 / gain, rel=1e-6)
    assert found.gain_increase_margin == pytest.approx(24.0 / gain, rel=1e-9)
    down, up = 20.0 * math.log10(gain / 9.0), 20.0 * math.log10(24.0 / gain)
    assert found.gain_reduction_margin_db == pytest.approx(down, rel=1e-5)
    assert found.gain_increase_margin_db == pytest.approx(up, rel=1e-9)
    assert found.gain_margin_db == pytest.approx(min(down, up), rel=1e-5)


@pytest.mark.parametrize("gain", [0.6, 1.0, 20.0])
def test_too_little_gain_swings_a_conditionally_stable_loop(gain):
    """L = k (s + 1)^2 / s^3: s^3 + k s^2 + 2 k s + k, stable for k > 1/2 at 1 rad/s.

    A lead of 90 deg at high frequency and a lag of 270 deg at low: what crosses
    -180 deg between them is a lead that is lost.
    """
    found = loop_margins(transfer_loop(gain * np.poly([-1.0, -1.0]), [1, 0, 0, 0]))
    assert found.gain_reduction_margin == pytest.approx(0.5 / gain, rel=1e-9)
    assert found.gain_increase_margin == math.inf


@pytest.mark.parametrize("gain", [10.0, 23.0])
def test_lead_is_a_phase_margin_as_lag_is(gain):
    """k / ((s - 1)(s + 3)^2) crosses 1 once: control looks at one sign only."""
    found = loop_margins(transfer_loop([gain], np.poly([1.0, -3.0, -3.0])))
    at = 1j * found.crossover_rad_s
    angle = np.angle(-gain / ((at - 1.0) * (at + 3.0) ** 2))
    assert abs(gain / ((at - 1.0) * (at + 3.0) ** 2)) == pytest.approx(1.0)
    assert found.phase_lag_margin_deg == pytest.approx(math.degrees(angle) % 360.0)
    assert found.phase_lead_margin_deg == pytest.approx(math.degrees(-angle) % 360.0)
    assert found.phase_margin_deg == pytest.approx(abs(math.degrees(angle)))


def test_an_unstable_loop_stands_nothing():
    """L = 1 / (2 (s - 1)): its response alone would promise 60 deg and a factor 2."""
    found = loop_margins(transfer_loop([0.5], [1.0, -1.0]))
    assert not found.stable
    assert found.gain_margin_db == found.phase_margin_deg == found.disk.alpha == 0.0
    assert found.delay_margin_s == found.modulus_margin == 0.0
    assert found.sensitivity_peak == math.inf
    assert found.disk.gain_margin_db == found.disk.phase_margin_deg == 0.0


def test_sampled_margins_are_those_of_control():
    model = open_loop(follow_point(Scenario(law="none")), "actuator")
    ours = loop_margins(model)
    system = control.ss(model.A, model.B, model.C, model.D, dt=model.period_s)
    _, phase, modulus, _, crossover, _ = control.stability_margins(system, method="frd")
    assert ours.phase_margin_deg == pytest.approx(phase, rel=1e-3)
    assert ours.crossover_rad_s == pytest.approx(crossover, rel=1e-3)
    assert ours.modulus_margin == pytest.approx(modulus, rel=1e-3)


def test_lag_and_latency_eat_margin():
    """At the actuator: half a tick of hold, half of integration, 50 ms of lag."""
    point = follow_point(Scenario(law="none"))
    real = loop_margins(open_loop(point, "actuator"))
    ideal = loop_margins(target_loop(Scenario(), "actuator"))
    lost = math.radians(ideal.phase_margin_deg - real.phase_margin_deg)
    # Lag acts on the position's share of the force alone, hence less than 50 ms.
    assert 0.0 < lost / real.crossover_rad_s < 0.075
    assert real.stable


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("law", ["none", "active"])
def test_cut_loops_close_to_the_closed_loop(law, moving):
    scenario = Scenario(law=law)
    point = moving_equilibrium(scenario) if moving else follow_point(scenario)
    whole = point.loop.period_derivatives(point.state, point.time_s).A
    for places in (("sensor",), ("actuator",), ("wheels",), ("sensor", "wheels")):
        cut = cut_model(point, *places)
        np.testing.assert_allclose(closed(cut, cut.input_names).A, whole, atol=1e-10)


LAWS = ("none", "conventional", "active", "active2017")


@pytest.fixture(scope="module")
def cuts():
    """Of each law: its operating point, and each cut loop with its margins."""
    found = {}
    for law in LAWS:
        point = follow_point(Scenario(law=law))
        loops = [(m, open_loop(point, m.at, m.direction)) for m in all_margins(point)]
        found[law] = point, loops
    return found


def spectral_radius(model, factor):
    """Largest |z| with the loop's gain times a real or complex factor."""
    feedback = factor / (1.0 + factor * model.D[0, 0])
    return np.abs(np.linalg.eigvals(model.A - feedback * model.B @ model.C)).max()


def first_unstable(model, change, most):
    """Least x in (0, most) at which the loop times change(x) is unstable, else None."""
    tried = np.linspace(0.0, most, 600)
    unstable = (x for x in tried if spectral_radius(model, change(x)) > 1.0 + 1e-10)
    high = next(unstable, None)
    if high is None:
        return None
    low = high - tried[1]
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        if spectral_radius(model, change(middle)) > 1.0:
            high = middle
        else:
            low = middle
    return high


@pytest.mark.parametrize("law", LAWS)
def test_gain_margins_are_where_eigenvalues_leave_the_circle(cuts, law):
    """A - k B C over k, up to 400 and down to 1/400: no frequency response."""
    for found, model in cuts[law][1]:
        up = first_unstable(model, np.exp, math.log(400.0))
        assert found.margins.gain_increase_margin == pytest.approx(np.exp(up), rel=1e-6)
        down = first_unstable(model, lambda x: np.exp(-x), math.log(400.0))
        expected = 0.0 if down is None else math.exp(-down)
        assert found.margins.gain_reduction_margin == pytest.approx(expected, abs=1e-6)
        least = 20.0 / math.log(10.0) * min(up, math.inf if down is None else down)
        assert found.margins.gain_margin_db == pytest.approx(least, abs=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_phase_margins_are_where_eigenvalues_leave_the_circle(cuts, law):
    """Lag and lead as a complex gain: both signs of frequency see one of them."""
    for found, model in cuts[law][1]:
        for sign in (-1.0, 1.0):
            turn = first_unstable(
                model, lambda x, sign=sign: np.exp(sign * 1j * x), math.pi
            )
            assert found.margins.phase_margin_deg == pytest.approx(
                math.degrees(turn), abs=1e-6
            )
        for sign, margin in (
            (-1.0, found.margins.phase_lag_margin_deg),
            (1.0, found.margins.phase_lead_margin_deg),
        ):
            factor = np.exp(sign * 1j * math.radians(margin))
            feedback = factor / (1.0 + factor * model.D[0, 0])
            z = np.linalg.eigvals(model.A - feedback * model.B @ model.C)
            assert np.abs(np.abs(z[z.imag > 0.0]) - 1.0).min() < 1e-6


@pytest.mark.parametrize("law", LAWS)
def test_disks_lie_within_the_true_margins(cuts, law):
    """What a disk vouches for is true, and the modulus margin's own promise too."""
    for found, _ in cuts[law][1]:
        margins, alpha = found.margins, found.margins.disk.alpha
        low, high = (1.0 - alpha / 2.0) / (1.0 + alpha / 2.0), 1.0 + alpha / 2.0
        high /= 1.0 - alpha / 2.0
        assert (margins.disk.gain_low, margins.disk.gain_high) == pytest.approx(
            (low, high)
        )
        turn = math.degrees(2.0 * math.atan(alpha / 2.0))
        assert margins.disk.phase_margin_deg == pytest.approx(turn)
        for disk in margins.disks:
            assert margins.gain_reduction_margin <= disk.gain_low + 1e-9
            assert margins.gain_increase_margin >= disk.gain_high * (1.0 - 1e-9)
            assert margins.gain_margin_db >= disk.gain_margin_db - 1e-9
            assert margins.phase_margin_deg >= disk.phase_margin_deg - 1e-9
        assert margins.disks[2].alpha == pytest.approx(margins.modulus_margin)
        assert margins.sensitivity_peak == pytest.approx(1.0 / margins.modulus_margin)
        chord = 2.0 * math.asin(min(1.0, margins.modulus_margin / 2.0))
        assert margins.phase_margin_deg >= math.degrees(chord) - 1e-9


@pytest.mark.parametrize("law", ["active", "active2017"])
def test_bearings_that_shrink_turn_the_target_along_with_the_robot(cuts, law):
    """At the sensor, across: stable down to L/(L + epsilon) of the gain.

    P goes y aside and turns the robot by y/epsilon, its center being left behind.
    With a share k of what hearing says across, the target moves by
    (1 - k)(y + L y/epsilon), and that must be less than y.
    """
    point, loops = cuts[law]
    epsilon = point.loop.scenario.only.robot.control_point_m
    distance = point.source_distance_m
    (across,) = [
        found.margins
        for found, _ in loops
        if (found.at, found.direction) == ("sensor", "across")
    ]
    expected = distance / (distance + epsilon)
    assert across.gain_reduction_margin == pytest.approx(expected, rel=1e-5)
    assert across.gain_margin_db == pytest.approx(-20.0 * math.log10(expected), 1e-4)


@pytest.mark.parametrize("share", [0.86, 0.93])
def test_simulated_bearings_that_shrink_grow_below_the_margin_only(cuts, share):
    """The diagram itself, its hearing's second value scaled, for 20 s of ticks."""
    point = cuts["active"][0]
    loop, state, time_s = point.loop, point.state.copy(), point.time_s
    y = loop.state_names.index("command.v_WP_y")
    state[y] += 1e-4
    place = loop.state_names.index("plant.theta")
    turned = []
    for tick in range(800):
        now = time_s + tick * 0.025
        context = loop.context(state, now)
        block = loop.block("hearing")
        heard = block.GetOutputPort("p_PS_B").Eval(block.GetMyContextFromRoot(context))
        fed = {("tracker", "p_PS_B"): (heard[0], share * heard[1])}
        state = loop.period_map(state, now, fixed=fed)
        turned.append(abs(state[place] - point.theta_WB))
    late, early = max(turned[600:]), max(turned[300:500])
    assert (late > early) == (share < 0.8955)


def test_several_signals_have_no_margins():
    point = follow_point(Scenario(law="none"))
    with pytest.raises(ValueError, match=r"2 inputs.*part"):
        loop_margins(cut_model(point, "sensor"))


def test_no_spring_no_target_loop():
    slack = Scenario.model_validate({"attraction": {"stiffness_n_m": 0.0}})
    with pytest.raises(ValueError, match=r"stiffness_n_m"):
        target_loop(slack)
