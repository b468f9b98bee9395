"""Arrays that are 2 cm off, calibrated by sounds.

First from delays with noise, over many drawn arrays: errors of places beside what is
stated and beside the Cramer-Rao bound with all else unknown, too, and where left-out
sounds are located before and after. Then from recordings of bursts of noise in a room,
through the whole command; the bound there is that of delays without noise.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyroomacoustics as pra
import soundfile
from numpy.typing import NDArray
from scipy.optimize import least_squares

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.calibrate import CalibrationRun, calibrate, calibration_run
from analysis.arrays.calibration_sounds import CalibrationSounds, MeasuredSound
from studies.tables import Table

C, SPEED_STD, PLACE_STD, LATE_STD = 340.0, 3.4, 0.02, 1e-6
RATE = 48_000
ROOM_M = np.array([9.0, 8.0, 6.0])
_THIRDS = 2.0 * math.pi * np.arange(3) / 3.0
ARRAYS = {
    "triangle of 1.4 m and its middle": 0.8
    * np.vstack(
        (np.zeros(3), np.column_stack((np.cos(_THIRDS), np.sin(_THIRDS), 0 * _THIRDS)))
    ),
    "six in space, 1.4 m": np.array(
        [
            [0.5, 0.5, 0.0],
            [-0.5, 0.5, 0.2],
            [-0.5, -0.5, 0.0],
            [0.5, -0.5, 0.5],
            [0.0, 0.0, 0.7],
            [0.2, 0.1, -0.3],
        ]
    ),
}
HEADINGS = (
    "array",
    "sounds",
    "places, rms mm",
    "stated mm",
    "bound mm",
    "within 1, 2 deviations",
    "speed of sound, rms %",
    "left out before, m",
    "after, m",
)


@dataclass(frozen=True)
class Trial:
    """One array that was calibrated."""

    off_m: NDArray[np.float64]
    """Errors of all coordinates afterwards, m."""
    std_m: NDArray[np.float64]
    """What is stated of each, m."""
    bound_m: float
    """Root mean square of the least deviations that the sounds allow, m."""
    speed_share: float
    """Error of the speed of sound, as a share."""
    before_m: list[float]
    """Error of each left-out place as located by the stated array, m."""
    after_m: list[float]
    """The same by the calibrated one, m."""


def spots(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 3) places 3 to 4.5 m in front of the array, m."""
    level = rng.uniform(-1.5, 1.5, (count, 2))
    return np.column_stack((level, rng.uniform(3.0, 4.5, count)))


def arrivals(
    places: NDArray[np.float64], c: float, spot: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) s."""
    return np.asarray(np.linalg.norm(spot - places, axis=1) / c)


def bound(
    places: NDArray[np.float64],
    c: float,
    at: NDArray[np.float64],
    noise_std: float,
    spot_std: float | None,
) -> float:
    """Cramer-Rao bound of the places with speed, delays and spots unknown, too.

    By central differences about the truth; what is stated beforehand counts.

    Args:
        places: (n, 3) true, m.
        c: True speed of sound, m/s.
        at: (sounds, 3) true spots, m.
        noise_std: Of each arrival, s.
        spot_std: Of each coordinate of a stated spot, m; none: not stated.

    Returns:
        Root mean square over all coordinates of the microphones, m.
    """
    n, size = len(places), places.size
    truth = np.concatenate((places.ravel(), [c], np.zeros(n), at.ravel()))
    stds = np.concatenate(
        (
            np.full(size, PLACE_STD),
            [SPEED_STD],
            np.full(n, LATE_STD),
            np.full(at.size, np.inf if spot_std is None else max(spot_std, 1e-9)),
        )
    )

    def delays(x: NDArray[np.float64]) -> NDArray[np.float64]:
        p, late = x[:size].reshape(n, 3), x[size + 1 : size + 1 + n]
        spots = x[size + 1 + n :].reshape(-1, 3)
        heard = np.array([arrivals(p, x[size], spot) + late for spot in spots])
        return np.asarray((heard[:, 1:] - heard[:, :1]).ravel())

    steps = np.where(np.isfinite(stds), 1e-3 * stds, 1e-5)
    slopes = np.column_stack(
        [
            (delays(truth + row) - delays(truth - row)) / (2.0 * step)
            for row, step in zip(np.diag(steps), steps, strict=True)
        ]
    )
    one = np.linalg.inv(noise_std**2 * (np.eye(n - 1) + 1.0))
    weight = np.kron(np.eye(len(at)), one)
    # In deviations, so that the matrix is well conditioned.
    scale = np.where(np.isfinite(stds), stds, 1.0)
    information = (slopes * scale).T @ weight @ (slopes * scale)
    information += np.diag(np.isfinite(stds).astype(float))
    variances = np.diag(np.linalg.inv(information)) * scale**2
    return float(np.sqrt(np.mean(variances[:size])))


def located(
    places: NDArray[np.float64],
    c: float,
    tau: NDArray[np.float64],
    near: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Where delays fit best, from the true place on."""

    def left(spot: NDArray[np.float64]) -> NDArray[np.float64]:
        expected = arrivals(places, c, spot)
        return np.asarray(1e6 * (expected[1:] - expected[0] - tau))

    return np.asarray(least_squares(left, near, x_scale=0.1).x)


def stated(nominal: NDArray[np.float64]) -> ArrayGeometry:
    """The geometry file of an array that is known to 2 cm."""
    return ArrayGeometry.model_validate(
        {
            "microphones": nominal.tolist(),
            "position_std_m": PLACE_STD,
            "sound_speed": C,
            "sound_speed_std": SPEED_STD,
            "delay_std_s": LATE_STD,
        }
    )


def judged(
    run: CalibrationRun,
    places: NDArray[np.float64],
    c: float,
    left_out: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    least_m: float,
) -> Trial:
    """A calibration beside the truth, and what it does for places (spot, tau)."""
    found, nominal = run.calibration, run.calibration.unknowns.places
    late = found.channel_delays[1:] - found.channel_delays[0]
    before, after = [], []
    for spot, tau in left_out:
        by_stated = located(nominal, C, tau, spot)
        by_found = located(found.places, found.c, tau - late, spot)
        before.append(float(np.linalg.norm(by_stated - spot)))
        after.append(float(np.linalg.norm(by_found - spot)))
    return Trial(
        (found.places - places).ravel(),
        np.sqrt(np.diag(found.of_places)),
        least_m,
        found.c / c - 1.0,
        before,
        after,
    )


def from_delays(
    nominal: NDArray[np.float64],
    count: int,
    noise_std: float,
    spot_std: float,
    rng: np.random.Generator,
    *,
    known: bool = True,
) -> Trial:
    """One drawn array, calibrated by delays with noise."""
    places = nominal + PLACE_STD * rng.standard_normal(nominal.shape)
    c = C + SPEED_STD * rng.standard_normal()
    late = LATE_STD * rng.standard_normal(len(nominal))
    of_tau = noise_std**2 * (np.eye(len(nominal) - 1) + 1.0)

    def heard(spot: NDArray[np.float64]) -> NDArray[np.float64]:
        arrival = arrivals(places, c, spot) + late
        arrival = arrival + noise_std * rng.standard_normal(late.size)
        return np.asarray(arrival[1:] - arrival[0])

    at = spots(count, rng)
    sounds = [
        MeasuredSound(
            heard(spot),
            of_tau,
            spot + spot_std * rng.standard_normal(3) if known else None,
            spot_std,
        )
        for spot in at
    ]
    run = calibration_run(sounds, stated(nominal))
    left_out = [(spot, heard(spot)) for spot in spots(3, rng)]
    least_m = bound(places, c, at, noise_std, spot_std if known else None)
    return judged(run, places, c, left_out, least_m)


def from_recordings(
    nominal: NDArray[np.float64], count: int, t60: float, rng: np.random.Generator
) -> Trial:
    """One drawn array, calibrated by recordings in a room; 0 is the free field."""
    places = nominal + PLACE_STD * rng.standard_normal(nominal.shape)
    c = C + SPEED_STD * rng.standard_normal()
    where = np.array([4.2, 3.7, 0.9])
    at = spots(count + 3, rng)
    with tempfile.TemporaryDirectory() as folder:
        entries = []
        for k, spot in enumerate(at):
            record(Path(folder) / f"{k}.wav", places + where, spot + where, c, t60, rng)
            position = (spot + 0.005 * rng.standard_normal(3)).tolist()
            entries.append(
                {
                    "recording": f"{k}.wav",
                    "position_m": position,
                    "position_std_m": 0.005,
                }
            )
        listed = CalibrationSounds.model_validate(
            {"sounds": entries[:count], "folder": folder}
        )
        run = calibrate(listed, stated(nominal))
        alone = CalibrationSounds.model_validate(
            {"sounds": entries[count:], "folder": folder}
        )
        kept = calibrate(alone, stated(nominal)).calibration.sounds
    left_out = [(spot, s.tau) for spot, s in zip(at[count:], kept, strict=True)]
    # Bursts at 25 dB tell delays to some 10 ns: the spots' 5 mm are what is left.
    least_m = bound(places, c, at[:count], 1e-8, 0.005)
    return judged(run, places, c, left_out, least_m)


def record(
    path: Path,
    places: NDArray[np.float64],
    spot: NDArray[np.float64],
    c: float,
    t60: float,
    rng: np.random.Generator,
) -> None:
    """Writes a second of bursts of noise, 25 dB over the noise of the channels."""
    time = np.arange(RATE) / RATE
    noise = rng.standard_normal(RATE) * np.maximum(np.sin(8 * math.pi * time), 0.0) ** 2
    absorption, order = pra.inverse_sabine(t60, ROOM_M, c=c) if t60 else (1.0, 0)
    room = pra.ShoeBox(
        ROOM_M, fs=RATE, materials=pra.Material(absorption), max_order=order
    )
    room.set_sound_speed(c)
    room.add_source(spot, signal=noise)
    room.add_microphone_array(places.T)
    room.simulate()
    rows = room.mic_array.signals[:, :RATE]
    rows = rows + 10.0 ** (-25.0 / 20.0) * rows.std() * rng.standard_normal(rows.shape)
    soundfile.write(path, 0.05 * rows.T / rows.std(), RATE, subtype="PCM_24")


def table_row(array: str, sounds: str, trials: list[Trial]) -> tuple[str, ...]:
    """One row of the table."""
    off = np.array([trial.off_m for trial in trials])
    std = np.array([trial.std_m for trial in trials])
    shares = [float(np.mean(np.abs(off) < k * std)) for k in (1.0, 2.0)]
    speed = math.sqrt(np.mean([trial.speed_share**2 for trial in trials]))
    before = [error for trial in trials for error in trial.before_m]
    after = [error for trial in trials for error in trial.after_m]
    return (
        array,
        sounds,
        f"{1e3 * math.sqrt(np.mean(off**2)):.1f}",
        f"{1e3 * math.sqrt(np.mean(std**2)):.1f}",
        f"{1e3 * math.sqrt(np.mean([trial.bound_m**2 for trial in trials])):.1f}",
        f"{100 * shares[0]:.0f} %, {100 * shares[1]:.0f} %",
        f"{100 * speed:.2f}",
        f"{np.median(before):.2f}",
        f"{np.median(after):.3f}",
    )


def table_rows(draws: int, rooms: int) -> Iterator[tuple[str, ...]]:
    """All rows, those by delays first.

    Args:
        draws: Arrays a row by delays.
        rooms: Arrays a row by recordings.
    """
    for name, nominal in ARRAYS.items():
        for count, noise_std, spot_std in (
            (3, 1e-6, 0.005),
            (9, 1e-6, 0.005),
            (9, 5e-6, 0.005),
            (9, 1e-6, 0.02),
            (30, 1e-6, 0.005),
        ):
            rng = np.random.default_rng(1)
            trials = [
                from_delays(nominal, count, noise_std, spot_std, rng)
                for _ in range(draws)
            ]
            told = f"{count} at {1e3 * spot_std:.0f} mm, {1e6 * noise_std:.0f} us"
            yield table_row(name, told, trials)
        rng = np.random.default_rng(1)
        trials = [
            from_delays(nominal, 9, 1e-6, 0.0, rng, known=False) for _ in range(draws)
        ]
        yield table_row(name, "9 at unknown places, 1 us", trials)
    for t60 in (0.0, 0.3, 0.6):
        for name, nominal in ARRAYS.items():
            rng = np.random.default_rng(2)
            trials = [from_recordings(nominal, 9, t60, rng) for _ in range(rooms)]
            yield table_row(name, f"9 recordings, T60 {t60:g} s", trials)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--draws", type=int, default=100, help="by delays, a row (100)")
    parser.add_argument("--rooms", type=int, default=5, help="by recordings (5)")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield Table("calibrated arrays", HEADINGS, table_rows(options.draws, options.rooms))
