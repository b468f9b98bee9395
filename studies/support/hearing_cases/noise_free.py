"""Simulations without noise, copied channels, and three microphones in a triangle."""

from __future__ import annotations

import math
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.locate import located
from analysis.arrays.recorded_samples import recorded_samples
from studies.support.hearing_arrays import ARRAYS, angle_off_deg, geometry_of
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.image_sources import SOUND_SPEED_M_S, heard_moving
from studies.support.synthetic_speech import speech_like
from systems.framework.input_error import InputError

TITLE = "input without noise, copies, triangles"

_SECONDS, _OFF_DEG, _DEVIATIONS = 3.0, 5.0, 3.0


class Still(NamedTuple):
    """A source at rest, and what hears it."""

    array: str
    bearing_deg: float
    sound: Literal["noise", "speech"] = "noise"
    rate: int = 16_000
    t60_s: float = 0.0
    snr_db: float = math.inf
    copied: tuple[int, int] | None = None
    """Channel that is copied, and channel that repeats it, counted from 0."""
    bits: int = 0
    """Bits of a sample; 0: floating point."""

    @property
    def name(self) -> str:
        """Says all of this in a few words."""
        copied = f", channel {self.copied} copied" if self.copied else ""
        return (
            f"{self.array}, {self.sound} from {self.bearing_deg:g} deg, "
            f"{self.rate} Hz, T60 {self.t60_s:g} s, SNR {self.snr_db:g} dB, "
            f"{self.bits} bits{copied}"
        )

    def place(self) -> NDArray[np.float64]:
        """Returns the (3,) place of the source, m."""
        turn = math.radians(self.bearing_deg)
        return 1.2 * np.array([math.cos(turn), math.sin(turn), 0.17])

    def samples(self) -> NDArray[np.float64]:
        """Returns (n, k) samples of the channels."""
        rng = np.random.default_rng(len(self.name))
        if self.sound == "noise":
            sound = rng.standard_normal(round(_SECONDS * self.rate))
        else:
            sound = speech_like(rng, _SECONDS, self.rate)
        path = np.broadcast_to(self.place(), (2, 3))
        heard = heard_moving(sound, self.rate, path, ARRAYS[self.array], self.t60_s)
        noise = heard.std() * 10.0 ** (-self.snr_db / 20.0)
        heard += noise * rng.standard_normal(heard.shape)
        if self.copied:
            heard[self.copied[1]] = heard[self.copied[0]]
        heard *= 0.3 / np.abs(heard).max()
        if self.bits:
            heard = np.rint(heard * 2.0 ** (self.bits - 1)) / 2.0 ** (self.bits - 1)
        return heard


def _judge(still: Still) -> Outcome:
    samples, places = still.samples(), ARRAYS[still.array]
    return judged(samples, still.rate, places, still.place(), still.copied)


def judged(
    samples: NDArray[np.float64],
    rate: int,
    places: NDArray[np.float64],
    truth: NDArray[np.float64],
    copied: tuple[int, int] | None = None,
) -> Outcome:
    """Locates a source, and compares its bearing with the truth.

    A recording with a copied channel must be refused for this reason.
    """
    geometry = geometry_of(places)
    try:
        result = located(recorded_samples(samples, geometry, rate), geometry)
    except InputError as error:
        names = " and ".join(str(k + 1) for k in sorted(copied or (0, 0)))
        right = copied is not None and f"channels {names}: their samples" in str(error)
        return Outcome(right, str(error))
    summary = result.main_source()
    bearing, std = summary["bearing_deg"], summary["bearing_std_deg"]
    faults = "; ".join(fault.message for fault in result.faults)
    if copied or bearing is None:
        said = faults or f"bearing {bearing}"
        return Outcome(right=False, said=said, false_claim=copied is not None)
    off = angle_off_deg(bearing, truth, places)
    false = [
        source
        for source in result.agreed.sources
        if source.confidence > CLAIM
        and angle_off_deg(source.bearing_deg, truth, places) > 3.0 * _OFF_DEG
    ]
    right = off <= max(_DEVIATIONS * std, _OFF_DEG) and not faults
    said = f"{bearing:.1f} +-{std:.1f} for {truth.round(2).tolist()} {faults}"
    return Outcome(right and not false, said, bool(false))


def _rolled() -> Outcome:
    """A row with 7 samples of delay from each microphone to the next."""
    one = speech_like(np.random.default_rng(3), _SECONDS, 16_000)
    samples = 0.1 * np.array([np.roll(one, 7 * k) for k in range(3)])
    places = ARRAYS["row of 3"] * 2.0
    sine = -7.0 * SOUND_SPEED_M_S / 16_000 / 0.2
    truth = 1e3 * np.array([sine, math.sqrt(1.0 - sine**2), 0.0])
    return judged(samples, 16_000, places, truth)


_STILL = [
    *(Still("square 4.6 cm", bearing) for bearing in (0.0, 45.0, 90.0, 135.0, 180.0)),
    *(Still("square 4.6 cm", b, "speech", bits=16) for b in (-90.0, 0.0, 30.0)),
    Still("square 1 m", 90.0, "speech"),
    *(Still("circle of 6", bearing, "speech") for bearing in (0.0, 30.0, 90.0)),
    Still("circle of 6", 60.0, rate=48_000),
    Still("circle of 8", 22.5, "speech", bits=16),
    Still("circle of 8", 90.0),
    Still("triangle 10 cm", 0.0),
    Still("triangle 10 cm", 180.0, "speech"),
    Still("triangle 10 cm", 60.0, bits=16),
    Still("row of 4", 90.0, "speech"),
    Still("row of 3", 90.0),
    Still("tetrahedron", 45.0, "speech"),
    Still("square 4.6 cm", 90.0, "speech", t60_s=0.3),
    Still("circle of 6", 90.0, "speech", t60_s=0.2),
    *(Still("triangle 10 cm", b, "speech", snr_db=25.0) for b in (20.0, 100.0, -70.0)),
    Still("triangle 10 cm", 20.0, "speech", t60_s=0.3, snr_db=25.0),
    Still("square 4.6 cm", 20.0, "speech", snr_db=25.0, copied=(0, 1)),
    Still("square 4.6 cm", 90.0, t60_s=0.3, snr_db=25.0, copied=(0, 1)),
    Still("triangle 10 cm", 60.0, "speech", t60_s=0.3, snr_db=25.0, copied=(0, 1)),
    Still("triangle 10 cm", 10.0, "speech", t60_s=0.3, snr_db=25.0, copied=(1, 2)),
    Still("circle of 6", 0.0, "speech", snr_db=25.0, copied=(1, 5)),
    Still("row of 4", 70.0, t60_s=0.3, snr_db=25.0, copied=(0, 3)),
    Still("tetrahedron", 45.0, "speech", t60_s=0.2, snr_db=25.0, copied=(2, 3)),
    Still("square 4.6 cm", 20.0, "speech", copied=(0, 1)),
    Still("circle of 8", 30.0, "speech", copied=(2, 3), t60_s=0.3),
]


def cases() -> list[HearingCase]:
    """Returns sources at rest, half of them on planes of symmetry of the array."""
    return [
        *(HearingCase(still.name, partial(_judge, still)) for still in _STILL),
        HearingCase("row of 3, copies 7 samples later", _rolled),
    ]
