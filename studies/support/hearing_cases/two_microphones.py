"""Two microphones, which measure the angle between a source and their axis."""

from __future__ import annotations

import math
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.locate import located
from analysis.arrays.recorded_samples import recorded_samples
from studies.support.hearing_arrays import angle_off_deg, geometry_of, streamed
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.image_sources import heard_moving
from studies.support.synthetic_speech import speech_like
from systems.framework.input_error import InputError

TITLE = "two microphones"

# Largest error of the angle to the axis, in stated deviations, and deg.
_DEVIATIONS, _OFF_DEG = 3.0, 5.0
# Largest error of a confident source or track, deg.
_CLAIM_OFF_DEG = 15.0


class Pair(NamedTuple):
    """A source at rest, and two microphones on a line through the origin."""

    apart_m: float
    bearing_deg: float
    t60_s: float = 0.0
    rate: int = 16_000
    sound: Literal["noise", "speech"] = "speech"
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    snr_db: float = 25.0
    fault: Literal["none", "dead", "copied", "drift"] = "none"
    command: Literal["locate", "listen"] = "locate"

    @property
    def name(self) -> str:
        """Says all of this in a few words."""
        return (
            f"{self.command}: {100 * self.apart_m:g} cm along {self.axis}, "
            f"{self.sound} from {self.bearing_deg:g} deg, {self.rate} Hz, "
            f"T60 {self.t60_s:g} s, SNR {self.snr_db:g} dB, fault: {self.fault}"
        )

    @property
    def places(self) -> NDArray[np.float64]:
        """(2, 3) places of the microphones, m."""
        half = 0.5 * self.apart_m * np.array(self.axis) / np.linalg.norm(self.axis)
        return np.array([-half, half])

    @property
    def place(self) -> NDArray[np.float64]:
        """(3,) place of the source, m."""
        turn = math.radians(self.bearing_deg)
        return np.array([1.4 * math.cos(turn), 1.4 * math.sin(turn), 0.1])

    def samples(self) -> NDArray[np.float64]:
        """Returns (2, k) samples of the channels."""
        rng = np.random.default_rng(len(self.name))
        seconds = 20.0 if self.fault == "drift" else 4.0
        sound = rng.standard_normal(round(seconds * self.rate))
        if self.sound == "speech":
            sound = speech_like(rng, seconds, self.rate)
        path = np.broadcast_to(self.place, (2, 3))
        heard = heard_moving(sound, self.rate, path, self.places, self.t60_s)
        if self.fault == "drift":
            t = np.arange(heard.shape[1])
            heard[1] = np.interp(t * (1.0 + 60e-6), t, heard[1])
        level = heard.std() * 10.0 ** (-self.snr_db / 20.0)
        heard += level * rng.standard_normal(heard.shape)
        if self.fault == "copied":
            heard[1] = heard[0]
        if self.fault == "dead":
            heard[1] *= 1e-4
        return np.asarray(0.3 * heard / np.abs(heard).max())


_NAMED = {"dead": "channel 2: dead", "copied": "samples are equal", "drift": "drift"}


def _judge(pair: Pair) -> Outcome:
    samples, geometry = pair.samples(), geometry_of(pair.places)
    wanted = _NAMED.get(pair.fault, "")
    if pair.command == "listen":
        off: list[float] = []
        stopped = streamed(
            samples,
            pair.rate,
            geometry,
            lambda _, b: off.append(
                angle_off_deg(math.degrees(b), pair.place, pair.places)
            ),
        )
        if wanted:
            return Outcome(wanted in stopped, stopped or "not stopped")
        near = float(np.mean(np.array(off) < _CLAIM_OFF_DEG)) if off else 0.0
        said = f"{100 * near:.0f} % of {len(off)} bearings are right {stopped}"
        return Outcome(near > 0.85 and not stopped, said)
    try:
        result = located(recorded_samples(samples, geometry, pair.rate), geometry)
    except InputError as error:
        return Outcome(bool(wanted) and wanted in str(error), str(error))
    summary = result.main_source()
    bearing, std = summary["bearing_deg"], summary["bearing_std_deg"]
    faults = "; ".join(fault.message for fault in result.faults)
    said = f"{bearing} +-{std} for {pair.bearing_deg} {faults}"
    level = abs(pair.axis[2]) < 1e-9
    if wanted or bearing is None or not level:
        return Outcome(not wanted and not level and bearing is None, said, bool(wanted))
    off_deg = angle_off_deg(bearing, pair.place, pair.places)
    ambiguous = summary["ambiguity"] == "front_back" and summary["range_m"] is None
    right = off_deg <= max(_DEVIATIONS * std, _OFF_DEG) and not faults and ambiguous
    false = any(
        source.confidence > CLAIM
        and angle_off_deg(source.bearing_deg, pair.place, pair.places) > _CLAIM_OFF_DEG
        for source in result.agreed.sources
    )
    return Outcome(right and not false, said, false)


_PAIRS = [
    *(Pair(0.1, bearing) for bearing in (0.0, 10.0, 35.0, 60.0, 90.0, 130.0, 170.0)),
    *(Pair(0.065, bearing, 0.3) for bearing in (50.0, 90.0, 140.0)),
    *(Pair(0.17, b, 0.3, 44_100) for b in (-30.0, -75.0, 80.0)),
    *(Pair(0.5, bearing, 0.2) for bearing in (40.0, 75.0, 120.0)),
    *(Pair(1.0, bearing, sound="noise") for bearing in (30.0, 85.0)),
    *(Pair(0.1, b, axis=(0.0, 1.0, 0.0)) for b in (20.0, -50.0, 160.0)),
    *(Pair(0.2, b, 0.6, 48_000, axis=(1.0, 1.0, 0.0)) for b in (0.0, 100.0)),
    Pair(0.02, 45.0, rate=48_000, sound="noise"),
    Pair(0.1, 60.0, axis=(1.0, 0.0, 1.0)),
    Pair(0.1, 60.0, axis=(0.0, 0.0, 1.0)),
    Pair(0.1, 70.0, snr_db=10.0),
    Pair(0.1, 70.0, snr_db=math.inf),
    Pair(0.1, 50.0, fault="dead"),
    Pair(0.1, 50.0, fault="copied"),
    Pair(0.1, 50.0, fault="drift"),
    *(Pair(0.1, b, t60, command="listen") for b, t60 in ((45.0, 0.0), (100.0, 0.3))),
    Pair(0.2, 60.0, rate=48_000, command="listen"),
    Pair(0.1, 50.0, fault="drift", sound="noise", command="listen"),
]


def cases() -> list[HearingCase]:
    """Returns pairs that hear one source, and pairs with a fault."""
    return [HearingCase(pair.name, partial(_judge, pair)) for pair in _PAIRS]
