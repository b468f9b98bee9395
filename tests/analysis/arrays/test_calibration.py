"""Calibration from delays, against truth and against bounds of their own making."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.calibration import calibrate_array
from analysis.arrays.calibration_misfit import calibration_misfit
from analysis.arrays.calibration_sounds import MeasuredSound
from analysis.arrays.observability import (
    calibration_gains,
    gain_ratios,
    gains_nothing,
)
from analysis.arrays.wave_fronts import wave_front
from systems.framework.input_error import InputError
from tests.analysis.arrays.arrays import (
    LATE_STD,
    NOISE_STD,
    PLACE_STD,
    SIX,
    SPEED_STD,
    SPOT_STD,
    SQUARE,
    TRIANGLE,
    C,
    drawn,
    measured,
    noise_covariance,
    spots_around,
)


def budget(places, std=PLACE_STD):
    return ArrayBudget(std**2 * np.eye(np.size(places)), SPEED_STD, LATE_STD)


def cramer_rao(nominal, spots, *, known=True):
    """(n d + 1, same) bound on places and speed, from arrival times themselves.

    Unknowns: places, speed, lateness and position of each sound, and when each sound
    was made. Slopes by central differences.
    """
    n, d = nominal.shape
    size = nominal.size

    def arrivals(x):
        places, c = x[:size].reshape(n, d), x[size]
        late, rest = x[size + 1 : size + 1 + n], x[size + 1 + n :].reshape(-1, d + 1)
        far = np.linalg.norm(rest[:, np.newaxis, :d] - places, axis=2)
        return (far / c + late + rest[:, d:] * 1e-3).ravel()  # made at ms

    made = np.column_stack((spots, np.zeros(len(spots)))).ravel()
    x = np.concatenate((nominal.ravel(), [C], np.zeros(n), made))
    step = 1e-5
    slopes = np.stack(
        [
            (arrivals(x + step * axis) - arrivals(x - step * axis)) / (2 * step)
            for axis in np.eye(x.size)
        ],
        axis=1,
    )
    information = slopes.T @ slopes / NOISE_STD**2
    prior = np.concatenate(
        (
            np.full(size, PLACE_STD**-2),
            [SPEED_STD**-2],
            np.full(n, LATE_STD**-2),
            np.tile([SPOT_STD**-2 if known else 1e-6] * d + [0.0], len(spots)),
        )
    )
    return np.linalg.inv(information + np.diag(prior))[: size + 1, : size + 1]


@pytest.mark.parametrize("w", [1.0, 0.3, 1e-9, 0.0])
def test_slopes_of_a_wave_front(w):
    rng = np.random.default_rng(1)
    p, h = 0.5 * rng.standard_normal((4, 3)), np.array([2.0, -1.0, 0.7])
    front = wave_front(p, C, h, w)
    if w > 0.1:
        far = np.linalg.norm(h / w - p, axis=1) / C
        np.testing.assert_allclose(front.delays, far[1:] - far[0], atol=1e-15)
    else:
        plane = (p[0] - p[1:]) @ h / np.linalg.norm(h) / C
        np.testing.assert_allclose(front.delays, plane, atol=1e-11)
    step = 1e-5

    def slope(change):
        p2, c2, h2, w2 = change(step)
        p1, c1, h1, w1 = change(-step)
        later, earlier = wave_front(p2, c2, h2, w2), wave_front(p1, c1, h1, w1)
        return (later.delays - earlier.delays) / (2 * step)

    for k in range(p.size):
        move = np.eye(p.size)[k].reshape(p.shape)
        by_place = slope(lambda s, move=move: (p + s * move, C, h, w))
        np.testing.assert_allclose(front.by_places[:, k], by_place, atol=1e-10)
    for k, axis in enumerate(np.eye(3)):
        by_h = slope(lambda s, axis=axis: (p, C, h + s * axis, w))
        np.testing.assert_allclose(front.by_h[:, k], by_h, atol=1e-10)
    np.testing.assert_allclose(
        front.by_w, slope(lambda s: (p, C, h, w + s)), atol=1e-10
    )
    np.testing.assert_allclose(
        front.by_speed, slope(lambda s: (p, C + s, h, w)), atol=1e-10
    )


@pytest.mark.parametrize("nominal", [SQUARE, SIX, SIX[:, :2]], ids=["4", "6", "2-D"])
def test_known_positions_reach_the_bound(nominal):
    """2 cm off to begin with: errors over draws within 1.3 of the bound, and stated."""
    rng = np.random.default_rng(7)
    spots = spots_around(12, rng)[:, : nominal.shape[1]]
    bound = cramer_rao(nominal, spots)
    errors, speeds, stated, chi = [], [], [], []
    for _ in range(60):
        places, c, late = drawn(nominal, rng)
        sounds = measured(places, c, late, spots, rng)
        found = calibrate_array(nominal, C, budget(nominal), sounds)
        assert found.settled
        errors.append((found.places - places).ravel())
        speeds.append(found.c - c)
        stated.append(np.diag(found.covariance)[: nominal.size + 1])
        chi.append(found.chi_square)
    rms = math.sqrt(np.mean(np.square(errors)))
    best = math.sqrt(np.mean(np.diag(bound)[:-1]))
    assert rms == pytest.approx(best, rel=0.2)
    assert math.sqrt(np.mean(np.square(speeds))) < 1.3 * math.sqrt(bound[-1, -1])
    np.testing.assert_allclose(np.mean(stated, axis=0), np.diag(bound), rtol=0.1)
    # As many values as delays: stated positions and geometry count for themselves.
    assert found.freedom == 12 * (len(nominal) - 1)
    assert np.mean(chi) == pytest.approx(found.freedom, rel=0.1)


def test_unknown_positions_reach_the_bound_of_six_microphones():
    """Five delays for three unknowns: the shape is told, where it stands is not."""
    rng = np.random.default_rng(3)
    spots = spots_around(12, rng)
    bound = cramer_rao(SIX, spots, known=False)
    errors = []
    for _ in range(40):
        places, c, late = drawn(SIX, rng)
        sounds = measured(places, c, late, spots, rng, known=False)
        found = calibrate_array(SIX, C, budget(SIX), sounds)
        errors.append((found.places - places).ravel())
    rms = math.sqrt(np.mean(np.square(errors)))
    assert rms == pytest.approx(math.sqrt(np.mean(np.diag(bound)[:-1])), rel=0.3)
    verdicts = {gain.name: gain.verdict for gain in calibration_gains(found)}
    assert verdicts["shape of the array"] == "observable"
    for axis in "xyz":
        assert verdicts[f"shift of the array along {axis}"] == "not observable"
        assert verdicts[f"rotation of the array about {axis}"] == "not observable"


def test_four_microphones_and_unknown_positions_gain_nothing():
    """Three delays for three unknowns, from nine places."""
    rng = np.random.default_rng(4)
    places, c, late = drawn(SQUARE, rng)
    sounds = measured(places, c, late, spots_around(9, rng), rng, known=False)
    found = calibrate_array(SQUARE, C, budget(SQUARE), sounds)
    assert gains_nothing(found)
    assert gain_ratios(found)[0].min() > 0.9
    prior = np.diag(budget(SQUARE).of_places)
    np.testing.assert_allclose(np.diag(found.of_places), prior, rtol=0.05)


def located(places, c, sound, near):
    """Where the delays of a sound fit best, by scipy."""

    def left(spot):
        far = np.linalg.norm(spot - places, axis=1) / c
        return 1e6 * (far[1:] - far[0] - sound.tau)

    return least_squares(left, near, x_scale=0.1).x


def test_left_out_positions_are_found():
    """A planar array of 1.4 m, 2 cm off, and nine surveyed positions.

    Off by decimeters before; within 0.03 m afterwards, at 3 to 5 m.
    """
    rng = np.random.default_rng(5)
    before, after = [], []
    accuracy = {"noise_std": 1e-6, "spot_std": 0.002}
    for _ in range(20):
        places, c, late = drawn(TRIANGLE, rng)
        spots = np.column_stack((rng.uniform(-2, 2, (12, 2)), rng.uniform(3, 5, 12)))
        sounds = measured(places, c, late, spots, rng, **accuracy)
        found = calibrate_array(TRIANGLE, C, budget(TRIANGLE), sounds[:9])
        late_s = found.channel_delays[1:] - found.channel_delays[0]
        for spot, sound in zip(spots[9:], sounds[9:], strict=True):
            before.append(np.linalg.norm(located(TRIANGLE, C, sound, spot) - spot))
            mended = replace(sound, tau=sound.tau - late_s)
            place = located(found.places, found.c, mended, spot)
            after.append(np.linalg.norm(place - spot))
    assert np.median(before) > 0.3
    assert np.median(after) < 0.03


def test_posterior_is_exact_where_all_is_linear():
    """One place unknown along x, far sources on both sides: three Gaussian values."""
    row = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    of_places = np.zeros((6, 6))
    of_places[2, 2] = 0.01**2
    sigma = 2e-5
    far = [np.array([900.0, 0.5]), np.array([-900.0, 0.5])]
    sounds = []
    for spot in far:
        arrival = np.linalg.norm(spot - row, axis=1) / C
        arrival[1] += -0.005 / C * np.sign(spot[0])  # it stands 5 mm farther out
        covariance = sigma**2 * np.eye(2)
        sounds.append(MeasuredSound(arrival[1:] - arrival[0], covariance, spot))
    found = calibrate_array(row, C, ArrayBudget(of_places, 0.0, 0.0), sounds)
    precision = 0.01**-2 + 2 * (C * sigma) ** -2
    assert found.of_places[2, 2] == pytest.approx(1 / precision, rel=1e-5)
    expected = 0.005 * 2 * (C * sigma) ** -2 / precision
    assert found.places[1, 0] - 1.0 == pytest.approx(expected, rel=1e-3)
    np.testing.assert_allclose(found.places[[0, 2]], row[[0, 2]], atol=1e-12)
    assert found.c == C


def test_a_wrong_position_is_named():
    rng = np.random.default_rng(6)
    places, c, late = drawn(SIX, rng)
    spots = spots_around(9, rng)
    sounds = measured(places, c, late, spots, rng)
    assert calibration_misfit(calibrate_array(SIX, C, budget(SIX), sounds)) is None
    wrong = sounds[4]
    sounds[4] = MeasuredSound(
        wrong.tau, wrong.covariance, spots[4] + [0.0, 0.0, 0.3], SPOT_STD
    )
    misfit = calibration_misfit(calibrate_array(SIX, C, budget(SIX), sounds))
    assert misfit is not None
    assert (misfit.kind, misfit.index, misfit.explains) == ("sound", 4, True)


def test_a_microphone_far_off_is_named():
    rng = np.random.default_rng(8)
    places, c, late = drawn(SIX, rng)
    places[2, 1] += 0.2
    sounds = measured(places, c, late, spots_around(9, rng), rng)
    misfit = calibration_misfit(calibrate_array(SIX, C, budget(SIX), sounds))
    assert misfit is not None
    assert (misfit.kind, misfit.index, misfit.explains) == ("microphone", 2, True)


def test_a_late_channel_is_named():
    rng = np.random.default_rng(9)
    places, c, late = drawn(SIX, rng)
    late[3] += 4e-4
    sounds = measured(places, c, late, spots_around(9, rng), rng)
    misfit = calibration_misfit(calibrate_array(SIX, C, budget(SIX), sounds))
    assert misfit is not None
    assert (misfit.kind, misfit.index, misfit.explains) == ("channel", 3, True)


def test_lateness_is_found_where_it_is_expected():
    """Of 0.1 ms, with places known to 1 mm."""
    rng = np.random.default_rng(10)
    late = 1e-4 * rng.standard_normal(6)
    sounds = measured(SIX, C, late, spots_around(9, rng), rng)
    known = ArrayBudget(1e-6 * np.eye(np.size(SIX)), SPEED_STD, 1e-4)
    found = calibrate_array(SIX, C, known, sounds)
    off = found.channel_delays - (late - late.mean())
    assert np.abs(off).max() < 2e-5
    stated = np.sqrt(np.diag(found.covariance)[-6:])
    assert (np.abs(off) < 4 * stated).all()


def test_a_row_has_no_turn_about_itself():
    row = np.array([[0.0, y, 0.0] for y in (-0.4, 0.0, 0.4)])
    rng = np.random.default_rng(11)
    sounds = measured(row, C, np.zeros(3), spots_around(6, rng), rng)
    gains = calibration_gains(calibrate_array(row, C, budget(row), sounds))
    turns = {g.name[-1] for g in gains if g.name.startswith("rotation")}
    assert turns == {"x", "z"}


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ([0.5, 0.47, 0.0], "3.0 cm from microphone 1"),
        ([2000.0, 0.0, 0.0], "at most 1000 m"),
        ([2.0, 1.0], r"give \[x, y, z\], or the microphones as \[x, y\]"),
    ],
)
def test_positions_that_make_no_sense(position, words):
    tau = np.zeros(3)
    sound = MeasuredSound(tau, noise_covariance(4), np.array(position), 0.01)
    with pytest.raises(InputError, match=words):
        calibrate_array(SQUARE, C, budget(SQUARE), [sound])


def test_no_sounds_and_nothing_unknown():
    with pytest.raises(InputError, match="at least one"):
        calibrate_array(SQUARE, C, budget(SQUARE), [])
    sound = MeasuredSound(np.zeros(3), noise_covariance(4), np.array([0.0, 0.0, 2.0]))
    exact = ArrayBudget(0.0 * np.eye(np.size(SQUARE)), 0.0, 0.0)
    with pytest.raises(InputError, match="state how uncertain"):
        calibrate_array(SQUARE, C, exact, [sound])
    with pytest.raises(InputError, match="5 delays"):
        calibrate_array(
            SQUARE, C, budget(SQUARE), [MeasuredSound(np.zeros(5), np.eye(5))]
        )
