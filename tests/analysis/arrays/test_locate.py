"""Recordings of a known source, in arrays that stand anywhere."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
import soundfile

from analysis.arrays.array_geometry import ArrayGeometry, load_geometry
from analysis.arrays.locate_text import locate_text
from phonotaxis import locate

C = 340.0
ROBOT = np.array([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])


def band_noise(rng, length, low, high, rate):
    """Complex amplitudes of a periodic signal, unit RMS."""
    f = np.fft.rfftfreq(length, 1 / rate)
    inside = (f >= low) & (f <= high)
    spectrum = np.zeros(len(f), dtype=complex)
    spectrum[inside] = np.exp(2j * np.pi * rng.random(inside.sum()))
    return spectrum * length / math.sqrt(2 * inside.sum()), f


def record(
    path, places, source, *, rate=48_000, seconds=0.5, high=8_000.0, snr_db=40.0, c=C
):
    """Writes what microphones at these places hear of a resting source."""
    rng = np.random.default_rng(3)
    length = round(seconds * rate)
    spectrum, f = band_noise(rng, length, 500.0, min(high, 0.42 * rate), rate)
    ranges = np.linalg.norm(np.asarray(source) - places, axis=1)
    rows = [
        np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * r / c), length) / r
        for r in ranges
    ]
    level = 10 ** (-snr_db / 20) / ranges.mean()
    samples = np.array(rows) + level * rng.standard_normal((len(places), length))
    soundfile.write(path, 0.1 * samples.T, rate, subtype="PCM_24")
    return path


def polar(bearing_deg, distance):
    angle = math.radians(bearing_deg)
    return distance * np.array([math.cos(angle), math.sin(angle)])


def geometry(folder, text):
    path = folder / "geometry.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("rate", [8_000, 16_000, 44_100, 96_000, 192_000])
@pytest.mark.parametrize("bearing", [25.0, -40.0])
def test_robots_own_array(tmp_path, rate, bearing):
    path = record(tmp_path / "a.wav", ROBOT, polar(bearing, 1.5), rate=rate)
    result = locate(path)
    summary = result.main_source()
    # 8 kHz leaves 3.4 of the 8 kHz, and range is the more sensitive.
    accuracy = 0.05 if rate == 8_000 else 0.01
    assert summary["bearing_deg"] == pytest.approx(bearing, abs=20 * accuracy)
    assert summary["range_m"] == pytest.approx(1.5, rel=3 * accuracy)
    assert summary["observable"] == ["bearing", "range"]
    assert len(result.estimates) >= 0.9 * result.frames > 0


def test_flac_is_the_same_as_wav(tmp_path):
    wav = record(tmp_path / "a.wav", ROBOT, polar(10.0, 1.0))
    samples, rate = soundfile.read(wav, dtype="int32")
    soundfile.write(tmp_path / "a.flac", samples, rate, subtype="PCM_24")
    assert locate(tmp_path / "a.flac").estimates == locate(wav).estimates


@pytest.mark.parametrize("turn_deg", [0.0, 30.0, 85.0, -60.0])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_any_place_orientation_and_order(tmp_path, turn_deg, order):
    """The answer depends on where the microphones stand, not on their wires."""
    turn = math.radians(turn_deg)
    matrix = np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    )
    places = 0.6 * ROBOT @ matrix.T + [3.0, -2.0]
    source = matrix @ polar(20.0, 1.2) + [3.0, -2.0]
    path = record(tmp_path / "a.wav", places[list(order)], source)
    known = array(places[list(order)])
    summary = locate(path, known).main_source()
    assert summary["bearing_deg"] == pytest.approx(20.0 + turn_deg, abs=0.2)
    assert summary["range_m"] == pytest.approx(1.2, rel=0.02)
    assert summary["ambiguity"] == "front_back"
    mirrored = math.radians(summary["alternatives"][0]["bearing_deg"])
    # Mirrored at the row, the source has the same three distances.
    image = 1.2 * np.array([math.cos(mirrored), math.sin(mirrored)]) + [3.0, -2.0]
    np.testing.assert_allclose(
        np.linalg.norm(image - places, axis=1),
        np.linalg.norm(source - places, axis=1),
        atol=0.01,
    )


def test_row_along_x_looks_to_plus_y(tmp_path):
    places = ROBOT[:, ::-1].copy()
    path = record(tmp_path / "a.wav", places, polar(70.0, 1.5))
    known = array(places)
    assert locate(path, known).main_source()["bearing_deg"] == pytest.approx(
        70.0, abs=0.2
    )


def test_channels_name_the_columns(tmp_path):
    """Five channels, of which 4, 0 and 2 are the robot's microphones."""
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5))
    samples, rate = soundfile.read(path)
    columns = np.random.default_rng(1).standard_normal((len(samples), 5)) * 0.01
    columns[:, [4, 0, 2]] = samples
    soundfile.write(tmp_path / "b.wav", columns, rate, subtype="PCM_24")
    text = "microphones: [[0, 0.4], [0, 0], [0, -0.4]]\nchannels: [4, 0, 2]\n"
    result = locate(tmp_path / "b.wav", load_geometry(geometry(tmp_path, text)))
    assert result.main_source()["bearing_deg"] == pytest.approx(25.0, abs=0.1)
    assert result.document()["array"]["channels"] == [4, 0, 2]


@pytest.mark.parametrize(
    ("line", "c"), [("sound_speed: 350", 350.0), ("temperature_c: 30", 349.5)]
)
def test_speed_of_sound_is_used(tmp_path, line, c):
    path = record(tmp_path / "a.wav", ROBOT, polar(40.0, 1.5), c=c)
    text = f"microphones: [[0, 0.4], [0, 0], [0, -0.4]]\n{line}\n"
    text += "position_std_m: 0.001\n"
    summary = locate(path, load_geometry(geometry(tmp_path, text))).main_source()
    assert summary["bearing_deg"] == pytest.approx(40.0, abs=0.1)
    assert summary["range_m"] == pytest.approx(1.5, rel=0.02)


def test_three_dimensional_places_of_a_level_row(tmp_path):
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5))
    text = "microphones: [[0, 0.4, 1], [0, 0, 1], [0, -0.4, 1]]\n"
    result = locate(path, load_geometry(geometry(tmp_path, text)))
    assert result.main_source()["bearing_deg"] == pytest.approx(25.0, abs=0.1)
    assert result.estimates[0].elevation_deg is None


ARRAYS = {
    "circle": [
        [0.1 * math.cos(a), 0.1 * math.sin(a)] for a in 2 * np.pi * np.arange(6) / 6
    ],
    "unequal row": [[0.0, 0.0], [0.05, 0.0], [0.15, 0.0], [0.35, 0.0]],
    "level square": [
        [0.02, 0.02, 1],
        [-0.02, 0.02, 1],
        [-0.02, -0.02, 1],
        [0.02, -0.02, 1],
    ],
    "tetrahedron": [[0.1, 0.1, 0.1], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]],
    "across a room": [
        [0, 0, 0],
        [1.2, 0, 0.1],
        [1.1, 1, 0.5],
        [0.1, 0.9, 1],
        [0.6, 0.4, 1.3],
    ],
}


def array(places):
    return ArrayGeometry.model_validate(
        {
            "microphones": [list(map(float, p)) for p in places],
            "position_std_m": 0.0005,
            "sound_speed_std": 1.0,
        }
    )


@pytest.mark.parametrize(
    ("name", "bearing", "elevation", "distance", "range_known"),
    [
        ("circle", -160.0, 0.0, 0.5, True),
        ("circle", 75.0, 25.0, 5.0, False),
        ("unequal row", 60.0, 0.0, 1.0, True),
        ("level square", 175.0, 30.0, 2.0, False),
        ("tetrahedron", -120.0, -35.0, 2.0, False),
        ("across a room", 20.0, 10.0, 0.7, True),
        ("across a room", 130.0, -20.0, 3.0, True),
    ],
)
def test_arrays_of_any_shape(tmp_path, name, bearing, elevation, distance, range_known):
    places = np.array(ARRAYS[name])
    level = distance * math.cos(math.radians(elevation))
    height = distance * math.sin(math.radians(elevation))
    p_AS = np.array([*polar(bearing, level), height])
    # Positions in the plane: the source's height is not in the geometry.
    heard_by = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    source = heard_by.mean(axis=0) + p_AS
    path = record(tmp_path / "a.wav", heard_by, source, rate=16_000, high=6_000.0)
    summary = locate(path, array(places)).main_source()
    assert summary["bearing_deg"] == pytest.approx(bearing, abs=0.3)
    if places.shape[1] == 3:
        assert summary["elevation_deg"] == pytest.approx(elevation, abs=0.5)
    else:
        assert summary["elevation_deg"] is None
    if range_known:
        assert summary["range_m"] == pytest.approx(distance, rel=0.05)
    else:
        assert summary["range_m"] is None
    assert ("range" in summary["observable"]) == range_known


@pytest.mark.parametrize(("count", "dimension"), [(48, 2), (35, 3)])
def test_many_microphones(tmp_path, count, dimension):
    places = np.random.default_rng(11).uniform(-0.15, 0.15, (count, dimension))
    source = np.array([*polar(-70.0, 2.0), 0.5][:dimension])
    path = record(tmp_path / "a.wav", places, source, rate=16_000, seconds=0.25)
    p_AS = source - places.mean(axis=0)
    summary = locate(path, array(places)).main_source()
    bearing = math.degrees(math.atan2(p_AS[1], p_AS[0]))
    assert summary["bearing_deg"] == pytest.approx(bearing, abs=0.3)


def test_upright_row_tells_the_elevation_alone(tmp_path):
    places = np.array([[0, 0, 0.0], [0, 0, 0.1], [0, 0, 0.25]])
    source = places.mean(axis=0) + 3.0 * np.array([0.6, 0.0, 0.8])
    path = record(tmp_path / "a.wav", places, source)
    result = locate(path, array(places))
    summary = result.main_source()
    assert summary["bearing_deg"] is None
    assert summary["elevation_deg"] == pytest.approx(53.13, abs=0.5)
    assert "bearing" not in summary["observable"]
    json.dumps(result.document(), allow_nan=False)
    assert "elevation 53" in locate_text(result)


def test_stated_errors_are_those_of_the_estimates(tmp_path):
    """In the free field: scatter and error of many stretches, within a third."""
    places = np.array(ARRAYS["circle"])
    path = record(tmp_path / "a.wav", places, polar(40.0, 8.0), seconds=12.0, snr_db=10)
    estimates = locate(path, array(places)).estimates
    assert len(estimates) > 150
    errors = np.array([e.bearing_deg for e in estimates]) - 40.0
    # The array is exact: what is stated beside the errors of the array.
    stated = np.sqrt(
        np.mean(
            [
                (e.bearing_std_deg or math.nan) ** 2
                - (e.bearing_systematic_deg or math.nan) ** 2
                for e in estimates
            ]
        )
    )
    assert stated == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.35)


def test_source_on_the_move(tmp_path):
    """30 deg/s round a circle of microphones, at 2 m."""
    rate, rng = 16_000, np.random.default_rng(6)
    places = np.array(ARRAYS["circle"])
    time = np.arange(4 * rate) / rate
    angle = np.radians(150.0 + 30.0 * time)
    spectrum, _ = band_noise(rng, time.size, 500.0, 6_000.0, rate)
    source = np.fft.irfft(spectrum, time.size)
    p_AS = 2.0 * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    heard = np.array(
        [
            np.interp(time - np.linalg.norm(p_AS - p, axis=1) / C, time, source)
            for p in places
        ]
    )
    heard += 0.03 * rng.standard_normal(heard.shape)
    soundfile.write(tmp_path / "a.wav", 0.1 * heard.T, rate, subtype="PCM_24")
    estimates = locate(tmp_path / "a.wav", array(places)).estimates
    assert len(estimates) > 40
    for e in estimates:
        # Sound takes 6 ms to come, in which the source moves by 0.2 deg.
        assert e.bearing_deg is not None
        off = e.bearing_deg - (150.0 + 30.0 * (e.t_s - 2.0 / C))
        assert abs((off + 180.0) % 360.0 - 180.0) < 2.0


def test_sound_from_all_around_has_no_bearing(tmp_path):
    """Uncorrelated plane waves from 300 directions of space."""
    rate, rng = 16_000, np.random.default_rng(8)
    length = 4 * rate
    places = np.array(ARRAYS["level square"])
    f = np.fft.rfftfreq(length, 1.0 / rate)
    heard = np.zeros((4, f.size), dtype=complex)
    for _ in range(300):
        u = rng.standard_normal(3)
        u /= np.linalg.norm(u)
        wave = np.fft.rfft(rng.standard_normal(length))
        heard += wave * np.exp(2j * np.pi * f * (places @ u)[:, None] / C)
    samples = 0.005 * np.fft.irfft(heard, length)
    soundfile.write(tmp_path / "a.wav", samples.T, rate, subtype="PCM_24")
    assert locate(tmp_path / "a.wav", array(places)).estimates == []


def altered(path, change):
    """The recording with its (samples, channels) changed."""
    samples, rate = soundfile.read(path)
    soundfile.write(path, change(samples), rate, subtype="PCM_24")
    return path


def test_dead_and_exchanged_channels_are_refused(tmp_path):
    places = np.array(ARRAYS["unequal row"])
    path = record(tmp_path / "a.wav", places, polar(60.0, 2.0))
    with pytest.raises(ValueError, match=r"recording: .*channel 2: dead"):
        locate(altered(path, lambda x: x * [1, 0, 1, 1]), array(places))
    record(path, places, polar(60.0, 2.0))
    with pytest.raises(ValueError, match="channels 2 and 3: exchanged"):
        locate(altered(path, lambda x: x[:, [0, 2, 1, 3]]), array(places))


def test_inverted_channel_is_mended_and_named(tmp_path):
    places = np.array(ARRAYS["circle"])
    path = record(tmp_path / "a.wav", places, polar(60.0, 2.0))
    summary = locate(
        altered(path, lambda x: x * [1, 1, -1, 1, 1, 1]), array(places)
    ).main_source()
    assert summary["bearing_deg"] == pytest.approx(60.0, abs=0.3)
    (fault,) = summary["faults"]
    assert (fault["kind"], fault["channels"]) == ("inverted", (2,))
    assert "channel 3" in fault["message"]


def test_clipped_channel_is_named(tmp_path):
    places = np.array(ARRAYS["circle"])
    path = record(tmp_path / "a.wav", places, polar(60.0, 2.0))
    limit = [1, 1, 1, 1, 1, 0.02]
    result = locate(altered(path, lambda x: np.clip(x, -1, limit)), array(places))
    assert [f.kind for f in result.faults] == ["clipped"]
    assert "channel 6: clipped" in result.faults[0].message
    # The command names faults on standard error, once.
    assert "clipped" not in locate_text(result)
    assert result.main_source()["bearing_deg"] == pytest.approx(60.0, abs=1.0)


def test_channels_that_are_counted_from_one(tmp_path):
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5))
    with pytest.raises(ValueError, match=r"3 channels, numbers 0 to 2.*names 3"):
        locate(path, ArrayGeometry(channels=(1, 2, 3)))


def test_copied_channel_is_refused(tmp_path):
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5))
    with pytest.raises(ValueError, match="channels 1 and 2: their samples are equal"):
        locate(altered(path, lambda x: x[:, [0, 0, 2]]))


def test_digital_silence_around_a_sound(tmp_path):
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5))

    def padded(samples):
        return np.pad(samples, ((5 * 48_000, 48_000), (0, 0)))

    result = locate(altered(path, padded))
    assert result.main_source()["bearing_deg"] == pytest.approx(25.0, abs=0.1)
    half = result.array["frame_s"] / 2.0
    for estimate in result.estimates:
        assert 5.0 - half <= estimate.t_s <= 5.5 + half


@pytest.mark.parametrize("places", [ROBOT, [*polar(60.0, 0.15)[None], *ROBOT]])
@pytest.mark.parametrize("distance", [0.02, 0.1, 0.15])
def test_source_amid_the_array_is_at_no_other_place(tmp_path, places, distance):
    places = np.array(places) - np.mean(places, axis=0)
    path = record(tmp_path / "a.wav", places, polar(40.0, distance))
    assert locate(path, array(places)).estimates == []


@pytest.mark.parametrize("height", [0.0, 1.0])
def test_source_right_above_a_flat_array_has_no_bearing(tmp_path, height):
    places = np.array(ARRAYS["circle"])
    path = record(tmp_path / "a.wav", np.pad(places, ((0, 0), (0, 1))), (0, 0, height))
    assert locate(path, array(places)).main_source()["bearing_deg"] is None


def test_uneven_array_near_a_source_knows_what_curvature_costs(tmp_path):
    """Four microphones in space: their delays cannot tell it from another c."""
    places = 0.1 * np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    source = np.array([*polar(100.0, 2.0), 1.0])
    path = record(tmp_path / "a.wav", places, source)
    known = array(places).model_copy(update={"sound_speed_std": 0.01 * C})
    summary = locate(path, known).main_source()
    assert summary["range_m"] is None
    error = abs(summary["bearing_deg"] - 100.0)
    assert 0.5 < error < 2.0 * summary["bearing_std_deg"]


def test_far_source_has_no_range(tmp_path):
    """At 10 km the range's standard deviation exceeds the range."""
    path = record(tmp_path / "a.wav", ROBOT, polar(30.0, 1e4), snr_db=10.0)
    result = locate(path)
    summary = result.main_source()
    assert summary["bearing_deg"] == pytest.approx(30.0, abs=0.5)
    assert summary["range_m"] is None
    assert summary["observable"] == ["bearing"]
    assert len(result.estimates) >= 5
    assert all(estimate.range_m is None for estimate in result.estimates)


def test_noise_has_no_bearing(tmp_path):
    noise = np.random.default_rng(2).standard_normal((24_000, 3)) * 0.1
    soundfile.write(tmp_path / "a.wav", noise, 48_000)
    document = locate(tmp_path / "a.wav").document()
    assert document["estimates"] == []
    assert document["summary"]["bearing_deg"] is None
    assert document["summary"]["observable"] == []
    assert "nothing to locate" in locate_text(locate(tmp_path / "a.wav"))


def test_document_has_the_keys_that_others_rely_on(tmp_path):
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5))
    result = locate(path)
    document = json.loads(json.dumps(result.document(), allow_nan=False))
    assert document["schema_version"] == 2
    assert {"array", "estimates", "summary"} <= document.keys()
    assert {
        "t_s",
        "bearing_deg",
        "bearing_std_deg",
        "elevation_deg",
        "range_m",
        "range_std_m",
    } <= document["estimates"][0].keys()
    assert {"bearing_deg", "elevation_deg", "range_m", "observable", "ambiguity"} <= (
        document["summary"].keys()
    )
    times = [estimate["t_s"] for estimate in document["estimates"]]
    assert times[0] == pytest.approx(document["array"]["frame_s"] / 2, abs=1e-3)
    assert times == sorted(times)
    assert re.search(r"bearing (24\.9|25\.0)", locate_text(result))


SMALL_SQUARE = 0.02285 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (100.0, r"an array of 6.46 m can have; give positions in m \(divide"),
        (0.1, r"array of 0.00646 m cannot have delays .* positions in m \(multiply"),
    ],
)
def test_positions_in_other_units_are_refused(tmp_path, times, says):
    """6.5 cm across: in cm, and in a unit of 10 m."""
    source = np.array([*polar(150.0, 1.5), 0.5])
    path = record(tmp_path / "a.wav", SMALL_SQUARE, source, rate=16_000, seconds=1.0)
    bearing = locate(path, array(SMALL_SQUARE)).main_source()["bearing_deg"]
    assert bearing == pytest.approx(150.0, abs=0.3)
    with pytest.raises(ValueError, match=says):
        locate(path, array(times * SMALL_SQUARE))


def test_positions_in_inches_are_named(tmp_path):
    source = np.array([*polar(150.0, 1.5), 0.5])
    path = record(tmp_path / "a.wav", SMALL_SQUARE, source, rate=16_000, seconds=1.0)
    result = locate(path, array(SMALL_SQUARE / 0.0254))
    assert [fault.kind for fault in result.faults] == ["size"]
    assert "or the positions are not in m" in result.faults[0].message


def test_positions_in_km_are_farther_apart_than_any_array():
    with pytest.raises(ValueError, match=r"m apart; give positions in m"):
        array(1e6 * SMALL_SQUARE)


@pytest.mark.parametrize("name", ["level square", "circle", "unequal row"])
def test_source_straight_above_or_ahead_is_not_refused(tmp_path, name):
    """All delays are next to nothing, as they should be."""
    places = np.array(ARRAYS[name])
    heard_by = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    ahead = [0.0, 1.0, 0.0] if name == "unequal row" else [0.02, 0.03, 1.0]
    source = heard_by.mean(axis=0) + 3.0 * np.array(ahead)
    path = record(tmp_path / "a.wav", heard_by, source, rate=16_000, seconds=1.0)
    assert locate(path, array(places)).frames > 0


def late_by(samples, rate, channel, seconds):
    """(samples, n) with one channel later, by its phases."""
    spectrum = np.fft.rfft(samples[:, channel])
    f = np.fft.rfftfreq(len(samples), 1.0 / rate)
    turned = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * seconds), len(samples))
    return np.column_stack(
        [turned if k == channel else x for k, x in enumerate(samples.T)]
    )


@pytest.mark.parametrize("late_us", [0, 10, 20, 50])
def test_a_channel_that_is_late_is_named(tmp_path, late_us):
    places = np.array(ARRAYS["circle"])
    path = record(tmp_path / "a.wav", places, polar(60.0, 2.0), snr_db=20.0)
    altered(path, lambda x: late_by(x, 48_000, 2, 1e-6 * late_us))
    result = locate(path, array(places))
    if not late_us:
        assert result.faults == []
        return
    late = [f for f in result.faults if f.kind == "late"]
    assert len(late) == 1
    assert 2 in late[0].channels


@pytest.mark.parametrize(("gain", "shift"), [(0.7, 0), (-0.4, 0), (1.0, 5)])
def test_channel_copied_with_gain_or_delay_is_refused(tmp_path, gain, shift):
    path = record(tmp_path / "a.wav", ROBOT, polar(25.0, 1.5), snr_db=20.0)

    def copied(samples):
        samples[:, 1] = gain * np.roll(samples[:, 0], shift)
        return samples

    with pytest.raises(ValueError, match="channels 1 and 2: their samples are equal"):
        locate(altered(path, copied))
