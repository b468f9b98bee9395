"""Late recorders, lost samples, dying channels, water, near and directional cases."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.live_hearing import HeardStep, LiveHearing, listen_to
from analysis.arrays.sound_stream import SoundBlock, SoundStream
from phonotaxis import locate
from studies.support.faulty_recordings import (
    CIRCLE,
    LARGE,
    ROW,
    SQUARE,
    TETRAHEDRON,
    Setting,
    late,
    lost,
    off_by_deg,
)
from studies.support.hearing_cases.case import (
    HearingCase,
    Outcome,
    claims_elsewhere,
    is_near,
)

TITLE = "faults by their names"

_ARRAYS = {"square": SQUARE, "row": ROW, "circle": CIRCLE, "1.5 m": LARGE}

Samples = NDArray[np.float64]


def _geometry(setting: Setting, temperature_c: float | None) -> ArrayGeometry:
    places = tuple(map(tuple, setting.places.tolist()))
    return ArrayGeometry(microphones=places, temperature_c=temperature_c)


def _located(
    make: Callable[[], tuple[Samples, Setting]],
    words: tuple[str, ...],
    *,
    temperature_c: float | None = 20.0,
) -> Outcome:
    """All words are in the refusal, or in the faults beside a bearing that is right."""
    samples, setting = make()
    logging.disable(logging.WARNING)
    try:
        result = locate(
            samples, _geometry(setting, temperature_c), sample_rate_hz=setting.rate
        )
    except ValueError as error:
        return Outcome(all(word in str(error) for word in words), str(error))
    finally:
        logging.disable(logging.NOTSET)
    faults = "; ".join(fault.message for fault in result.faults)
    main = result.main_source()
    bearing, std = main["bearing_deg"], main["bearing_std_deg"] or 0.0
    truth = setting.bearing_deg
    # The channels that are left may not measure a bearing.
    near = bearing is None or is_near(bearing, std, truth)
    return Outcome(
        all(word in faults for word in words) and near,
        f"{bearing} +- {std:.1f} for {truth}: {faults}",
        claims_elsewhere(result.agreed.sources, [truth]),
    )


def _listened(
    make: Callable[[], tuple[Samples, Setting]], words: tuple[str, ...]
) -> Outcome:
    """All words are in one message, and the bearing is right at the end."""
    samples, setting = make()
    size = setting.rate // 50
    blocks = (
        SoundBlock(samples[:, k : k + size].astype(np.float32))
        for k in range(0, samples.shape[1], size)
    )
    stream = SoundStream(len(samples), setting.rate, blocks)
    told: list[tuple[float, float]] = []

    def tell(step: HeardStep) -> None:
        tracks = sorted(step.sources.tracks, key=lambda track: -track.confidence)
        told.extend(
            (step.sources.t_s, math.degrees(track.bearing)) for track in tracks[:1]
        )

    heard = listen_to(LiveHearing(stream, _geometry(setting, 20.0)), tell)
    named = [fault for fault in heard.faults if all(word in fault for word in words)]
    last = [bearing for t_s, bearing in told if t_s > heard.seconds - 2.0]
    off = off_by_deg(float(np.median(last)), setting.bearing_deg) if last else 180.0
    one = len(named) == len(heard.faults) == 1
    right = one and not heard.failed and bool(off < 10.0)
    return Outcome(right, f"{heard.status}, {off:.0f} deg off: {heard.faults}")


def _setting(array: str, k: int, t60_s: float = 0.3, rate: int = 16_000) -> Setting:
    rng = np.random.default_rng([len(array), k])
    # Ahead of a row, whose delays would else be alike.
    bearing = float(rng.uniform(30.0, 150.0) if array == "row" else rng.uniform(0, 360))
    range_m = 1.9 if array == "1.5 m" else float(rng.uniform(0.9, 1.8))
    return Setting(_ARRAYS[array], bearing, 10.0, range_m, t60_s, rate)


def _late(array: str, out: tuple[int, ...], ms: float) -> tuple[Samples, Setting]:
    setting = _setting(array, round(ms))
    count = round(1e-3 * ms * setting.rate)
    return late(setting.speech(6.0, 1), out, count), setting


def _lost(array: str, out: tuple[int, ...], count: int) -> tuple[Samples, Setting]:
    setting = _setting(array, count)
    at = 6 * setting.rate
    return lost(setting.speech(12.0, 2), out, at, count), setting


def _dying(array: str, k: int, instead: str) -> tuple[Samples, Setting]:
    setting = _setting(array, k)
    samples = setting.speech(12.0, 3)
    half = samples.shape[1] // 2
    rng = np.random.default_rng(k)
    noise = samples[k].std() * rng.standard_normal(samples.shape[1] - half)
    samples[k, half:] = noise if instead == "noise" else 0.0
    return samples, setting


def _in_water(edge_m: float, bearing_deg: float) -> tuple[Samples, Setting]:
    setting = Setting(
        edge_m * TETRAHEDRON, bearing_deg, 10.0, 10.0, 0.0, 48_000, c=1480.0
    )
    return setting.speech(4.0, 4), setting


def _near(array: str, range_m: float, bearing_deg: float) -> tuple[Samples, Setting]:
    setting = Setting(_ARRAYS[array], bearing_deg, 0.0, range_m)
    return setting.speech(5.0, 5), setting


def _directional(
    places: NDArray[np.float64], pattern: float, bearing_deg: float
) -> tuple[Samples, Setting]:
    setting = Setting(places, bearing_deg, pattern=pattern)
    return setting.speech(5.0, 6), setting


def _names(out: tuple[int, ...]) -> str:
    return f"channel{'s' * (len(out) > 1)} {' and '.join(str(k + 1) for k in out)}"


_Judged = tuple[str, Callable[[], Outcome]]


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    each = (*_late_ones(), *_changing_ones(), *_other_ones(), *_live_ones())
    return [HearingCase(name, judge) for name, judge in each]


def _late_ones() -> Iterator[_Judged]:
    pairs = {"square": (2, 3), "row": (2, 3), "circle": (4, 5), "1.5 m": (1,)}
    for array, out in pairs.items():
        for ms in (1.5, 10.0, 50.0, 200.0):
            if array == "1.5 m" and ms < 10.0:
                continue  # shorter than the delays of this array
            make = partial(_late, array, out, ms)
            words: tuple[str, ...] = (_names(out), "late")
            yield f"{array}, {ms} ms late", partial(_located, make, words)


def _changing_ones() -> Iterator[_Judged]:
    for array in _ARRAYS:
        for out, count in (((1,), 1), ((1,), 37), ((3,), 480)):
            make = partial(_lost, array, out, count)
            words: tuple[str, ...] = (_names(out), f"{count} sample", "lost at 6")
            yield f"{array}, {count} lost", partial(_located, make, words)
        for instead in ("noise", "zeros"):
            make = partial(_dying, array, 2, instead)
            words = ("channel 3: dead", "from 6")
            yield f"{array}, {instead} from half way", partial(_located, make, words)


def _other_ones() -> Iterator[_Judged]:
    for edge_m in (0.3, 1.0):
        for bearing in (20.0, 130.0, 250.0):
            make = partial(_in_water, edge_m, bearing)
            judge = partial(_located, make, ("speed of sound",), temperature_c=None)
            yield f"tetrahedron of {edge_m} m in water, {bearing:g} deg", judge
    for array, bearing in (("square", 35.0), ("circle", 80.0), ("row", 60.0)):
        for range_m in (0.1, 0.15):
            make = partial(_near, array, range_m, bearing)
            words: tuple[str, ...] = ("the source is about", "0.2 m away")
            yield f"{array}, source at {range_m} m", partial(_located, make, words)
    for pattern in (0.5, 0.37):
        for bearing in (45.0, 10.0):
            make = partial(_directional, 5.0 * CIRCLE, pattern, bearing)
            judge = partial(_located, make, ("directional",))
            yield f"circle of 0.5 m, pattern {pattern}, {bearing:g} deg", judge


def _live_ones() -> Iterator[_Judged]:
    for array in ("square", "row", "circle"):
        for count in (1, 37):
            make = partial(_lost, array, (1,), count)
            words: tuple[str, ...] = ("channel 2", "lost at 6", "left out")
            yield f"listen: {array}, {count} lost", partial(_listened, make, words)
        make = partial(_dying, array, 2, "noise")
        words = ("channel 3", "left out")
        yield f"listen: {array}, noise from half way", partial(_listened, make, words)
    for array, out in (("square", (1,)), ("row", (3,)), ("circle", (4, 5))):
        make = partial(_late, array, out, 20.0)
        words = (_names(out), "late", "left out")
        yield f"listen: {array}, {_names(out)} late", partial(_listened, make, words)
