"""What Song, Wang and Liu 2011 print, held against what it must be.

Rows of docs/errata.md name these tests.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr

from systems.heading.heading_controller import motor_duties
from systems.hearing.spherical_interpolation import interpolate_sphere
from systems.odor.steady_plume import steady_concentration
from systems.radio.codec import FRAME_BYTES, read_frame, write_frame
from systems.search.search_ending import UNDECIDED
from systems.search.song_rules import song2011_turn

Y_ARM = 0.15


def test_song_eq_2_to_4_are_spreads_that_grow_with_time():
    """Only sigma proportional to t makes Phi of the integral: eq. 6 follows."""
    u, g1, g2, x, y = 1.0, 0.2, 0.13, 1.2, 0.2
    s = u * x / (g1 * math.hypot(x, y))
    bracket = 1.0 + math.sqrt(2 * math.pi) * s * math.exp(s * s / 2) * ndtr(s)
    factor = 2.0 / ((2 * math.pi) ** 1.5 * g2 * (x * x + y * y))
    printed = factor * math.exp(-u * u / (2 * g1 * g1)) * bracket
    assert steady_concentration(x, y, 1.0, u, (g1, g1, g2)) == pytest.approx(
        printed, rel=1e-9
    )


def test_song_sec_5_breeze_model_is_the_gaussian_plume_on_the_axis():
    """ "Different from the Gaussian plume": by 0.4 % up to an intensity of 0.5."""
    for i in (0.1, 0.27, 0.5):
        x, u = 1.5, 1.0
        gaussian = 1.0 / (math.pi * u * (i * x) * (0.1 * x))
        breeze = steady_concentration(x, 0, 1.0, u, (i * u, i * u, 0.1 * u))
        assert breeze == pytest.approx(gaussian, rel=0.005)


def test_song_eq_7_needs_two_arguments():
    """At 120 deg the ratio alone says -60."""
    hx, hy = math.cos(math.radians(120.0)), math.sin(math.radians(120.0))
    assert math.degrees(math.atan(hy / hx)) == pytest.approx(-60.0)
    assert math.degrees(math.atan2(hy, hx)) == pytest.approx(120.0)


def printed_duties(error, *, mended_else=False):
    """(left, right) by Song 2011, table 2, with L = 50 deg, deg clockwise."""
    if mended_else and abs(error) > 50.0:
        return 0.01 * error, -0.01 * error
    if error >= 0.0:
        return (0.01 - 1.0) / 50.0 * error + 1.0, -(0.01 + 1.0 / 50.0) * error + 1.0
    return (0.01 + 1.0) / 50.0 * error + 1.0, (-0.01 + 1.0 / 50.0) * error + 1.0


def test_song_table_2_lacks_an_else():
    """Its second if overwrites the first: both motors run backwards at e = 100."""
    assert printed_duties(100.0) == pytest.approx((-0.98, -2.0))
    assert motor_duties(100.0) == pytest.approx((1.0, -1.0))


def test_song_table_2_has_a_bracket_in_the_wrong_place():
    """(0.01 - 1)/L e + 1 for (0.01 - 1/L) e + 1: a jump of 0.49 at L."""
    at, beyond = (printed_duties(e, mended_else=True)[0] for e in (50.0, 50.0 + 1e-9))
    assert beyond - at == pytest.approx(0.49, abs=1e-6)
    at, beyond = (motor_duties(e)[0] for e in (50.0, 50.0 + 1e-9))
    assert beyond == pytest.approx(at, abs=1e-6)


def test_song_table_3_does_not_speed_up():
    """At e = 0 both run at full duty: in a slow turn the outer wheel slows, too."""
    assert motor_duties(0.0) == (1.0, 1.0)
    assert motor_duties(25.0) == pytest.approx((0.75, 0.25))
    assert motor_duties(50.0) == pytest.approx((0.5, -0.5))


def test_song_sec_4_2_point_g_compares_r1_with_r3():
    """ "R1 was less than R2 [...] 30 deg to the right": R2 is behind."""
    memory = [1.0, 0.0, 0.0, 0.0]
    turn = song2011_turn((0.5, 0.7, 0.6), (1.5, 1.5), memory)
    assert turn == (30.0, 4, UNDECIDED)
    turn = song2011_turn((0.6, 0.7, 0.5), (1.5, 1.5), memory)
    assert turn == (-30.0, 4, UNDECIDED)


def test_song_table_5_direction_of_sound_is_an_angle():
    """-136 deg of fig. 13 fits no field of two decimals up to 99.99."""
    frame = [0.0] * FRAME_BYTES
    write_frame(frame, 0, 2, 13, -136.0)
    assert read_frame(frame, 0) == (2, 13, -136.0)


def test_song_eq_13_has_six_pairs():
    assert math.comb(4, 2) == 6


def test_song_eq_17_turns_round_where_the_sum_changes_its_sign():
    """3 l^2 / 4 R is 6.7 mm at 2.5 m; a sample at 32 kHz is 10.6 mm."""
    Y = Y_ARM * np.array([[1.0, 0.0], [-0.5, 0.75**0.5], [-0.5, -(0.75**0.5)]])
    source = np.array([2.5, 0.0])
    d = np.linalg.norm(source - Y, axis=1) - 2.5
    assert d.sum() == pytest.approx(3 * Y_ARM**2 / (4 * 2.5), rel=0.03)
    assert d.sum() < 340.0 / 32_000.0
    place, distance = interpolate_sphere(Y, d - 340.0 / 32_000.0 / 3.0)
    assert distance < 0.0
    assert abs(math.degrees(math.atan2(place[1], place[0]))) > 170.0


def test_song_sec_4_3_a_stop_at_20_cm_is_within_both_arms():
    """15 and 20 cm of arms between the centers; and 4 dB make 20 cm 13 to 32 cm."""
    assert Y_ARM + 0.2 > 0.2
    # By eq. 8 with n = 2: the distance is proportional to 10^(-R / 20).
    near, far = (0.2 * 10.0 ** (-db / 20.0) for db in (4.0, -4.0))
    assert (near, far) == pytest.approx((0.126, 0.317), abs=1e-3)


def test_song_sec_4_2_ten_steps_take_longer_than_three_minutes():
    """15 + 2 + 3 s a step."""
    step_s = 15 + 2 + 3
    assert 9 * step_s == 180
    assert 10 * step_s == 200
    assert pytest.approx(0.89, abs=0.01) == 2.0 / (9 * 0.25)  # straightness needed
