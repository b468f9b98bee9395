"""Sources that move past or around an array, and clocks that drift apart."""

from __future__ import annotations

import math
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from analysis.arrays.locate import located
from analysis.arrays.recorded_samples import recorded_samples
from studies.support.hearing_arrays import (
    ARRAYS,
    angle_off_deg,
    geometry_of,
    streamed,
)
from studies.support.hearing_cases.case import HearingCase, Outcome
from studies.support.image_sources import heard_moving
from studies.support.synthetic_speech import speech_like
from systems.framework.input_error import InputError

TITLE = "moving sources and drifting clocks"

_SNR_DB = 25.0
# Places of a path, 1/s.
_PLACES_HZ = 50
# Least share of the estimates, or of the bearings of tracks, that are right.
_RIGHT = 0.85
# Largest error of a bearing, in stated deviations, and deg. A stretch of a moving
# source covers several degrees.
_DEVIATIONS, _OFF_DEG = 3.0, 10.0


class Motion(NamedTuple):
    """A source that moves, and what hears it."""

    array: str
    kind: Literal["walk", "circle", "turn", "rest"]
    """A walk along the line y = 1 m, a circle around the array, an array that turns, or
    nothing that moves."""
    speed: float
    """m/s, or deg/s."""
    seconds: float
    rate: int = 16_000
    t60_s: float = 0.0
    sound: Literal["noise", "speech"] = "noise"
    drift_ppm: float = 0.0
    drifting: tuple[int, ...] = ()
    """Channels whose clock drifts, counted from 0."""
    command: Literal["locate", "listen"] = "locate"

    @property
    def name(self) -> str:
        """Says all of this in a few words."""
        drift = f", drift {self.drift_ppm:g} ppm of {self.drifting}"
        return (
            f"{self.command}: {self.array}, {self.kind} {self.speed:g}, "
            f"{self.seconds:g} s of {self.sound}, {self.rate} Hz, T60 {self.t60_s:g} s"
            + (drift if self.drifting else "")
        )

    def path(self) -> NDArray[np.float64]:
        """Returns (k, 3) places of the source in the axes of the array, m."""
        t = np.arange(round(self.seconds * _PLACES_HZ)) / _PLACES_HZ
        height = np.full(t.size, 0.2)
        if self.kind == "walk":
            x = self.speed * (t - 0.5 * self.seconds)
            # In a room, a walker turns around in front of the walls.
            x = 2.0 - np.abs((x + 2.0) % 8.0 - 4.0) if self.t60_s else x
            return np.stack((x, np.ones(t.size), height), axis=1)
        turn = math.radians(self.speed) * t * (self.kind != "rest")
        begin = math.radians(20.0)
        far = 1.2 if self.t60_s else 2.0
        at = (far * np.cos(begin + turn), far * np.sin(begin + turn), height)
        return np.stack(at, axis=1)

    def samples(self) -> NDArray[np.float64]:
        """Returns (n, k) samples of the channels."""
        rng = np.random.default_rng(len(self.name))
        count = round(self.seconds * self.rate)
        if self.sound == "noise":
            sound = rng.standard_normal(count)
        else:
            sound = speech_like(rng, self.seconds, self.rate)
        path, places = self.path(), ARRAYS[self.array]
        if self.kind == "turn":  # The source rests in the room, and the array turns.
            turn = -math.radians(self.speed) * np.arange(len(path)) / _PLACES_HZ
            path = np.broadcast_to(path[0], path.shape)
            cos, sin, zero = np.cos(turn), np.sin(turn), 0.0 * turn
            rows = [[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1.0]]
            places = np.einsum("abk,nb->kna", np.array(rows), places)
        heard = heard_moving(sound, self.rate, path, places, self.t60_s)
        t = np.arange(count)
        for k in self.drifting:
            heard[k] = CubicSpline(t, heard[k])(t * (1.0 - 1e-6 * self.drift_ppm))
        noise = 10.0 ** (-_SNR_DB / 20.0) * heard.std()
        heard += noise * rng.standard_normal(heard.shape)
        return np.asarray(0.3 * heard / np.abs(heard).max())


def _judge(motion: Motion) -> Outcome:
    said, told = _heard(motion)
    if motion.drifting:
        *first, last = (str(k + 1) for k in motion.drifting)
        names = f"channels {', '.join(first)} and" if first else "channel"
        right = f"{names} {last}: " in said and "drifts" in said
        return Outcome(right, said or "no drift")
    if said:
        return Outcome(right=False, said=said)
    path, places = motion.path(), ARRAYS[motion.array]
    good = [
        angle_off_deg(bearing, path[min(round(t * _PLACES_HZ), len(path) - 1)], places)
        <= max(_DEVIATIONS * std, _OFF_DEG)
        for t, bearing, std in told
    ]
    share = float(np.mean(good)) if good else 0.0
    return Outcome(
        share >= _RIGHT, f"{100 * share:.0f} % of {len(good)} bearings are right"
    )


def _heard(motion: Motion) -> tuple[str, list[tuple[float, float, float]]]:
    """Returns a refusal or faults, and times, bearings and deviations, s and deg."""
    geometry, samples = geometry_of(ARRAYS[motion.array]), motion.samples()
    told: list[tuple[float, float, float]] = []
    if motion.command == "listen":

        def tell(t_s: float, bearing: float) -> None:
            # The window of a step is half a second.
            told.append((t_s - 0.25, math.degrees(bearing), 5.0))

        return streamed(samples, motion.rate, geometry, tell), told
    try:
        result = located(recorded_samples(samples, geometry, motion.rate), geometry)
    except InputError as error:
        return str(error), told
    told = [
        (e.t_s, e.bearing_deg, e.bearing_std_deg or 0.0)
        for e in result.estimates
        if e.bearing_deg is not None
    ]
    return "; ".join(fault.message for fault in result.faults), told


_SMALL = "square 4.6 cm"
_MOTIONS = [
    Motion(_SMALL, "walk", 0.5, 10.0),
    Motion(_SMALL, "walk", 1.0, 10.0),
    Motion(_SMALL, "walk", 1.5, 10.0),
    Motion("row of 4", "walk", 0.5, 10.0),
    Motion("row of 4", "walk", 1.5, 10.0, sound="speech"),
    Motion("triangle 10 cm", "walk", 1.0, 10.0),
    Motion("circle of 6", "walk", 1.0, 10.0, sound="speech"),
    Motion("circle of 8", "walk", 0.7, 8.0, rate=48_000),
    Motion("tetrahedron", "walk", 1.0, 10.0),
    Motion("square 1 m", "walk", 1.0, 10.0),
    Motion(_SMALL, "walk", 0.5, 8.0, t60_s=0.3),
    Motion("circle of 8", "walk", 1.0, 8.0, t60_s=0.6),
    Motion("row of 4", "walk", 0.8, 8.0, t60_s=0.3, sound="speech"),
    Motion(_SMALL, "circle", 5.0, 20.0),
    Motion(_SMALL, "circle", 10.0, 12.0),
    Motion(_SMALL, "circle", 20.0, 12.0, rate=48_000),
    Motion("row of 4", "circle", 10.0, 12.0),
    Motion("circle of 6", "circle", 45.0, 12.0),
    Motion("circle of 8", "circle", 30.0, 8.0, sound="speech"),
    Motion("tetrahedron", "circle", 20.0, 12.0),
    Motion("square 1 m", "circle", 10.0, 12.0),
    Motion("triangle 10 cm", "circle", 15.0, 12.0),
    Motion("row of 3", "circle", 10.0, 12.0),
    Motion("circle of 6", "circle", 20.0, 8.0, t60_s=0.3),
    Motion(_SMALL, "turn", 20.0, 10.0),
    Motion("circle of 8", "turn", 10.0, 8.0, t60_s=0.3),
    Motion(_SMALL, "walk", 1.0, 10.0, command="listen"),
    Motion("row of 4", "walk", 0.7, 10.0, command="listen"),
    Motion("circle of 6", "circle", 20.0, 12.0, command="listen"),
    Motion(_SMALL, "circle", 10.0, 12.0, t60_s=0.3, command="listen"),
    Motion("circle of 8", "circle", 40.0, 9.0, sound="speech", command="listen"),
]
_DRIFTS = [
    Motion(_SMALL, "rest", 0, 20.0, drift_ppm=50.0, drifting=(2,)),
    Motion(_SMALL, "rest", 0, 20.0, drift_ppm=-50.0, drifting=(2, 3)),
    Motion("row of 4", "rest", 0, 20.0, drift_ppm=50.0, drifting=(3,)),
    Motion("circle of 6", "rest", 0, 20.0, drift_ppm=50.0, drifting=(1, 2)),
    Motion("circle of 8", "rest", 0, 20.0, drift_ppm=50.0, drifting=(4,)),
    Motion(_SMALL, "rest", 0, 60.0, drift_ppm=20.0, drifting=(1,)),
    Motion("square 1 m", "rest", 0, 60.0, drift_ppm=20.0, drifting=(3,)),
    Motion(
        _SMALL,
        "rest",
        0,
        20.0,
        t60_s=0.3,
        sound="speech",
        drift_ppm=50.0,
        drifting=(1,),
    ),
    Motion(
        "circle of 6", "rest", 0, 20.0, sound="speech", drift_ppm=50.0, drifting=(3,)
    ),
    Motion(_SMALL, "rest", 0, 20.0, drift_ppm=50.0, drifting=(2, 3), command="listen"),
    # A source could move in the same way. This must be said, but is no refusal.
    Motion("triangle 1 m", "rest", 0, 20.0, drift_ppm=50.0, drifting=(1,)),
    Motion("pair 1 m", "rest", 0, 20.0, drift_ppm=-50.0, drifting=(1,)),
]


def cases() -> list[HearingCase]:
    """Returns sources that must be followed, and drifts that must be refused."""
    return [
        HearingCase(motion.name, partial(_judge, motion))
        for motion in [*_MOTIONS, *_DRIFTS]
    ]
