"""Reflections in frames: against whole convolutions and exactly moving images."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyroomacoustics as pra
import pytest
import scipy.interpolate
import scipy.signal

from phonotaxis.testing import evaluate
from systems.base.robot import RobotParameters, microphones_B
from systems.framework.signals import FRAME_SAMPLES, TICK_S, Emission
from systems.sound import reverberation
from systems.sound.mic_array import MicArray
from systems.sound.parameters import HEIGHT_M, MicArrayParameters, RoomParameters
from systems.sound.real_array import no_errors, real_array
from systems.sound.reverberation import Reverberation, _place
from systems.sound.room import room_images, room_impulse_responses

FS = 100_000
C = 340.0
TIME = 0.8
ARRAY = real_array(
    microphones_B(RobotParameters()), MicArrayParameters(), no_errors(3), C
)


def band_noise(low_hz, high_hz, count):
    sections = scipy.signal.butter(
        4, (low_hz, high_hz), "bandpass", fs=FS, output="sos"
    )
    white = np.random.default_rng(1).standard_normal(count)
    return 0.1 * scipy.signal.sosfilt(sections, white).astype(np.float32)


NOISE = band_noise(500.0, 6_000.0, 120_000)


def emission(source, velocity=(0.0, 0.0), *, time=TIME, reach_s=0.6, wave=NOISE):
    """Noise that began long ago, of a source that drives straight on."""
    first = round((time - reach_s) * FS)
    knots = time - np.array([reach_s + 0.1, 0.0])
    start = np.array(source) - TIME * np.asarray(velocity)
    return Emission(
        samples=wave[first : round(time * FS) + 64].copy(),
        start_time=first / FS,
        sample_rate_hz=FS,
        knot_times=knots,
        p_WS=start + knots[:, None] * np.asarray(velocity),
        v_WS=np.tile(np.asarray(velocity, dtype=float), (2, 1)),
        level_pa=0.1,
        sounding=bool(wave.any()),
    )


def places(pose, *sources):
    return np.concatenate([pose, *sources])


def test_resting_array_records_what_pyroomacoustics_simulates():
    """Direct sound and reflections, from the emission to the counts.

    Within 1 %, a twentieth of a sample at 3 kHz: the other's direct sound is off
    by 0.2 to 2 % below 5 kHz, through its interpolation and its high-pass.
    """
    room = RoomParameters(reverberation_time_s=0.25)
    source, pose = np.array([1.6, 0.9]), np.array([-0.8, -0.3, 0.4])
    parameters = MicArrayParameters(snr_db_at_1m=150.0, adc_bits=16)
    block = MicArray(parameters=parameters, room=room)
    outputs = evaluate(
        block,
        time_s=TIME,
        emission=emission(source),
        pose_WB=pose,
        velocity_WB=[0.0] * 3,
    )
    pressure = outputs["audio"].counts / parameters.counts_per_pa

    absorption, _, order = room.walls(C)
    box = pra.ShoeBox(
        room.size_m, fs=FS, materials=pra.Material(absorption), max_order=order
    )
    box.set_sound_speed(C)
    box.add_source(
        [*(source - room.corner), HEIGHT_M],
        signal=NOISE[: round(TIME * FS)].astype(float),
    )
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    p_WM = pose[:2] + microphones_B(RobotParameters()) @ turn.T
    box.add_microphone_array(np.vstack([(p_WM - room.corner).T, np.full(3, HEIGHT_M)]))
    box.simulate()
    half = pra.constants.get("frac_delay_length") // 2
    end = round(TIME * FS) + half
    expected = box.mic_array.signals[:, end - FRAME_SAMPLES : end]
    assert np.std(pressure - expected) < 0.01 * np.std(expected)


#: The noise at any time, in samples.
WAVE = scipy.interpolate.make_interp_spline(np.arange(len(NOISE)), NOISE, k=5)


def exact(room, source, velocity, pose, pose_velocity, time):
    """Each image moves as its source does, by the retarded time of every sample."""
    images = room_images(room, C)
    times = time - TICK_S + np.arange(FRAME_SAMPLES) / FS
    x, y, theta = (pose + (times[:, None] - time) * pose_velocity).T
    turned = np.exp(1j * theta) * (microphones_B(RobotParameters()) @ [1, 1j])[:, None]
    p_WM = np.stack([x + turned.real, y + turned.imag], axis=-1)
    total = np.zeros((3, FRAME_SAMPLES))
    for signs, offset, gain in zip(
        images.signs, images.offsets, images.gains, strict=True
    ):
        rise = HEIGHT_M - signs[2] * HEIGHT_M - offset[2]
        delays = np.zeros((3, FRAME_SAMPLES))
        for _ in range(8):  # a step shrinks the error a thousandfold
            sent = (times - delays - TIME)[..., None]
            p_WS = np.asarray(source) + sent * np.asarray(velocity)
            p_WS = signs[:2] * (p_WS - room.corner) + offset[:2] + room.corner
            ranges = np.sqrt(np.sum((p_WM - p_WS) ** 2, axis=-1) + rise**2)
            delays = ranges / C
        total += gain * WAVE((times - delays) * FS) / ranges
    return total


ROOM = RoomParameters(size_m=(6.0, 5.0, 3.0), absorption=0.4, maximum_order=3)


def test_resting_places_are_exact():
    source, pose = np.array([1.6, 0.9]), np.array([-0.8, -0.3, 0.4])
    here = places(pose, source)
    (found,) = Reverberation(ROOM, C).frames(
        [emission(source)], TIME, here, here, ARRAY
    )
    expected = exact(ROOM, source, np.zeros(2), pose, np.zeros(3), TIME)
    assert np.std(found - expected) < 1e-3 * np.std(expected)


def test_a_slower_converter_hears_every_other_sample():
    source, pose = np.array([1.6, 0.9]), np.array([-0.8, -0.3, 0.4])
    old, new = places(pose, source), places(pose + 0.05, source)
    slow = MicArrayParameters(sample_rate_hz=50_000.0)
    of_all, of_half = (
        Reverberation(ROOM, C, parameters).frames(
            [emission(source)], TIME, old, new, ARRAY
        )[0]
        for parameters in (MicArrayParameters(), slow)
    )
    assert of_all is not None
    assert of_half is not None
    assert of_half.shape == (len(of_all), FRAME_SAMPLES // 2)
    np.testing.assert_allclose(
        of_half, of_all[:, ::2], atol=1e-4 * float(np.std(of_all))
    )


def driven(ticks_held):
    """Errors of four frames of moving bodies, places taken every so many ticks."""
    velocity, pose_velocity = np.array([0.0, 0.3]), np.array([0.4, -0.2, 0.3])
    room = Reverberation(ROOM, C)

    def at(tick):
        time = TIME + tick * TICK_S
        source = np.array([1.6, 0.9]) + (time - TIME) * velocity
        return source, np.array([-0.8, -0.3, 0.4]) + (time - TIME) * pose_velocity

    errors, signals = [], []
    for tick in range(1, 5):
        time = TIME + tick * TICK_S
        _, pose = at(tick)
        held = (tick - 1) // ticks_held * ticks_held
        taken = tick // ticks_held * ticks_held
        old_source, old_pose = at(held)
        new_source, new_pose = at(taken)
        old, new = places(old_pose, old_source), places(new_pose, new_source)
        sent = emission((1.6, 0.9), velocity, time=time)
        (found,) = room.frames([sent], time, old, new, ARRAY)
        expected = exact(ROOM, (1.6, 0.9), velocity, pose, pose_velocity, time)
        errors.append(found - expected)
        signals.append(expected)
    return np.std(errors) / np.std(signals)


def test_moving_places_follow_their_updates():
    """Updates at every tick follow the exact images; every 100 ms they lag behind.

    At 0.5 m/s between the bodies, 0.5 to 6 kHz: 12 mm a tick are a fifth of the
    shortest wave, 50 mm in 100 ms nearly one.
    """
    fine, coarse = driven(1), driven(4)
    assert fine < 0.25
    assert fine < 0.5 * coarse < 0.3


def test_new_places_fade_in_without_a_click():
    """Nowhere do neighboring samples differ by more than a 1 kHz tone's can."""
    wave = 0.1 * np.sin(2 * np.pi * 1_000.0 * np.arange(120_000) / FS)
    room = Reverberation(ROOM, C)
    here = places([-0.8, -0.3, 0.4], [1.6, 0.9])
    there = places([-0.6, -0.1, 0.5], [1.5, 0.7])
    frames: list[Any] = []
    for tick, (old, new) in enumerate([(here, here), (here, there), (there, there)]):
        time = TIME + tick * TICK_S
        sent = emission((1.6, 0.9), time=time, wave=wave.astype(np.float32))
        frames += room.frames([sent], time, old, new, ARRAY)
    heard: Any = np.concatenate(frames, axis=1)
    steps = np.abs(np.diff(heard, axis=1))
    amplitude = np.abs(heard).max()
    assert steps.max() < 1.1 * amplitude * 2 * np.pi * 1_000.0 / FS


def test_who_rests_needs_one_response(monkeypatch):
    computed = []

    def counted(*args, **kwargs):
        computed.append(args)
        return original(*args, **kwargs)

    original = room_impulse_responses
    monkeypatch.setattr(reverberation, "room_impulse_responses", counted)
    room = Reverberation(ROOM, C)
    here = places([-0.8, -0.3, 0.4], [1.6, 0.9])
    there = places([-0.8, -0.2, 0.4], [1.6, 0.9])
    for tick, old, new in [(0, here, here), (1, here, here), (2, here, there)]:
        time = TIME + tick * TICK_S
        room.frames([emission((1.6, 0.9), time=time)], time, old, new, ARRAY)
    assert len(computed) == 2


def test_each_source_has_its_own_place():
    """After the robot's pose come x and y of one source after the other."""
    places = np.array([1.0, 2.0, 3.0, 10.0, 11.0, 20.0, 21.0])
    assert _place(places, 0) == (1.0, 2.0, 3.0, 10.0, 11.0)
    assert _place(places, 1) == (1.0, 2.0, 3.0, 20.0, 21.0)


def test_silent_source_has_no_reflections():
    here = places([-0.8, -0.3, 0.4], [1.6, 0.9])
    silent = emission((1.6, 0.9), wave=np.zeros_like(NOISE))
    assert Reverberation(ROOM, C).frames([silent], TIME, here, here, ARRAY) == [None]


@pytest.mark.parametrize(
    ("pose", "source", "who"),
    [
        ([-2.9, 0.0, 1.57], [1.0, 0.0], "a microphone"),
        ([0.0, 0.0, 0.0], [1.0, 2.6], "a source"),
    ],
)
def test_nobody_is_heard_through_a_wall(pose, source, who):
    here = places(pose, source)
    with pytest.raises(ValueError, match=rf"MicArray: {who} .*room\.size_m"):
        Reverberation(ROOM, C).frames([emission(source)], TIME, here, here, ARRAY)


def test_emission_must_reach_back_as_far_as_the_room_answers():
    here = places([-0.8, -0.3, 0.4], [1.6, 0.9])
    room = Reverberation(RoomParameters(reverberation_time_s=0.3), C)
    with pytest.raises(ValueError, match=r"102 m.*maximum_range_m"):
        room.frames([emission((1.6, 0.9), reach_s=0.3)], TIME, here, here, ARRAY)
