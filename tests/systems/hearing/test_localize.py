"""From frames to places: any array, found bands, echoes, and frames with faults."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.random import Generator, Philox

from systems.delays.delay_search import weakest_sound
from systems.delays.delays import look
from systems.hearing import localize
from systems.hearing.localize import HearingMemory, Localizer
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

FS, N, C = 100_000.0, 2500, 340.0
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
SQUARE = ArrayShape.of([[0.2, 0.15], [0.15, -0.15], [-0.15, -0.2], [-0.15, 0.15]])
ANGLES = np.arange(8) * math.pi / 4.0
RING = ArrayShape.of(np.stack((0.3 * np.cos(ANGLES), 0.3 * np.sin(ANGLES)), axis=1))
SHAPES = {"3": ROW, "4": SQUARE, "8": RING}
METHODS = ("gcc", "gcc_phat", "ml", "amdf")


def listener(shape=ROW, **fields):
    return Localizer(TDOAParameters.model_validate(fields), shape, C)


def heard(
    shape,
    places,
    gains=(1.0,),
    *,
    snr_db=25.0,
    seed=0,
    band=(500.0, 8_000.0),
    begin=0,
):
    """(n, N) band noise from one place, and from images of it; noise.

    By shifts of a periodic sound of 0.1 s in the frequency domain, of which the
    second quarter is the frame. The sound begins at a sample of it.
    """
    generator = Generator(Philox(key=seed))
    length = 4 * N
    spectrum = np.fft.rfft(generator.standard_normal(length))
    f = np.fft.rfftfreq(length, 1.0 / FS)
    spectrum[(f < band[0]) | (f > band[1])] = 0.0
    if begin:
        onset = np.clip((np.arange(length) - begin) / 200.0, 0.0, 1.0)
        spectrum = np.fft.rfft(onset * np.fft.irfft(spectrum, length))
    rows = np.zeros((shape.count, N))
    for place, gain in zip(places, gains, strict=True):
        ranges = np.linalg.norm(np.asarray(place) - shape.p_AM, axis=1)
        turns = np.exp(-2j * np.pi * np.outer(ranges / C, f))
        waves = np.fft.irfft(spectrum * turns, length) / ranges[:, None]
        rows += gain * waves[:, N : 2 * N]
    level = rows.std() * 10.0 ** (-snr_db / 20.0)
    return (rows + level * generator.standard_normal(rows.shape)).astype(np.float32)


def polar(bearing_deg, distance):
    angle = math.radians(bearing_deg)
    return distance * np.array([math.cos(angle), math.sin(angle)])


def off(fix, place):
    """Error of the position over its stated covariance, as a chi-square."""
    error = fix.p_AS - place
    return float(error @ np.linalg.solve(fix.covariance, error))


@pytest.mark.parametrize("name", SHAPES)
@given(st.floats(-70.0, 70.0), st.floats(0.8, 2.5), st.integers(0, 99))
@settings(max_examples=25)
def test_any_number_of_microphones(name, bearing_deg, distance, seed):
    """Within five of the stated standard deviations (chi-square of 2: 29 is 5e-7)."""
    place = polar(bearing_deg, distance)
    localizer = listener(SHAPES[name])
    frame = heard(SHAPES[name], [place], seed=seed)
    fix, _ = localizer.localize(frame, localizer.blank())
    assert fix is not None
    assert fix.bearing == pytest.approx(math.atan2(place[1], place[0]), abs=0.01)
    if fix.range_valid:
        assert off(fix, place) < 29.0


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("band", [(500.0, 8_000.0), (1_000.0, 3_500.0)])
def test_a_found_band_gives_the_place_of_the_set_band(shape, band):
    place = polar(-35.0, 1.6)
    found, known = (
        listener(shape, band_hz="found"),
        listener(shape, band_hz=band),
    )
    for seed in range(5):
        frame = heard(shape, [place], seed=seed, band=band)
        one, _ = found.localize(frame, found.blank())
        other, _ = known.localize(frame, known.blank())
        assert one is not None
        assert other is not None
        assert one.bearing == pytest.approx(other.bearing, abs=0.5 * other.bearing_std)
        assert off(one, place) < 29.0


def test_a_found_band_leaves_out_what_holds_noise_alone():
    """Whitened, every bin counts alike: 86 % of those of the set band are noise."""
    errors = []
    for band in ((300.0, 15_000.0), "found"):
        localizer = listener(method="gcc_phat", band_hz=band)
        memory = after_noise(localizer)
        fixes = [
            localizer.localize(
                heard(ROW, [polar(20.0, 1.5)], seed=seed, band=(2_000.0, 4_000.0)),
                memory,
            )[0]
            for seed in range(30)
        ]
        bearings = [fix.bearing for fix in fixes if fix is not None]
        assert len(bearings) == 30
        errors.append(np.std(bearings))
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize(
    ("fields", "rate_hz"),
    [
        ({}, FS / 2.0),
        ({"method": "ml", "band_hz": (300.0, 8_000.0)}, FS / 2.0),
        ({"band_hz": (300.0, 20_000.0)}, FS),  # half the rate would not hold it
        ({"method": "amdf"}, FS),  # whole samples of the converter
    ],
)
def test_frames_are_heard_at_half_their_rate_where_that_will_do(fields, rate_hz):
    assert listener(**fields).plan.sample_rate_hz == rate_hz


def after_noise(localizer):
    """Its memory after some frames of noise."""
    memory, generator = localizer.blank(), Generator(Philox(key=5))
    for _ in range(8):
        noise = 0.01 * generator.standard_normal((3, N))
        _, memory = localizer.localize(noise.astype(np.float32), memory)
    return memory


def test_the_louder_image_in_a_wall_is_not_the_source():
    """A wall 2.2 m beside the array that focuses; its image comes 3 ms later.

    By the correlation of the whole frame it would win.
    """
    place, image = polar(30.0, 1.5), np.array([1.3, -2.25])
    localizer, unaware = listener(), listener(suppress_echoes=False)
    places_of_the_unaware = 0
    for seed in range(20):
        frame = heard(
            ROW, [place, image], gains=(1.0, 2.0), seed=seed, snr_db=30.0, begin=N + 100
        )
        fix, _ = localizer.localize(frame, localizer.blank())
        assert fix is not None
        assert fix.bearing == pytest.approx(math.radians(30.0), abs=math.radians(1.0))
        other, _ = unaware.localize(frame, unaware.blank())
        if other is not None:
            places_of_the_unaware += 1
            assert abs(math.degrees(other.bearing) - 30.0) > 30.0
    assert places_of_the_unaware == 1


def test_a_sound_that_two_of_three_hear_yet_is_no_place():
    """The third would say what its noise says, anywhere."""
    localizer = listener()
    spectrum = np.fft.rfft(Generator(Philox(key=1)).standard_normal(N))
    spectrum[np.fft.rfftfreq(N, 1.0 / FS) > 8_000.0] = 0.0
    sound = 10.0 * np.fft.irfft(spectrum, N)[:170]
    memory, generator = localizer.blank(), Generator(Philox(key=2))
    for _ in range(8):
        noise = generator.standard_normal((3, N)).astype(np.float32)
        _, memory = localizer.localize(noise, memory)
    careless = 0
    for _ in range(60):
        frame = generator.standard_normal((3, N)).astype(np.float32)
        frame[0, -170:] += sound
        frame[1, -70:] += sound[:70]
        assert localizer.localize(frame, memory)[0] is None
        fix, _ = localizer.localize(frame, memory._replace(heard=True))
        careless += fix is not None
    assert careless > 0


def test_noise_between_sounds_becomes_the_memory():
    """The running mean is that of the frames' own energies, by Parseval."""
    localizer, memory = listener(), listener().blank()
    generator = Generator(Philox(key=6))
    for _ in range(40):
        noise = 3.0 * generator.standard_normal((3, N)).astype(np.float32)
        fix, memory = localizer.localize(noise, memory)
        assert fix is None
    share = (15_000.0 - 300.0) / (FS / 2.0)
    # Half of the energy: the transform's positive frequencies. Three deviations: the
    # first frame, whose own is 3 %, decides on the share of the band.
    expected = 0.5 * 9.0 * localizer.plan.frame_samples * share
    assert memory.noise_energy == pytest.approx(expected, rel=0.1)
    assert memory.echoes is None


def test_a_knock_raises_the_level_of_the_noise_by_a_sixteenth():
    """As a noise of 1.5 times the level would: half of it over eight frames."""
    localizer = listener()
    before = after_noise(localizer)
    knock = 10.0 * Generator(Philox(key=9)).standard_normal((3, N))
    fix, after = localizer.localize(knock.astype(np.float32), before)
    assert fix is None
    assert after.noise_energy == pytest.approx(17 / 16 * before.noise_energy)
    assert after.energy == pytest.approx(17 / 16 * before.energy)


def searched_share(monkeypatch, localizer, sound_level, frames=400):
    """Of frames of noise, and of a sound in the band so far above it, in variance.

    After frames of noise have told its level.
    """
    calls = []

    def counted(frame, *args, **kwargs):
        calls.append(frame)
        return look(frame, *args, **kwargs)

    monkeypatch.setattr(localize, "look", counted)
    generator = Generator(Philox(key=12))
    f = np.fft.rfftfreq(N, 1.0 / FS)
    outside = (f < 300.0) | (f > 15_000.0)
    memory = localizer.blank()
    for k in range(60 + frames):
        spectrum = np.fft.rfft(generator.standard_normal(N))
        spectrum[outside] = 0.0
        sound = math.sqrt(sound_level) * np.fft.irfft(spectrum, N)
        noise = generator.standard_normal((3, N))
        if k < 60:
            _, memory = localizer.localize(noise.astype(np.float32), memory)
            calls.clear()
        else:
            localizer.localize((sound + noise).astype(np.float32), memory)
    return len(calls) / frames


def test_noise_is_hardly_ever_searched(monkeypatch):
    """Its energy scatters by sqrt(2 / 7500), 1.6 %; the weakest sound adds 6.7 %.

    Less 2.33 deviations that is 1.8 of them above the noise, which 4 % exceed.
    """
    assert 0.005 < searched_share(monkeypatch, listener(), 0.0) < 0.1


def test_99_percent_of_the_weakest_sounds_are_searched(monkeypatch):
    localizer = listener()
    weakest = weakest_sound(localizer.plan, 1e-7)
    assert searched_share(monkeypatch, localizer, weakest) >= 0.98
    assert searched_share(monkeypatch, listener(band_hz="found"), weakest) >= 0.98


def test_rumble_does_not_keep_a_sound_from_being_searched(monkeypatch):
    """In the band it may have a thousand times the energy that counts as loud."""
    frame = heard(ROW, [polar(10.0, 1.0)])
    localizer = listener()
    _, first = localizer.localize(1e-3 * frame, localizer.blank())
    assert first.heard
    quiet = HearingMemory(energy=0.7 * float(np.sum(frame**2.0)), noise_energy=1e12)
    calls = []
    monkeypatch.setattr(localize, "look", lambda *a, **k: calls.append(1))
    localizer.localize(frame, quiet)
    assert calls


def test_echoes_are_remembered_until_the_noise_is_louder():
    """They fall by exp(-0.5) a frame, from a thousand times the least to it."""
    localizer = listener()
    frame = np.random.default_rng(0).standard_normal((3, N)).astype(np.float32)
    memory = HearingMemory(3.0 * N, 0.15 * N)
    least = localizer._sizes.least(localizer._noise_density(memory))
    echoes = np.full(localizer.full().echoes.shape, 1e3 * least, dtype=np.float32)
    memory, frames = memory._replace(echoes=echoes), 0
    while memory.echoes is not None:
        _, memory = localizer.localize(np.float32(0.9) * frame, memory)
        frames += 1
    # The level of the noise falls, too, which takes them a little longer.
    assert math.log(1e3) / 0.5 <= frames <= math.log(1e3) / 0.5 + 3


def test_a_sound_leaves_the_level_of_the_noise_alone():
    localizer = listener()
    before = HearingMemory(456.0, 123.0)
    fix, after = localizer.localize(heard(ROW, [polar(10.0, 1.0)]), before)
    assert fix is not None
    assert after.noise_energy == 123.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_frame_that_is_not_finite_is_refused(method, value):
    localizer = listener(method=method)
    frame = heard(ROW, [polar(10.0, 1.0)])
    frame[1, 777] = value
    with pytest.raises(
        ValueError, match=r"audio: channel 2: sample 777 is -?(nan|inf)"
    ):
        localizer.localize(frame, localizer.blank())


@pytest.mark.parametrize("shape", [(2, N), (4, N), (3, N - 1), (N, 3)])
def test_a_frame_of_another_array_is_refused(shape):
    localizer = listener()
    with pytest.raises(ValueError, match="3 microphones, of 2500 samples"):
        localizer.localize(np.ones(shape, dtype=np.float32), localizer.blank())


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("method", METHODS)
def test_a_silent_or_foreign_channel_gives_no_place(name, method):
    shape = SHAPES[name]
    localizer = listener(shape, method=method)
    generator = Generator(Philox(key=7))
    good = heard(shape, [polar(25.0, 1.5)])
    noise = good.std() * generator.standard_normal(N).astype(np.float32)
    for k in range(shape.count):
        for channel in (np.zeros(N), np.full(N, 7.0), noise):
            frame = good.copy()
            frame[k] = channel
            fix, memory = localizer.localize(frame, localizer.blank())
            assert fix is None
            assert memory.echoes is None
            assert math.isfinite(memory.noise_energy)


@pytest.mark.parametrize("name", SHAPES)
def test_an_inverted_channel_gives_no_wrong_place(name):
    shape = SHAPES[name]
    localizer = listener(shape)
    for seed in range(5):
        place = polar(-60.0 + 25.0 * seed, 1.5)
        for k in range(shape.count):
            frame = heard(shape, [place], seed=seed)
            right, _ = localizer.localize(frame, localizer.blank())
            assert right is not None
            frame[k] *= -1.0
            inverted, _ = localizer.localize(frame, localizer.blank())
            assert inverted is None


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("limit", [0.1, 0.3, 0.7])
def test_clipping_costs_little(name, limit):
    """Both sides of all channels cut; to a tenth it is nearly a square wave."""
    shape, place = SHAPES[name], polar(25.0, 1.5)
    localizer = listener(shape)
    for seed in range(5):
        frame = heard(shape, [place], seed=seed)
        top = limit * np.abs(frame).max()
        fix, _ = localizer.localize(np.clip(frame, -top, top), localizer.blank())
        assert fix is not None
        assert fix.bearing == pytest.approx(math.radians(25.0), abs=math.radians(0.2))


@pytest.mark.parametrize(
    ("pair", "taken_for_places"), [((0, 1), 0), ((0, 3), 0), ((1, 2), 1), ((2, 3), 0)]
)
def test_exchanged_neighbors_of_four_give_no_wrong_place(pair, taken_for_places):
    """Opposite ones mirror the array, which nothing tells."""
    localizer = listener(SQUARE)
    errors = []
    for seed in range(12):
        place = polar(-165.0 + 30.0 * seed, 1.5)
        frame = heard(SQUARE, [place], seed=seed)
        right, _ = localizer.localize(frame, localizer.blank())
        assert right is not None
        frame[list(pair)] = frame[list(pair[::-1])]
        fix, _ = localizer.localize(frame, localizer.blank())
        if fix is not None:
            errors.append(
                math.remainder(fix.bearing - math.atan2(*place[::-1]), math.tau)
            )
    assert len(errors) == taken_for_places
    assert max(map(abs, errors), default=0.0) < math.radians(5.0)


@pytest.mark.parametrize("pair", [(0, 3), (1, 2)])
def test_delays_that_do_not_fit_together_betray_exchanged_neighbors(pair):
    """Without that check the frames of the test above give bearings that are off."""
    localizer = Localizer(TDOAParameters(), SQUARE, C, limited=False)
    wrong = 0
    for seed in range(12):
        place = polar(-165.0 + 30.0 * seed, 1.5)
        frame = heard(SQUARE, [place], seed=seed)
        frame[list(pair)] = frame[list(pair[::-1])]
        fix, _ = localizer.localize(frame, localizer.blank())
        if fix is not None:
            error = math.remainder(fix.bearing - math.atan2(*place[::-1]), math.tau)
            wrong += abs(error) > math.radians(5.0)
    assert wrong >= 3


def test_noise_puts_no_source_at_a_tiny_array():
    """6 mm across: delays a little too long fit a source between the microphones."""
    shape = ArrayShape.of([[0.002, 0.002], [-0.002, 0.002], [-0.002, -0.002]])
    localizer = listener(shape)
    heard_ones = 0
    for seed in range(30):
        place = polar(-60.0 + 4.0 * seed, 2.0)
        fix, _ = localizer.localize(
            heard(shape, [place], seed=seed, snr_db=30.0), localizer.blank()
        )
        if fix is not None:
            heard_ones += 1
            assert not fix.range_valid
            error = fix.bearing - math.atan2(place[1], place[0])
            assert abs(error) < 5.0 * fix.bearing_std
    assert heard_ones > 10


def test_a_range_too_uncertain_is_left_out(monkeypatch):
    frame = heard(ROW, [polar(10.0, 2.0)], snr_db=15.0)
    localizer = listener()
    for share, valid in ((0.25, True), (1e-5, False)):
        monkeypatch.setattr(localize, "_LARGEST_RANGE_STD", share)
        fix, _ = localizer.localize(frame, localizer.blank())
        assert fix is not None
        assert fix.range_valid == valid


COPIES = {
    "1 is 2": lambda x: x[[0, 0, 2]],
    "2 is 3": lambda x: x[[0, 1, 1]],
    "1 is 3": lambda x: x[[0, 1, 0]],
    "all": lambda x: x[[0, 0, 0]],
    "gain": lambda x: np.stack((x[0], np.rint(0.7 * x[0]).astype(np.int16), x[2])),
}


@pytest.mark.parametrize("bearing_deg", [0.0, 30.0, -50.0, 60.0])
def test_channels_that_repeat_each_other_are_no_place(bearing_deg):
    """An amplifier's two outputs of one microphone, counts of 10 bits."""
    localizer = listener()
    place = polar(bearing_deg, 1.5)
    frame = heard(ROW, [place])
    counts = np.rint(frame * (400.0 / np.abs(frame).max())).astype(np.int16)
    noise = np.rint(2.0 * np.random.default_rng(1).standard_normal((3, N)))
    _, memory = localizer.localize(noise.astype(np.int16), localizer.blank())
    fix, _ = localizer.localize(counts, memory._replace(heard=True))
    assert fix is not None
    assert fix.bearing == pytest.approx(math.radians(bearing_deg), abs=0.02)
    for name, copy in COPIES.items():
        assert localizer.localize(copy(counts), memory)[0] is None, name
        # Before any noise was heard, equal ends of the row are a source ahead.
        if name != "1 is 3":
            assert localizer.localize(copy(counts), localizer.blank())[0] is None, name


def test_without_noise_a_source_ahead_is_heard_alike_at_both_ends():
    localizer = listener()
    frame = heard(ROW, [polar(0.0, 1.5)], snr_db=200.0)
    counts = np.rint(frame * (400.0 / np.abs(frame).max())).astype(np.int16)
    counts[2] = counts[0]
    fix, _ = localizer.localize(counts, localizer.blank())
    assert fix is not None
    assert fix.range == pytest.approx(1.5, rel=0.05)
