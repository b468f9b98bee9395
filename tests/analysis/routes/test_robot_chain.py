"""Chains of robots: closed forms, responses against runs in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

from analysis.loops.contact_mode import motion_chain
from analysis.routes.chain_run import brake_chain, run_chain, shake_chain
from analysis.routes.robot_chain import (
    ChainLinks,
    chain_model,
    chain_response,
    chain_spacings,
    disc_offsets,
    links_of,
    resting_gaps,
    robot_chain,
)
from diagrams import load_scenario

#: K = 3, D = 4, M = 1; the lag of the motors, and half a tick that P leads by.
K, D, LAG, T = 3.0, 4.0, 0.05, 0.025


def scenario(law="trajectory_conventional"):
    return load_scenario("unknown_block", [f"law={law}"])


@pytest.fixture(scope="module")
def chains():
    return {
        law: robot_chain(scenario(f"trajectory_{law}"))
        for law in ("conventional", "filtered")
    }


def test_a_pair_is_the_second_order_system_at_low_frequency():
    """G = (K + c D s)/(s^2 + D s + K), to the lag of motors and ticks."""
    omega = np.array([0.05, 0.2, 0.5])
    s = 1j * omega
    for share in (0.0, 0.6, 1.0):
        pair = chain_response(scenario(), [ChainLinks(K, D, share)], omega)[:, 0]
        expected = (K + share * D * s) / (s**2 + D * s + K)
        np.testing.assert_allclose(pair, expected, atol=0.02)


def test_a_chain_out_of_contact_is_a_power_of_a_pair():
    links = (ChainLinks(K, D, 1.0),) * 7
    omega = np.geomspace(0.1, 50.0, 20)
    chain = chain_response(scenario(), links, omega)
    for i in range(7):
        np.testing.assert_allclose(chain[:, i], chain[:, 0] ** (i + 1), rtol=1e-9)


def test_a_late_neighbor_turns_the_phase_alone():
    omega = np.array([0.5, 2.0])
    soon, late = (
        chain_response(scenario(), [ChainLinks(K, D, 1.0, late_ticks=n)], omega)[:, 0]
        for n in (0, 3)
    )
    np.testing.assert_allclose(late, soon * np.exp(-3j * omega * T), rtol=1e-9)


@pytest.mark.parametrize("late", [0, 2])
def test_the_matrix_of_a_chain_is_that_of_its_response(late):
    """Cramer: the last one's amplitude is what couples all, over a determinant."""
    where = scenario()
    links = [
        ChainLinks(K, D, 0.7, (3.0, 2.0), (2.0, 1.0), late),
        ChainLinks(K, D, 0.7, (3.0, 1.0), (1.0, 0.5), late),
        ChainLinks(K, D, 0.7, (1.0, 0.5), (0.0, 0.0), late),
    ]
    omega = np.array([0.3, 1.7, 8.0, 40.0])
    z = np.exp(1j * omega * T)
    place = motion_chain(where).response(omega)[0, 0]
    coupled = np.ones(len(omega), dtype=complex)
    for link in links:
        speed = (1.0 - 1.0 / z) / T
        pull = link.stiffness + link.ahead[0] + (0.7 * D + link.ahead[1]) * speed
        coupled *= pull * z**-late * place / where.only.robot.mass_kg
    loose = [ChainLinks(0.0, 0.0, 0.0, late_ticks=late)] * 3
    determinants = [
        np.array([np.linalg.det(each * np.eye(len(A)) - A) for each in z])
        for A in (chain_model(where, links).A, chain_model(where, loose).A)
    ]
    found = chain_response(where, links, omega)[:, -1]
    expected = coupled * determinants[1] / determinants[0]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_robots_that_come_to_no_rest_are_no_chain():
    field = "impedance.damping_n_s_m=90"
    chain = robot_chain(load_scenario("unknown_block", [field]))
    for peak in chain.peaks.values():
        assert peak.grows
        assert peak.peak == math.inf


def test_fed_forward_a_disturbance_grows_and_without_it_does_not(chains):
    peaks = chains["conventional"].peaks
    forward, without = peaks["with feed-forward"], peaks["without feed-forward"]
    assert forward.grows
    assert not without.grows
    assert forward.tail[8] == pytest.approx(forward.peak**7, rel=1e-6)
    assert max(without.tail.values()) <= 1.0 + 1e-6
    # For every D, and less as D grows.
    table = chains["conventional"].peaks_by_damping
    known = np.isfinite(table[:, 0])
    assert (table[known, 0] > 1.0 + 1e-4).all()


def test_the_least_damping_is_that_of_the_closed_form(chains):
    """D^2 = 2 K (M + D (lag - T/2)): where |G| leaves 1 upwards or downwards."""
    late = K * (LAG - 0.5 * T)
    expected = late + math.sqrt(late**2 + 2.0 * K)
    for chain in chains.values():
        assert chain.least_damping_n_s_m == pytest.approx(expected, rel=0.002)
        assert chain.time_headway_s == pytest.approx(4.0 / 3.0)


def test_the_share_that_may_be_fed_forward_is_that_of_the_closed_form(chains):
    """D^2 (1 - c^2) = 2 K (M + D (lag - T/2)) + c K D T."""
    left = D**2 - 2.0 * K * (1.0 + D * (LAG - 0.5 * T))
    b = K * D * T
    expected = (-b + math.sqrt(b**2 + 4.0 * D**2 * left)) / (2.0 * D**2)
    found = chains["conventional"].most_feed_forward
    assert found == pytest.approx(expected, rel=0.002)


@pytest.mark.parametrize("law", ["conventional", "filtered"])
def test_runs_of_eight_robots_do_what_responses_say(law, chains):
    where = scenario(f"trajectory_{law}")
    for name, peak in chains[law].peaks.items():
        assert shake_chain(where, name, peak).difference < 1e-4


def test_contacts_are_where_forces_vanish():
    """Gaps at rest against a root of all forces, and against a run that rests."""
    where = scenario()
    spacing = chain_spacings(where)[1]
    ahead, behind = disc_offsets(where)

    def forces(gaps):
        spring = 3.0
        front = np.maximum(1.0 - (gaps - ahead), 0.0)
        back = np.append(np.maximum(1.0 - (gaps[1:] - behind), 0.0), 0.0)
        return K * (gaps - spacing) - spring * front + spring * back

    found = resting_gaps(where, spacing, 5)
    np.testing.assert_allclose(found, fsolve(forces, np.full(5 - 1, spacing)))
    places = run_chain(
        where, np.zeros(400), feed_forward=1.0, spacing_m=spacing, robots=5
    )
    np.testing.assert_allclose(-np.diff(places[-1]), found, atol=1e-12)


def test_links_know_which_neighbors_touch():
    where = scenario("trajectory_filtered")
    apart, near = chain_spacings(where)
    assert all(
        link.ahead == link.behind == (0.0, 0.0) for link in links_of(where, 1, apart, 4)
    )
    first, *_, last = links_of(where, 1.0, near, 4)
    assert first.ahead[0] == 8.0
    assert last.behind == (0.0, 0.0)
    gap = resting_gaps(where, near, 4)[0] - disc_offsets(where)[0]
    assert first.ahead[1] == pytest.approx(4.0 * (1.0 - gap / 0.8))


def test_braking_is_passed_on_and_grows_only_where_responses_say(chains):
    where = scenario()
    found = {
        name: brake_chain(
            where, name, feed_forward=peak.feed_forward, spacing_m=peak.spacing_m
        )
        for name, peak in list(chains["conventional"].peaks.items())[:2]
    }
    assert (np.diff(found["with feed-forward"].overshoot_m) > 0.0).all()
    without = found["without feed-forward"]
    assert without.overshoot_m.max() < 1e-6
    # On the way the gap is longer by D v/K.
    longer = without.gap_m[0] - without.gap_m[-1]
    np.testing.assert_allclose(longer, D / K * 0.15, atol=0.001)
