"""The filter against textbook matrices, chance, and what it must not believe."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.linalg import expm
from scipy.stats import chi2

from systems.framework.signals import TICK_S
from systems.hearing.tracking.target_filter import (
    BELIEVED_OUTLIERS,
    GATE,
    HYPOTHESIS,
    NEVER_HEARD_S,
    SPEED_STD,
    VELOCITY_FADE_S,
    FilterSettings,
    ages,
    blank_memory,
    chosen_track,
    expected,
    fold,
)

T = TICK_S
SETTINGS = FilterSettings(floor=0.0, measurement_age=0.0)
H = np.eye(2, 4)
#: Where in a track the upper triangles of a 4 x 4 covariance stand.
PLACES = {(0, 0): 5, (0, 1): 6, (1, 1): 7, (0, 2): 8, (0, 3): 9} | {
    (1, 2): 10, (1, 3): 11, (2, 2): 12, (2, 3): 13, (3, 3): 14
}  # fmt: skip


def matrices(track):
    """Mean (4,) and covariance (4, 4) of a track."""
    P = np.zeros((4, 4))
    for (i, j), place in PLACES.items():
        P[i, j] = P[j, i] = track[place]
    return track[1:5].copy(), P


def sighting(z, R, *, center=(0.0, 0.0), ahead=(1.0, 0.0), ranged=True):
    R = np.asarray(R)
    return np.array([*z, R[0, 0], R[0, 1], R[1, 1], *center, *ahead, float(ranged)])


def bearing(direction: float, std: float, **kwargs):
    """A sighting along a direction in W."""
    u = np.array([math.cos(direction), math.sin(direction)])
    n = np.array([-u[1], u[0]])
    return sighting(u, std**2 * np.outer(n, n), **kwargs, ranged=False)


def model(seconds: float):
    """Transition and noise of the Ornstein-Uhlenbeck velocity, by van Loan."""
    fade = VELOCITY_FADE_S
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [np.zeros((2, 2)), -np.eye(2) / fade]])
    Q = np.diag([0.0, 0.0, 1.0, 1.0]) * 2.0 * SPEED_STD**2 / fade
    E = expm(np.block([[-A, Q], [np.zeros((4, 4)), A.T]]) * seconds)
    F = E[4:, 4:].T
    return F, F @ E[:4, 4:]


def random_covariance(rng, size: float):
    root = rng.normal(0.0, size, (2, 2))
    return root @ root.T + 1e-4 * size**2 * np.eye(2)


@given(st.floats(0.01, 20.0))
def test_prediction_is_that_of_the_matrix_exponential(seconds):
    memory = blank_memory(1)
    fold(memory, sighting([1.0, -2.0], [[0.01, 0.002], [0.002, 0.02]]), SETTINGS)
    memory += 0.3 * ages(len(memory) // HYPOTHESIS)
    fold(memory, sighting([1.1, -1.9], [[0.02, 0.0], [0.0, 0.01]]), SETTINGS)
    x, P = matrices(chosen_track(memory))
    F, Q = model(seconds)
    memory += seconds * ages(1)
    later, covariance = matrices(expected(memory))
    np.testing.assert_allclose(later, F @ x, atol=1e-12)
    np.testing.assert_allclose(covariance, F @ P @ F.T + Q, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_a_run_agrees_with_the_textbook_filter(seed):
    """Predict and correct with 4 x 4 matrices and numpy's solver."""
    rng = np.random.default_rng(seed)
    settings = SETTINGS._replace(floor=0.02)
    memory = blank_memory(1)
    R = random_covariance(rng, 0.05)
    x, P = np.zeros(4), np.diag([0.0, 0.0, SPEED_STD**2, SPEED_STD**2])
    P[:2, :2] = R + 0.02**2 * np.eye(2)
    fold(memory, sighting([0.0, 0.0], R), settings)
    for _ in range(30):
        ticks = int(rng.integers(1, 40))
        memory += ticks * T * ages(len(memory) // HYPOTHESIS)
        F, Q = model(ticks * T)
        x, P = F @ x, F @ P @ F.T + Q
        R = random_covariance(rng, 0.05)
        S = P[:2, :2] + R + 0.02**2 * np.eye(2)
        z = x[:2] + 0.5 * np.linalg.cholesky(S) @ rng.uniform(-1.0, 1.0, 2)
        fold(memory, sighting(z, R), settings)
        K = np.linalg.solve(S, H @ P).T
        x, P = x + K @ (z - x[:2]), (np.eye(4) - K @ H) @ P
        mean, covariance = matrices(chosen_track(memory))
        np.testing.assert_allclose(mean, x, atol=1e-10)
        np.testing.assert_allclose(covariance, P, atol=1e-10)


def simulated_source(rng, ticks: int):
    """(ticks, 4) states of a source of the filter's own kind."""
    F, Q = model(T)
    root = np.linalg.cholesky(Q + 1e-15 * np.eye(4))
    x = np.array([2.0, 0.0, *rng.normal(0.0, SPEED_STD, 2)])
    states = []
    for _ in range(ticks):
        states.append(x)
        x = F @ x + root @ rng.standard_normal(4)
    return np.array(states)


def test_errors_and_innovations_are_what_the_covariances_say():
    """200 sources of the model, heard for 0.5 s in every 2 s over 8 s.

    The sums of the normalized squares are chi-square: means of the position's
    error within their 95 % intervals at the ends of all gaps and bursts, and of
    all innovations. What the gate cuts off the tail (1 % of the innovations,
    beyond 9.21, of which nearly all count less or nothing) is less than their
    interval.
    """
    rng = np.random.default_rng(1)
    R = np.array([[4e-4, 1e-4], [1e-4, 1e-4]])
    root = np.linalg.cholesky(R)
    errors, innovations = [], []
    for _ in range(200):
        states = simulated_source(rng, 320)
        memory = blank_memory(1)
        for tick, x in enumerate(states):
            track = chosen_track(memory)
            heard = tick % 80 < 20
            if track[0] < NEVER_HEARD_S:
                mean, P = matrices(expected(memory))
                if tick % 80 in (0, 19):
                    e = mean[:2] - x[:2]
                    errors.append(e @ np.linalg.solve(P[:2, :2], e))
            if heard:
                z = x[:2] + root @ rng.standard_normal(2)
                if track[0] < NEVER_HEARD_S:
                    e = z - mean[:2]
                    innovations.append(e @ np.linalg.solve(P[:2, :2] + R, e))
                fold(memory, sighting(z, R), SETTINGS)
            memory += T * ages(len(memory) // HYPOTHESIS)
    # Errors 0.5 s and more apart share little; innovations are white.
    for values in (errors, innovations):
        low, high = chi2.ppf([0.025, 0.975], 2 * len(values)) / len(values)
        assert low < np.mean(values) < high
    assert np.mean(np.array(innovations) > GATE) == pytest.approx(0.01, abs=0.004)


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.01, 0.2), st.booleans())
def test_without_noise_the_track_is_at_the_sighting(x, y, dx, two):
    """To rounding, however much was known before."""
    memory = blank_memory(2 if two else 1)
    zero = np.zeros((2, 2))
    for k in range(6):
        z = [x + k * dx * 0.02, y - k * dx * 0.01]
        fold(memory, sighting(z, zero, center=(-9.0, 0.0)), SETTINGS)
        np.testing.assert_allclose(chosen_track(memory)[1:3], z, rtol=0, atol=1e-13)
        memory += T * ages(len(memory) // HYPOTHESIS)


@given(st.floats(-3.0, 3.0), st.floats(-0.1, 0.1))
def test_a_bearing_counts_across_itself_alone(direction, off):
    """Against the information filter; nothing is learned along the bearing."""
    memory = blank_memory(1)
    u = np.array([math.cos(direction), math.sin(direction)])
    n = np.array([-u[1], u[0]])
    at = np.array([0.4, -0.3])
    fold(memory, sighting(at + 2.0 * u + off * n, 0.01 * np.eye(2)), SETTINGS)
    memory += 0.5 * ages(len(memory) // HYPOTHESIS)
    before, P = matrices(expected(memory))
    fold(memory, bearing(direction, 0.02, center=at), SETTINGS)
    after, covariance = matrices(chosen_track(memory))
    h = np.array([*n, 0.0, 0.0])
    variance = (0.02 * 2.0) ** 2
    information = np.linalg.inv(P) + np.outer(h, h) / variance
    np.testing.assert_allclose(
        np.linalg.inv(covariance), information, rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(u @ after[:2], u @ before[:2], atol=1e-12)
    kept = h @ P @ h / (h @ P @ h + variance)
    np.testing.assert_allclose(n @ (after[:2] - at), off * (1 - kept), atol=1e-9)


def test_first_bearing_takes_the_assumed_range():
    """0.02 rad at 3 m is 6 cm across; along it, half the range is one deviation."""
    memory = blank_memory(1)
    fold(memory, bearing(0.0, 0.02, center=(1.0, 1.0)), SETTINGS)
    x, P = matrices(chosen_track(memory))
    np.testing.assert_allclose(x, [4.0, 1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(P)), [1.5, 0.06, 0.35, 0.35])


def test_bearings_from_two_places_find_the_range():
    """Triangulation, 2 m from a path of 1.5 m, in which a source hardly moves."""
    memory = blank_memory(1)
    for y in np.linspace(0.0, 1.5, 61):
        fold(memory, bearing(math.atan2(-y, 2.0), 0.01, center=(0.0, y)), SETTINGS)
        memory += 1e-3 * ages(len(memory) // HYPOTHESIS)
    x, P = matrices(chosen_track(memory))
    assert np.all(np.abs(x[:2] - [2.0, 0.0]) < 3.0 * np.sqrt(np.diag(P)[:2]))
    assert np.sqrt(P[0, 0]) < 0.15


def test_an_opposite_bearing_is_an_outlier():
    """Its line passes the target, but on the other side."""
    memory = blank_memory(1)
    fold(memory, sighting([2.0, 0.0], 1e-4 * np.eye(2)), SETTINGS)
    memory += T * ages(len(memory) // HYPOTHESIS)
    assert not fold(memory, bearing(math.pi, 0.01), SETTINGS)


def rested(hypotheses: int = 1):
    """A memory that has heard a resting source at (2, 0) for 0.5 s."""
    memory = blank_memory(hypotheses)
    for _ in range(20):
        fold(memory, sighting([2.0, 0.0], 2.5e-5 * np.eye(2)), SETTINGS)
        memory += T * ages(len(memory) // HYPOTHESIS)
    return memory


@given(st.floats(0.8, 20.0), st.floats(-math.pi, math.pi), st.integers(1, 2))
def test_an_outlier_changes_nothing(distance, direction, hypotheses):
    memory = rested(hypotheses)
    before = chosen_track(memory).copy()
    z = [2.0 + distance * math.cos(direction), distance * math.sin(direction)]
    # Far behind the row, so that its image is an outlier, too.
    far = sighting(z, 1e-6 * np.eye(2), center=(-30.0, 0.0))
    assert not fold(memory, far, SETTINGS)
    np.testing.assert_array_equal(chosen_track(memory), before)


@given(st.floats(0.02, 0.3), st.floats(-math.pi, math.pi))
def test_a_frame_that_is_a_little_off_pulls_little(distance, direction):
    """Stated deviation 1 mm, error up to 0.3 m, belief 3 mm: at most a few mm."""
    memory = rested()
    z = [2.0 + distance * math.cos(direction), distance * math.sin(direction)]
    fold(memory, sighting(z, 1e-6 * np.eye(2)), SETTINGS._replace(floor=0.005))
    moved = math.hypot(chosen_track(memory)[1] - 2.0, chosen_track(memory)[2])
    assert moved < min(0.5 * distance, 0.015)


def test_scattered_outliers_are_never_believed():
    rng = np.random.default_rng(3)
    memory = rested()
    for k in range(100):
        direction = 2.4 * k  # the golden angle: no two in a row agree
        z = 3.0 * np.array([math.cos(direction), math.sin(direction)])
        fold(memory, sighting(z + rng.normal(0, 0.01, 2), 1e-6 * np.eye(2)), SETTINGS)
    np.testing.assert_allclose(chosen_track(memory)[1:3], [2.0, 0.0], atol=1e-3)


def test_outliers_that_agree_are_believed():
    memory = rested()
    for k in range(1, BELIEVED_OUTLIERS + 1):
        memory += T * ages(len(memory) // HYPOTHESIS)
        z = [4.0 + 0.003 * k, 1.0]
        believed = fold(memory, sighting(z, 2.5e-5 * np.eye(2)), SETTINGS)
        assert believed == (k == BELIEVED_OUTLIERS)
    np.testing.assert_allclose(chosen_track(memory)[1:3], z, atol=0.01)
    assert chosen_track(memory)[0] == SETTINGS.measurement_age


def test_outliers_need_to_be_in_a_row():
    memory = rested()
    good = sighting([2.0, 0.0], 2.5e-5 * np.eye(2))
    jump = sighting([4.0, 1.0], 2.5e-5 * np.eye(2))
    for _ in range(10):
        for frame in (jump, jump, good):
            memory += T * ages(len(memory) // HYPOTHESIS)
            fold(memory, frame, SETTINGS)
    np.testing.assert_allclose(chosen_track(memory)[1:3], [2.0, 0.0], atol=1e-3)


def test_the_gate_widens_with_silence():
    """After 1.5 s a source may be 0.8 m on; after a tick it may not."""
    for silence, believed in ((T, False), (1.5, True)):
        memory = rested()
        memory += silence * ages(len(memory) // HYPOTHESIS)
        z = sighting([2.8, 0.0], 2.5e-5 * np.eye(2))
        assert fold(memory, z, SETTINGS) == believed


@pytest.mark.parametrize(("true_std", "stated_std"), [(0.08, 0.02), (0.02, 0.02)])
def test_scatter_is_learned_where_it_exceeds_what_is_stated(true_std, stated_std):
    """A resting source: 5 s of frames that err by more than they say, or not.

    The factor finds 16 / 1.5, what is beyond the margin; honest frames leave it
    at 1. Either way the normalized error stays in proportion.
    """
    rng = np.random.default_rng(6)
    factors, errors = [], []
    for _ in range(20):
        memory = blank_memory(1)
        for _ in range(200):
            z = rng.normal([2.0, 0.0], true_std)
            fold(memory, sighting(z, stated_std**2 * np.eye(2)), SETTINGS)
            memory += T * ages(1)
        x, P = matrices(chosen_track(memory))
        factors.append(chosen_track(memory)[15])
        e = x[:2] - [2.0, 0.0]
        errors.append(e @ np.linalg.solve(P[:2, :2], e))
    expected = max(1.0, (true_std / stated_std) ** 2 / 1.5)
    assert np.median(factors) == pytest.approx(expected, rel=0.3)
    assert np.mean(errors) < chi2.ppf(0.999, 40) / 20
