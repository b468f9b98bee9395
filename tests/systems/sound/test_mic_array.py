"""The microphones as a block: geometry, frames, noise, skew and errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from phonotaxis.testing import Bench, evaluate
from systems.base.robot import RobotParameters, microphones_B
from systems.framework.faults import Fault
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame, Emission
from systems.sound.acoustics import sound_speed
from systems.sound.mic_array import MicArray
from systems.sound.parameters import MicArrayParameters

pytestmark = pytest.mark.drake

FS = 100_000.0
TIME = 0.5
TONE = 1_000.0


def quiet(**changes):
    return MicArrayParameters(snr_db_at_1m=150.0, adc_bits=16, **changes)


def emission(source, *, sounding=True, level_pa=0.1, velocity=(0.0, 0.0), time=TIME):
    """A tone from a uniformly moving source."""
    first = round((time - 0.15) * FS)
    t = (first + np.arange(15_064)) / FS
    knots = time - np.array([0.2, 0.0])
    return Emission(
        samples=(
            level_pa * math.sqrt(2) * np.sin(2 * np.pi * TONE * t) * sounding
        ).astype(np.float32),
        start_time=first / FS,
        sample_rate_hz=FS,
        knot_times=knots,
        p_WS=np.asarray(source) + (knots - time)[:, None] * np.asarray(velocity),
        v_WS=np.tile(np.asarray(velocity, dtype=float), (2, 1)),
        level_pa=level_pa,
        sounding=sounding,
    )


def recorded(
    sent, pose=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), *, time=TIME, **block
):
    outputs = evaluate(
        MicArray(**block),
        time_s=time,
        emission=sent,
        pose_WB=pose,
        velocity_WB=velocity,
    )
    return outputs["audio"]


def phase_and_amplitude(counts, time=TIME):
    """Of the tone in each channel; 2500 samples hold 25 periods."""
    t = time - 0.025 + np.arange(2500) / FS
    lines = counts @ np.exp(-2j * np.pi * TONE * t) * 2 / 2500
    return np.angle(lines * 1j), np.abs(lines)


def test_microphones_from_left_to_right():
    expected = [[0.175, 0.4], [0.175, 0.0], [0.175, -0.4]]
    np.testing.assert_allclose(microphones_B(RobotParameters()), expected)


def test_any_number_of_microphones_stands_where_it_is_put():
    """Five at random places: each hears the tone by its own distance from S."""
    places = np.random.default_rng(2).uniform(-0.3, 0.3, (5, 2))
    robot = RobotParameters(microphones_m=tuple(map(tuple, places.tolist())))
    audio = recorded(emission((1.5, 1.2)), parameters=quiet(), robot=robot)
    ranges = np.linalg.norm([1.5 - 0.175, 1.2] - places, axis=1)
    phases, _ = phase_and_amplitude(audio.counts)
    np.testing.assert_allclose(
        np.exp(1j * phases), np.exp(-2j * np.pi * TONE * ranges / 340.0), atol=1e-3
    )


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (1.0, -0.5, 2.2)])
def test_phases_and_levels_of_a_resting_source(pose):
    """The source is ahead and to the left of the robot: M1 is nearest."""
    parameters = quiet()
    x, y, theta = pose
    turn = np.array(
        [[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]]
    )
    ahead_left = np.array([1.5, 1.2])
    audio = recorded(emission(turn @ ahead_left + [x, y]), pose, parameters=parameters)
    ranges = np.linalg.norm(ahead_left - microphones_B(RobotParameters()), axis=1)
    assert ranges[0] < ranges[1] < ranges[2]
    phases, amplitudes = phase_and_amplitude(audio.counts)
    np.testing.assert_allclose(
        np.exp(1j * phases), np.exp(-2j * np.pi * TONE * ranges / 340.0), atol=1e-3
    )
    expected = 0.1 * math.sqrt(2) / ranges * parameters.counts_per_pa
    np.testing.assert_allclose(amplitudes, expected, rtol=1e-3)


def test_frame_says_what_it_is():
    audio = recorded(emission((2.0, 0.0)))
    assert audio.counts.shape == (3, 2500)
    assert audio.counts.dtype == np.int16
    assert (audio.full_scale, audio.sample_rate_hz, audio.time) == (512, FS, TIME)
    assert not audio.counts.flags.writeable


def test_warmer_air_is_faster():
    source = np.array([2.175, 0.0])
    parameters = quiet()
    audio = recorded(
        emission(source),
        parameters=parameters,
        sound_speed_m_s=sound_speed(30.0),
    )
    phases, _ = phase_and_amplitude(audio.counts)
    expected = np.exp(-2j * np.pi * TONE * 2.0 / (331.5 + 18.0))
    np.testing.assert_allclose(np.exp(1j * phases[1]), expected, atol=1e-3)


def with_errors(array, sent, errors):
    """Frame of a context whose numeric parameters are set, by their numbers."""
    at = Bench(
        array,
        time_s=TIME,
        emission=sent,
        pose_WB=[1.0, -0.5, 0.4],
        velocity_WB=[0.0] * 3,
    )
    for index, values in errors.items():
        at.context.get_mutable_numeric_parameter(index).SetFromVector(values)
    return at.output("audio").counts


def test_errors_of_a_context_shift_what_its_microphones_hear():
    """Places, delays, gains and air of one trial; the block itself stays as it is."""
    generator = np.random.default_rng(5)
    array = MicArray(parameters=quiet())
    places = generator.uniform(-0.01, 0.01, (3, 2))
    delays = generator.uniform(-2e-5, 2e-5, 3)
    gains = np.array([1.1, 0.9, 1.02])
    source, c = np.array([3.0, 0.7]), 344.0
    errors = {
        MicArray.POSITION_ERRORS: places.ravel(),
        MicArray.CHANNEL_DELAYS: delays,
        MicArray.GAINS: gains,
        MicArray.SOUND_SPEED: [c],
    }
    counts = with_errors(array, emission(source), errors)
    turn = np.array([[math.cos(0.4), -math.sin(0.4)], [math.sin(0.4), math.cos(0.4)]])
    p_WM = (microphones_B(RobotParameters()) + places) @ turn.T + [1.0, -0.5]
    ranges = np.linalg.norm(source - p_WM, axis=1)
    phases, amplitudes = phase_and_amplitude(counts)
    expected = np.exp(2j * np.pi * TONE * (delays - ranges / c))
    np.testing.assert_allclose(np.exp(1j * phases), expected, atol=2e-4)
    expected = 0.1 * math.sqrt(2) / ranges * quiet().counts_per_pa * gains
    np.testing.assert_allclose(amplitudes, expected, rtol=1e-3)
    plain = with_errors(array, emission(source), {})
    np.testing.assert_array_equal(
        plain, with_errors(MicArray(parameters=quiet()), emission(source), {})
    )


def test_noise_level_refers_to_one_meter():
    parameters = MicArrayParameters(snr_db_at_1m=20.0, adc_bits=16)
    audio = recorded(emission((5.0, 0.0), sounding=False), parameters=parameters)
    expected = 0.1 * 10 ** (-20 / 20) * parameters.counts_per_pa
    assert audio.counts.std() == pytest.approx(expected, rel=0.03)


def test_same_seed_same_counts():
    sent = emission((2.0, 0.0))
    first = recorded(sent, seed=4).counts
    np.testing.assert_array_equal(recorded(sent, seed=4).counts, first)
    noise = (
        first - recorded(sent, parameters=MicArrayParameters(snr_db_at_1m=150.0)).counts
    )
    other = recorded(sent, seed=5).counts - first + noise
    assert abs(np.corrcoef(noise.ravel(), other.ravel())[0, 1]) < 0.1


def test_robot_that_drives_shifts_the_tone():
    """Han 2019, eq. 1: at 0.7 m/s toward the source, f (c + v) / c."""
    audio = recorded(
        emission((4.0, 0.0)),
        velocity=(0.7, 0.0, 0.0),
        parameters=quiet(),
    )
    t = TIME - 0.025 + np.arange(2500) / FS
    shifted = TONE * (340.0 + 0.7) / 340.0
    halves = [
        np.angle(audio.counts[1, part] @ np.exp(-2j * np.pi * shifted * t[part]))
        for part in (slice(0, 1250), slice(1250, 2500))
    ]
    # Beat of the two halves' centers, 12.5 ms apart.
    assert abs(halves[1] - halves[0]) / (2 * np.pi * 0.0125) < 0.1


def test_frame_starts_from_the_pose_of_the_last_tick():
    """The robot stood at the last tick and has since moved 3 mm forward.

    With no velocity at either end it goes by 3 s^2 - 2 s^3: half the way in
    the middle of the frame.
    """
    at = Bench(
        MicArray(parameters=quiet()),
        time_s=TIME - 0.025,
        emission=emission((3.0, 0.0)),
        pose_WB=[0.0] * 3,
        velocity_WB=[0.0] * 3,
    )
    at.state = at.next_state()
    at.context.SetTime(TIME)
    audio = at.set(pose_WB=[0.003, 0.0, 0.0]).output("audio")
    assert isinstance(audio, AudioFrame)
    counts = audio.counts[1]
    s = np.arange(2500) / 2500
    distance = 3.0 - 0.175 - 0.003 * (3 * s**2 - 2 * s**3)
    t = TIME - 0.025 + np.arange(2500) / FS
    expected = np.sin(2 * np.pi * TONE * (t - distance / 340.0)) / distance
    expected *= 0.1 * math.sqrt(2) * quiet().counts_per_pa
    # 3 mm are 5 % of the tone's phase; 0.2 % of the amplitude is noise.
    np.testing.assert_allclose(counts, expected, atol=2e-3 * expected.max())


def test_a_pose_of_an_older_tick_is_no_start_of_a_frame():
    """The robot stood elsewhere two ticks ago, and has rested for this frame."""
    at = Bench(
        MicArray(parameters=quiet()),
        time_s=TIME - 0.05,
        emission=emission((3.0, 0.0)),
        pose_WB=[-0.05, 0.0, 0.0],
        velocity_WB=[0.0] * 3,
    )
    at.state = at.next_state()
    at.context.SetTime(TIME)
    audio = at.set(pose_WB=[0.0] * 3).output("audio")
    phases, _ = phase_and_amplitude(audio.counts)
    expected = np.exp(-2j * np.pi * TONE * (3.0 - 0.175) / 340.0)
    np.testing.assert_allclose(np.exp(1j * phases[1]), expected, atol=1e-3)


def test_sources_add_up():
    """Two places, two sources: what one block hears of both is the sum."""
    array = MicArray(parameters=quiet(), others=["fan"])
    silent = emission((2.0, 0.5), sounding=False)
    sent = emission((2.0, 0.5)), emission((1.0, -2.0))
    heard = []
    for first, second in ((sent[0], sent[1]), (sent[0], silent), (silent, sent[1])):
        outputs = evaluate(
            array,
            time_s=TIME,
            emission=first,
            emission_fan=second,
            pose_WB=[0.0] * 3,
            velocity_WB=[0.0] * 3,
        )
        heard.append(outputs["audio"].counts.astype(float))
    # Each frame is rounded and holds the same noise, below one count.
    np.testing.assert_allclose(heard[0], heard[1] + heard[2], atol=3.0)
    assert np.std(heard[2]) > 100.0


def test_wrong_emission_is_refused():
    with pytest.raises(TypeError, match=r"MicArray.*SoundEmitter"):
        recorded({"samples": 1})


@pytest.mark.parametrize("sounding", [True, False])
def test_source_out_of_reach_is_refused(sounding):
    """In silence, too: sound from before the emission might arrive."""
    with pytest.raises(ValueError, match=r"MicArray.*maximum_range_m"):
        recorded(emission((60.0, 0.0), sounding=sounding))


def test_dead_and_frozen_microphones_fail_from_their_time_on():
    """Dead is 0, frozen a quarter of full scale; the others do not change."""
    faults = (
        Fault(sensor="microphones", number=1, kind="dead", start_s=0.4),
        Fault(sensor="microphones", number=2, kind="frozen"),
        Fault(sensor="microphones", number=3, kind="dead", start_s=TIME),
        Fault(sensor="odometry", kind="lost"),
    )
    sound = recorded(emission((1.5, 1.2)), parameters=quiet())
    faulty = recorded(emission((1.5, 1.2)), parameters=quiet(), faults=faults)
    assert np.all(faulty.counts[0] == 0)
    assert np.all(faulty.counts[1] == 2**13)
    np.testing.assert_array_equal(faulty.counts[2], sound.counts[2])


def test_faults_of_no_microphone_or_twice_of_one_are_refused():
    third = Fault(sensor="microphones", number=3, kind="dead")
    fourth = Fault(sensor="microphones", number=4, kind="dead")
    with pytest.raises(InputError, match=r"4 is not one of 3.*from 1 to 3"):
        MicArray(faults=(fourth,))
    with pytest.raises(InputError, match="has two faults"):
        MicArray(faults=(third, third))


def test_frames_of_32_khz_hold_the_same_sound():
    """800 samples in 25 ms: each is that of 100 kHz, wherever the instants meet."""
    fine, coarse = (
        recorded(emission((1.5, 1.2)), parameters=quiet(sample_rate_hz=rate))
        for rate in (96_000.0, 32_000.0)
    )
    assert coarse.counts.shape == (3, 800)
    np.testing.assert_allclose(coarse.counts, fine.counts[:, ::3], atol=2)
