"""``python -m benchmarks.calibration``: arrays that are 2 cm off, calibrated by sounds.

First from delays with noise, over many drawn arrays: errors of places beside what is
stated, and where left-out sounds are located before and after. Then from recordings
of bursts of noise in a room, through the whole command.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyroomacoustics as pra
import soundfile
from numpy.typing import NDArray
from scipy.optimize import least_squares

from analysis.calibration import (
    CalibrationRun,
    CalibrationSounds,
    MeasuredSound,
    calibrate,
    calibration_run,
)
from analysis.recordings import ArrayGeometry
from analysis.reporting.markdown import markdown_head, markdown_row

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

    sounds = [
        MeasuredSound(
            heard(spot),
            of_tau,
            spot + spot_std * rng.standard_normal(3) if known else None,
            spot_std,
        )
        for spot in spots(count, rng)
    ]
    run = calibration_run(sounds, stated(nominal))
    left_out = [(spot, heard(spot)) for spot in spots(3, rng)]
    return judged(run, places, c, left_out)


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
    return judged(run, places, c, left_out)


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


def print_row(array: str, sounds: str, trials: list[Trial]) -> None:
    """One row of the table."""
    off = np.array([trial.off_m for trial in trials])
    std = np.array([trial.std_m for trial in trials])
    shares = [float(np.mean(np.abs(off) < k * std)) for k in (1.0, 2.0)]
    speed = math.sqrt(np.mean([trial.speed_share**2 for trial in trials]))
    before = [error for trial in trials for error in trial.before_m]
    after = [error for trial in trials for error in trial.after_m]
    cells = (
        array,
        sounds,
        f"{1e3 * math.sqrt(np.mean(off**2)):.1f}",
        f"{1e3 * math.sqrt(np.mean(std**2)):.1f}",
        f"{100 * shares[0]:.0f} %, {100 * shares[1]:.0f} %",
        f"{100 * speed:.2f}",
        f"{np.median(before):.2f}",
        f"{np.median(after):.3f}",
    )
    print(markdown_row(cells), flush=True)


def run(draws: int, rooms: int) -> None:
    """Prints the table, a row as soon as it is known."""
    print(markdown_head(HEADINGS))
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
            print_row(name, told, trials)
        rng = np.random.default_rng(1)
        trials = [
            from_delays(nominal, 9, 1e-6, 0.0, rng, known=False) for _ in range(draws)
        ]
        print_row(name, "9 at unknown places, 1 us", trials)
    for t60 in (0.0, 0.3, 0.6):
        for name, nominal in ARRAYS.items():
            rng = np.random.default_rng(2)
            trials = [from_recordings(nominal, 9, t60, rng) for _ in range(rooms)]
            print_row(name, f"9 recordings, T60 {t60:g} s", trials)


def main() -> None:
    """Reads the number of arrays that are drawn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=100, help="by delays, a row (100)")
    parser.add_argument("--rooms", type=int, default=5, help="by recordings (5)")
    options = parser.parse_args()
    run(options.draws, options.rooms)


if __name__ == "__main__":
    main()
