"""Files that hold a converter's counts exactly, and can be read at any moment."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest
import soundfile

from systems.sound.wav_writer import (
    WavWriter,
    loudest_pa,
    pcm_of_counts,
    pcm_of_pressure,
)

RATE = 100_000


def blocks(count: int, length: int = 500) -> list[np.ndarray]:
    generator = np.random.default_rng(3)
    limits = np.iinfo(np.int16)
    return [
        generator.integers(limits.min, limits.max, (3, length), dtype=np.int16)
        for _ in range(count)
    ]


@pytest.mark.parametrize("bits", range(2, 17))
def test_every_count_comes_back_exactly(tmp_path: Path, bits: int) -> None:
    full_scale = 2 ** (bits - 1)
    counts = np.arange(-full_scale, full_scale, dtype=np.int16)
    path = tmp_path / "a.wav"
    writer = WavWriter(path, 1, RATE, 2)
    writer.write(pcm_of_counts(counts[None], full_scale))
    writer.close()
    read, rate = soundfile.read(path)
    assert rate == RATE
    np.testing.assert_array_equal(read * full_scale, counts)
    assert (read[0], read[full_scale]) == (-1.0, 0.0)


def test_channels_stay_apart_and_blocks_join(tmp_path: Path) -> None:
    path, written = tmp_path / "a.wav", blocks(3)
    writer = WavWriter(path, 3, RATE, 2)
    for block in written:
        writer.write(block)
    writer.close()
    read, _ = soundfile.read(path, dtype="int16")
    np.testing.assert_array_equal(read.T, np.concatenate(written, axis=1))
    assert writer.samples == len(read)
    assert soundfile.info(path).subtype == "PCM_16"


def test_what_was_written_can_be_read_while_the_writer_is_at_work(
    tmp_path: Path,
) -> None:
    """So it can after a process has been killed."""
    path = tmp_path / "a.wav"
    writer = WavWriter(path, 3, RATE, 2)
    for number, block in enumerate(blocks(3), start=1):
        writer.write(block)
        read, _ = soundfile.read(path, dtype="int16")
        assert len(read) == 500 * number
        np.testing.assert_array_equal(read[-500:].T, block)
    writer.close()


@pytest.mark.parametrize(
    ("level_pa", "full_scale_pa"), [(0.05, 0.25), (0.0625, 0.25), (1.0, 4.0), (3, 16)]
)
def test_full_scale_is_the_power_of_two_above_the_peaks(
    level_pa: float, full_scale_pa: float
) -> None:
    """The loudspeaker gives four times its level, 4.1 of the model."""
    assert loudest_pa(level_pa) == full_scale_pa


def test_pressure_is_rounded_to_a_part_in_two_billion(tmp_path: Path) -> None:
    pressure = np.random.default_rng(4).uniform(-0.2, 0.2, 4000).astype(np.float32)
    pressure[:3] = 0.25, -0.25, 0.3
    path = tmp_path / "a.wav"
    writer = WavWriter(path, 1, RATE, 4)
    writer.write(pcm_of_pressure(pressure, 0.25)[None])
    writer.close()
    read, _ = soundfile.read(path)
    expected = np.clip(pressure.astype(float), -0.25, 0.25)
    np.testing.assert_allclose(0.25 * read, expected, rtol=0.0, atol=0.25 * 2**-31)
    assert soundfile.info(path).subtype == "PCM_32"


def test_a_file_that_exists_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    path.write_text("mine")
    with pytest.raises(FileExistsError):
        WavWriter(path, 1, RATE, 2)
    assert path.read_text() == "mine"


def test_no_room_names_the_file_and_leaves_what_was_written(tmp_path: Path) -> None:
    path, (first, second, third) = tmp_path / "a.wav", blocks(3, 20_000)
    writer = WavWriter(path, 3, RATE, 2)
    writer.write(first)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    try:
        for block in (second, third):
            with pytest.raises(OSError, match=str(path)) as raised:
                writer.write(block)
            assert raised.value.filename == str(path)
        writer.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    read, _ = soundfile.read(path, dtype="int16")
    np.testing.assert_array_equal(read.T, first)
