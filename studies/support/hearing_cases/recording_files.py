"""Files as recorders leave them: raw, of open length, truncated, one per microphone."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import soundfile
from numpy.typing import NDArray

from analysis.arrays.recorded_samples import Recording
from phonotaxis import ArrayGeometry, InputError, locate
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.synthetic_speech import speech_like

TITLE = "files of recorders"

_C = 343.5
_SIXTHS = np.arange(6) * np.pi / 3
_ARRAYS = {
    "square of 4.6 cm": 0.0229 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]),
    "circle of 6": 0.05 * np.stack([np.cos(_SIXTHS), np.sin(_SIXTHS)], axis=1),
    "five within 0.6 m": np.array(
        [[0.3, 0.0], [-0.1, 0.28], [0.0, 0.02], [-0.25, -0.1], [0.1, -0.3]]
    ),
}

Prepare = Callable[[Path, NDArray[np.float64], int], Recording]
"""Writes samples into a folder. Returns what locate is given."""


def _samples(
    name: str, bearing_deg: float, rate: int, starts_s: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Speech from 2 m at recorders that start at the given times."""
    rng = np.random.default_rng(1_000 + round(bearing_deg))
    places = _ARRAYS[name]
    sound = speech_like(rng, 4.0, rate)
    angle = np.radians(bearing_deg)
    source = 2.0 * np.array([np.cos(angle), np.sin(angle)])
    delays = np.linalg.norm(source - places, axis=1) / _C
    if starts_s is not None:
        delays = delays - starts_s[: len(places)]
    frequency = np.fft.rfftfreq(sound.size, 1 / rate)
    turns = np.exp(-2j * np.pi * np.outer(delays, frequency))
    heard = np.fft.irfft(turns * np.fft.rfft(sound), sound.size)
    return np.asarray(0.05 * (heard + 0.05 * rng.standard_normal(heard.shape)))


class _Kind(NamedTuple):
    """A kind of files."""

    name: str
    prepare: Prepare
    says: str = ""
    """What must be said of the files. Empty: nothing."""
    one_by_one: bool = False
    """Whether the recorders start at different times."""


def _judged(name: str, bearing_deg: float, rate: int, kind: _Kind) -> Outcome:
    """Locates a recording. It is right if bearing and notes are those expected."""
    starts_s = None
    if kind.one_by_one:
        rng = np.random.default_rng(rate)
        starts_s = rng.uniform(0.0, 0.4, len(_ARRAYS[name]))
    samples = _samples(name, bearing_deg, rate, starts_s)
    places = _ARRAYS[name].tolist()
    geometry = ArrayGeometry(microphones=places, sound_speed=_C)
    with tempfile.TemporaryDirectory() as folder:
        given = kind.prepare(Path(folder), samples, rate)
        stated = None if starts_s is None else starts_s.tolist()
        try:
            found = locate(given, geometry, starts_s=stated)
        except InputError as error:
            return Outcome(kind.says != "" and kind.says in str(error), str(error))
    summary, notes = found.main_source(), " ".join(found.notes)
    bearing, std = summary["bearing_deg"], summary["bearing_std_deg"]
    said = f"{bearing} +- {std}, {notes}"
    if bearing is None:
        return Outcome(right=False, said=said)
    off = abs((bearing - bearing_deg + 180.0) % 360.0 - 180.0)
    claims = any(source.confidence > CLAIM for source in found.agreed.sources)
    near = off <= max(3.0 * std, 5.0)
    noted = kind.says in notes if kind.says else not notes
    return Outcome(near and noted, said, claims and not near)


def _wav(samples: NDArray[np.float64], rate: int, kind: str = "WAV") -> bytearray:
    buffer = io.BytesIO()
    soundfile.write(buffer, samples.T, rate, format=kind, subtype="PCM_16")
    return bytearray(buffer.getvalue())


def _written(folder: Path, name: str, content: bytes | bytearray) -> Recording:
    (folder / name).write_bytes(content)
    return folder / name


def _open(riff: int, data: int) -> Prepare:
    def prepare(folder: Path, samples: NDArray[np.float64], rate: int) -> Recording:
        content = _wav(samples, rate)
        content[4:8], content[40:44] = (
            riff.to_bytes(4, "little"),
            data.to_bytes(4, "little"),
        )
        return _written(folder, "piped.wav", content)

    return prepare


def _cut(kind: str, share: float) -> Prepare:
    def prepare(folder: Path, samples: NDArray[np.float64], rate: int) -> Recording:
        content = _wav(samples, rate, kind)
        return _written(
            folder, f"cut.{kind.lower()}", content[: int(share * len(content))]
        )

    return prepare


def _raw(folder: Path, samples: NDArray[np.float64], rate: int) -> Recording:
    return _written(folder, "recording.raw", bytes(_wav(samples, rate)[44:]))


def _each(folder: Path, samples: NDArray[np.float64], rate: int) -> list[Path]:
    paths = [folder / f"microphone_{k + 1}.flac" for k in range(len(samples))]
    for path, channel in zip(paths, samples, strict=True):
        soundfile.write(path, channel, rate)
    return paths


def _one(folder: Path, samples: NDArray[np.float64], rate: int) -> Recording:
    paths = _each(folder, samples, rate)
    return paths[0]


def _mixed_rates(folder: Path, samples: NDArray[np.float64], rate: int) -> Recording:
    paths = _each(folder, samples, rate)
    soundfile.write(paths[1], samples[1], 2 * rate)
    return paths


_KINDS = (
    _Kind("from sox", _open(0x7FFF_F024, 0x7FFF_F000)),
    _Kind("from ffmpeg", _open(0xFFFF_FFFF, 0xFFFF_FFFF)),
    _Kind("from arecord", _open(0x8000_0024, 0x8000_0000)),
    _Kind("never finished", _open(36, 0)),
    _Kind("WAV to two thirds", _cut("WAV", 0.667), "truncated"),
    _Kind("WAV to a third", _cut("WAV", 0.34), "truncated"),
    _Kind("FLAC to two thirds", _cut("FLAC", 0.667), "truncated"),
    _Kind("AIFF to a half", _cut("AIFF", 0.5), "truncated"),
    _Kind("raw", _raw, "ffmpeg -f s16le"),
    _Kind("file per microphone", _each),
    _Kind("recorders started one by one", _each, one_by_one=True),
    _Kind("one of the files", _one, "one file per microphone"),
    _Kind("two rates", _mixed_rates, "sample rate"),
)


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    bearings, rates = (50.0, -110.0, 160.0), (16_000, 48_000, 44_100)
    return [
        HearingCase(
            f"{array}, {rate} Hz: {kind.name}",
            partial(_judged, array, bearing_deg, rate, kind),
        )
        for array, bearing_deg, rate in zip(_ARRAYS, bearings, rates, strict=True)
        for kind in _KINDS
    ]
