"""Chosen microphones, and faults that are corrected, reported, or end the work."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.prepared_recording import (
    channels_without_faults,
    chosen_microphones,
    prepared_recording,
)
from analysis.arrays.recorded_samples import RecordedSamples
from systems.framework.input_error import InputError
from tests.analysis.arrays.plane_waves import RATE, SOUND_SPEED, SQUARE, plane_waves

PLACES = ((0.1, 0.0), (0.0, 0.1), (-0.1, 0.0), (0.0, -0.2))


def test_each_keeps_its_place_channel_and_deviation():
    all_of_them = ArrayGeometry(
        microphones=PLACES,
        channels=(5, 2, 7, 1),
        position_std_m=(0.001, 0.002, 0.003, 0.004),
        temperature_c=20.0,
    )
    three = chosen_microphones(all_of_them, (0, 2, 3))
    assert three.microphones == (PLACES[0], PLACES[2], PLACES[3])
    assert three.columns == (5, 7, 1)
    assert three.position_std_m == (0.001, 0.003, 0.004)
    assert three.c == all_of_them.c


def test_covariances_of_all_keep_their_rows():
    rng = np.random.default_rng(1)
    root = 1e-3 * rng.standard_normal((8, 8))
    matrix = root @ root.T
    rows = tuple(map(tuple, matrix.tolist()))
    geometry = ArrayGeometry(microphones=PLACES, position_covariance_m2=rows)
    kept = chosen_microphones(geometry, (1, 2, 3)).known.budget.of_places
    np.testing.assert_allclose(kept, matrix[2:, 2:])


def test_one_is_too_few():
    with pytest.raises((InputError, ValueError), match="microphones"):
        chosen_microphones(ArrayGeometry(microphones=PLACES), (0,))


@pytest.mark.parametrize("k", [0, 2])
def test_a_channel_that_dies_is_left_out(k):
    samples = plane_waves(35.0, 6.0).astype(np.float64)
    samples[k, 3 * RATE :] = 0.0
    geometry = ArrayGeometry(microphones=SQUARE, sound_speed=SOUND_SPEED)
    recorded = RecordedSamples(samples, RATE, "a.wav")
    prepared = prepared_recording(recorded, geometry)
    assert prepared.geometry.columns == tuple(i for i in range(4) if i != k)
    assert len(prepared.spectra.channels) == 3
    (fault,) = prepared.faults
    assert (fault.kind, fault.channels) == ("dead", (k,))
    assert fault.message.endswith("it is left out")
    # Two channels are left of three: an array that measures the angle to its axis.
    three = chosen_microphones(geometry, (0, 1, 2))
    assert len(prepared_recording(recorded, three).spectra.channels) == 2


SAMPLES = np.arange(12.0).reshape(3, 4) - 5.0


def fault(kind, *channels):
    return ChannelFault(kind, channels, f"{kind} {channels}")


def agrees_with(order):
    """Channels agree best in this order."""

    def agreement(channels):
        return -float(np.abs(channels - SAMPLES[list(order)]).sum())

    return agreement


AS_GIVEN = agrees_with([0, 1, 2])


@pytest.mark.parametrize(
    "kind", ["nan", "dead", "copied", "units", "speed", "unaligned"]
)
def test_nothing_to_locate_with(kind):
    with pytest.raises(ValueError, match=rf"a.wav: {kind} \(1,\)"):
        channels_without_faults(
            SAMPLES, [fault(kind, 1)], agrees_with([0, 1, 2]), "a.wav"
        )


def test_all_channels_that_are_of_no_use_are_named():
    found = [fault("dead", 1), fault("clipped", 0), fault("copied", 0, 2)]
    with pytest.raises(ValueError, match=r"dead \(1,\); check channels 1, 3 as well"):
        channels_without_faults(SAMPLES, found, AS_GIVEN, "")


def test_a_message_names_a_few_of_many_channels():
    found = [fault("copied", 0, k) for k in range(1, 64)]
    with pytest.raises(ValueError, match=r"check channels 3, 4, .*\.\.\.") as caught:
        channels_without_faults(SAMPLES, found, AS_GIVEN, "")
    assert len(str(caught.value)) < 100


@pytest.mark.parametrize("kind", ["late", "size", "geometry", "apart", "near"])
def test_doubtful_estimates_are_said(kind):
    samples, faults = channels_without_faults(SAMPLES, [fault(kind, 1)], AS_GIVEN, "")
    np.testing.assert_array_equal(samples, SAMPLES)
    assert [f.kind for f in faults] == [kind]


def test_inverted_channel_is_turned_back_and_said():
    turned = SAMPLES * [[1.0], [1.0], [-1.0]]
    samples, faults = channels_without_faults(
        turned, [fault("inverted", 2), fault("clipped", 0)], AS_GIVEN, ""
    )
    np.testing.assert_array_equal(samples, SAMPLES)
    assert [f.kind for f in faults] == ["inverted", "clipped"]


def test_exchanged_channels_need_a_second_witness():
    found = [fault("swapped", 0, 2)]
    with pytest.raises(ValueError, match="swapped"):
        channels_without_faults(SAMPLES, found, agrees_with([2, 1, 0]), "")
    samples, faults = channels_without_faults(
        SAMPLES, found, agrees_with([0, 1, 2]), ""
    )
    np.testing.assert_array_equal(samples, SAMPLES)
    assert faults == []
