"""The hearing formulas of Han 2019 and Kim 2017 as printed, against geometry.

Every test stands behind a row of docs/errata.md. What the papers print is
transcribed here and nowhere else.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from systems.delays.delay_search import amdf
from systems.framework.signals import SAMPLE_RATE_HZ, TICK_S, Emission
from systems.hearing.near_field import source_from_delays
from systems.hearing.source_fix import RANGED
from systems.sound.propagation import propagate

SPACING = 0.4
SPEED = 340.0

sources = st.tuples(st.floats(0.5, 4.0), st.floats(-1.4, 1.4))


def distances(range_: float, bearing: float) -> list[float]:
    """R1, R2, R3 of a source at a range and bearing from the middle microphone."""
    x, y = range_ * math.cos(bearing), range_ * math.sin(bearing)
    return [math.hypot(x, y - place) for place in (SPACING, 0.0, -SPACING)]


def differences(range_: float, bearing: float) -> tuple[float, float]:
    """c Delta t_12 and c Delta t_13, m."""
    R1, R2, R3 = distances(range_, bearing)
    return R2 - R1, R3 - R1


def ours(a: float, b: float) -> tuple[float, float, int]:
    """Bearing, range and its status from c Delta t_12 and c Delta t_13."""
    return source_from_delays(a / SPEED, b / SPEED, SPACING, SPEED)


def test_han_pressure_falls_with_the_distance_not_its_square() -> None:
    """A tone at rest, heard 1 m and 2 m away: half the pressure."""
    time = np.arange(-5000, 2500) / SAMPLE_RATE_HZ
    emission = Emission(
        samples=np.sin(2.0 * np.pi * 1000.0 * time).astype(np.float32),
        start_time=time[0],
        sample_rate_hz=SAMPLE_RATE_HZ,
        knot_times=np.array([time[0], TICK_S]),
        p_WS=np.zeros((2, 2)),
        v_WS=np.zeros((2, 2)),
        level_pa=math.sqrt(0.5),
        sounding=True,
    )
    instants = np.tile(np.linspace(0.0, TICK_S, 11), (2, 1))
    p_WM = np.zeros((2, 11, 2))
    p_WM[0, :, 0], p_WM[1, :, 0] = 1.0, 2.0
    heard = propagate(emission, instants, p_WM, 0.0 * p_WM, 2500, SPEED)
    near, far = np.sqrt(np.mean(heard.astype(float) ** 2, axis=1))
    assert near / far == pytest.approx(2.0, rel=1e-4)
    assert (near / far) ** 2 == pytest.approx(4.0, rel=1e-4)


def printed_eq_5(x_i: NDArray[np.float32], x_j: NDArray[np.float32], j: int) -> float:
    """Without the samples past the end, which the sum as printed asks for."""
    n = len(x_i)
    return float(1.0 / np.sum(np.sqrt((x_i[: n - j] - x_j[j:]) ** 2)))


def two_channels(
    delay: int, noise: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(2500,) each: white noise, the second later by ``delay`` samples."""
    rng = np.random.default_rng(7)
    sound = rng.standard_normal(2900)
    first, second = sound[200:2700], sound[200 - delay : 2700 - delay]
    first = first + noise * rng.standard_normal(2500)
    second = second + noise * rng.standard_normal(2500)
    return first.astype(np.float32), second.astype(np.float32)


def test_han_eq_4_divides_by_zero_for_equal_signals() -> None:
    first, _ = two_channels(40, 0.0)
    with pytest.raises(FloatingPointError):
        printed_eq_5(first, first, 0)
    difference = amdf(*two_channels(0, 0.0), 10)
    assert np.argmin(difference) == 10
    assert difference[10] == 0.0


def test_han_eq_5_runs_past_the_end() -> None:
    """k = 0 ... n - 1 and j = 1 ask for sample n of n."""
    first, second = two_channels(40, 0.0)
    with pytest.raises(IndexError):
        [first[k] - second[k + 1] for k in range(len(first))]


def test_han_eq_5_favors_large_lags() -> None:
    """True lag 40 samples; the sum of one or two terms is the smallest."""
    first, second = two_channels(40, 0.1)
    similarity = [printed_eq_5(first, second, j) for j in range(2500)]
    assert np.argmax(similarity) > 2490
    assert np.argmin(amdf(first, second, 236)) - 236 == 40


def test_han_eq_5_sees_one_sign_of_delay() -> None:
    """True lag -40 samples, that is, the source nearer to the other microphone."""
    first, second = two_channels(-40, 0.1)
    forward = max(printed_eq_5(first, second, j) for j in range(237))
    backward = [printed_eq_5(second, first, j) for j in range(237)]
    assert np.argmax(backward) == 40
    assert backward[40] > 5.0 * forward
    assert np.argmin(amdf(first, second, 236)) - 236 == -40


@pytest.mark.parametrize(
    ("range_", "bearing_deg", "by_samples"),
    [(1.0, 0.0, 0.984), (2.0, 60.0, 1.713), (3.0, 60.0, 4.008), (4.0, 60.0, 2.918)],
)
def test_han_eq_6_whole_samples_spoil_the_range(
    range_, bearing_deg, by_samples
) -> None:
    """Exact delays, rounded to 10 us; table 1 has 3.82 m at 4 m and 60 deg."""
    a, b = differences(range_, math.radians(bearing_deg))
    assert ours(a, b)[1] == pytest.approx(range_, rel=1e-6)
    sample = SPEED / SAMPLE_RATE_HZ
    whole = ours(round(a / sample) * sample, round(b / sample) * sample)
    assert whole[1] == pytest.approx(by_samples, abs=1e-3)


def heron(p: float, q: float) -> float:
    """Eq. 8: area of the triangle with the sides p, q and l."""
    s = (p + q + SPACING) / 2.0
    return math.sqrt(s * (s - p) * (s - q) * (s - SPACING))


@given(source=sources)
def test_han_eq_8_leads_to_apollonius_and_our_range(source) -> None:
    """Equal areas: (R1^2 - R3^2) (R1^2 + R3^2 - 2 R2^2 - 2 l^2) = 0."""
    R1, R2, R3 = distances(*source)
    areas = heron(R1, R2), heron(R2, R3)
    assert areas[0] == pytest.approx(areas[1], rel=1e-6)
    assert 16.0 * (areas[0] ** 2 - areas[1] ** 2) == pytest.approx(
        (R1**2 - R3**2) * (2.0 * R2**2 + 2.0 * SPACING**2 - R1**2 - R3**2), abs=1e-9
    )
    bearing, range_, status = ours(R2 - R1, R3 - R1)
    assert status == RANGED
    assert (range_, bearing) == pytest.approx(source, rel=1e-5, abs=1e-6)


def printed_eq_9(a: float, b: float) -> float:
    return (SPACING**2 + SPACING * (a + b) - (a * a + a * b + b * b)) / (2 * (a + b))


def test_han_eq_9_is_wrong_wherever_the_first_microphone_is() -> None:
    """2 m broadside; D = R1 is 2.0396 m with M1 at the end, 2 m in the middle."""
    R1, R2, R3 = distances(2.0, 0.0)
    assert printed_eq_9(R2 - R1, R3 - R1) == pytest.approx(-1.8)
    assert printed_eq_9(R1 - R2, R3 - R2) == pytest.approx(1.1802, abs=1e-4)
    assert ours(R2 - R1, R3 - R1)[1] == pytest.approx(2.0)
    assert math.isclose(R1, 2.0396, abs_tol=1e-4)


@given(range_=st.floats(0.5, 4.0))
def test_han_eq_9_broadside_falls_as_the_range_grows(range_) -> None:
    """M1 at the end: l/2 - R, exactly."""
    a, b = differences(range_, 0.0)
    assert printed_eq_9(a, b) == pytest.approx(SPACING / 2.0 - range_, abs=1e-9)


@given(range_=st.floats(0.5, 4.0))
def test_han_eq_10_is_off_broadside(range_) -> None:
    """By asin((sqrt(R^2 + l^2) - R) / l) from the axis, l/(2 R) for large R."""
    a, _ = differences(range_, 0.0)
    from_broadside = math.acos(a / SPACING) - math.pi / 2
    error = math.asin((math.hypot(range_, SPACING) - range_) / SPACING)
    assert from_broadside == pytest.approx(error)
    assert error < SPACING / (2.0 * range_)


def test_han_eq_10_in_numbers() -> None:
    """11.1 deg at 1 m broadside and 2.9 deg at 4 m; table 1 has 0.4 deg at both."""
    for range_, error_deg in ((1.0, 11.1), (4.0, 2.86)):
        a, b = differences(range_, 0.0)
        printed = math.degrees(math.acos(a / SPACING))
        assert printed - 90.0 == pytest.approx(error_deg, abs=0.01)
        assert ours(a, b)[0] == pytest.approx(0.0, abs=1e-12)


def test_mean_of_han_eq_10_a_and_b_is_off_as_well() -> None:
    """58.4 deg at 1 m and 60 deg; table 1 has 60.0, standard deviation 0.2."""
    a, b = differences(1.0, math.radians(60.0))
    from_axis = math.acos(a / SPACING), math.acos((b - a) / SPACING)
    assert 90.0 - math.degrees(sum(from_axis) / 2.0) == pytest.approx(58.43, abs=0.01)
    assert math.degrees(ours(a, b)[0]) == pytest.approx(60.0)


def kim_eq_8(*times: float) -> float:
    t_1, t_2, t_3 = times
    above = 2.0 * SPACING**2 - SPEED**2 * (t_1**2 - 2.0 * t_2**2 + t_3**2)
    return above / (2.0 * SPEED * (t_1 - 2.0 * t_2 + t_3))


@given(source=sources, counted_from=st.floats(0.0, 4.0))
def test_kim_eq_8_returns_what_the_times_are_counted_from(source, counted_from) -> None:
    """t_i = (R_i - D) / c gives D for every D; delays from M1 give R1."""
    R = distances(*source)
    times = [(R_i - counted_from) / SPEED for R_i in R]
    assert kim_eq_8(*times) == pytest.approx(counted_from, rel=1e-6, abs=1e-6)
    a, b = differences(*source)
    assert kim_eq_8(0.0, a / SPEED, b / SPEED) == pytest.approx(R[0], rel=1e-6)
    assert ours(a, b)[1] - a == pytest.approx(R[0], rel=1e-6)


@given(source=sources)
def test_kim_eq_8_with_traveling_times_is_zero(source) -> None:
    times = [R_i / SPEED for R_i in distances(*source)]
    assert kim_eq_8(*times) == pytest.approx(0.0, abs=1e-9)


@given(source=sources)
def test_kim_eq_9_to_11_need_the_normal_distance(source) -> None:
    """sin theta_i = D / R_i holds for D = R cos(bearing), not for D = R1."""
    R = distances(*source)
    normal = source[0] * math.cos(source[1])
    lateral = source[0] * math.sin(source[1])
    places = (SPACING, 0.0, -SPACING)
    for R_i, place in zip(R, places, strict=True):
        from_axis = math.atan2(normal, abs(lateral - place))
        assert math.asin(min(1.0, normal / R_i)) == pytest.approx(from_axis, abs=1e-6)


def test_kim_eq_9_to_11_in_numbers() -> None:
    """2 m and 30 deg: 60.0 deg from the axis at M2; R1 gives 66.4 deg."""
    R1, R2, _ = distances(2.0, math.radians(30.0))
    normal = 2.0 * math.cos(math.radians(30.0))
    assert math.degrees(math.asin(normal / R2)) == pytest.approx(60.0)
    assert math.degrees(math.asin(R1 / R2)) == pytest.approx(66.42, abs=0.01)
