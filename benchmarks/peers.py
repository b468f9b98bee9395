"""``python -m benchmarks.peers``: our estimators beside those of pyroomacoustics.

The same frames for all: a chirp of 0.5-8 kHz, 20 dB over the noise at the array, in
the cells of Han 2019. pyroomacoustics is used as its documentation shows: `tdoa`
(PHAT, interpolated 16-fold) on the two neighbouring pairs with our closed form
behind it, and SRP-PHAT and NormMUSIC in the far field over a grid of 0.1 deg. The
last two give no range.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from time import perf_counter

import numpy as np
import pyroomacoustics as pra
from numpy.typing import NDArray
from pyroomacoustics.experimental import tdoa

from analysis.free_field import Loudspeaker, frame_estimator, run_cell
from analysis.paper_tables import PAPER_CELLS
from systems.array_shape import ArrayShape
from systems.localise import TDOAParameters
from systems.multilateration import locate_source
from systems.robot import RobotParameters
from systems.signals import SAMPLE_RATE_HZ

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
BAND_HZ = [500.0, 8_000.0]
#: Snapshots of a frame for SRP and MUSIC: long against the array's 2.4 ms.
SNAPSHOT, HOP = 2048, 64
#: A bearing or a range further off than this is an outlier, deg and share.
OUTLIER_DEG, OUTLIER_SHARE = 5.0, 0.5

#: Bearing, rad, and range, m: infinite where a frame has none, None where the
#: method never has.
Place = tuple[float, float | None]
Method = Callable[[NDArray[np.float32]], Place | None]


def ours(method: str) -> Method:
    """One of our methods."""
    parameters = TDOAParameters.model_validate({"method": method})
    estimate = frame_estimator(parameters, SHAPE, C)

    def locate(frame: NDArray[np.float32]) -> Place | None:
        fix = estimate(frame)
        return fix and (fix.bearing, fix.range if fix.range_valid else math.inf)

    return locate


def delays_of_pairs(frame: NDArray[np.float32]) -> Place:
    """pyroomacoustics' delays, placed by our closed form."""
    tau_21, tau_32 = (
        tdoa(frame[k + 1], frame[k], interp=16, fs=SAMPLE_RATE_HZ, phat=True)
        for k in range(2)
    )
    tau = np.array([tau_21, tau_21 + tau_32])
    covariance = 1e-14 * np.array([[2.0, 1.0], [1.0, 2.0]])
    fix = locate_source(tau, covariance, SHAPE, C)
    return fix.bearing, fix.range if fix.range_valid else math.inf


def far_field(name: str) -> Method:
    """A direction finder over the half plane ahead."""
    finder = pra.doa.algorithms[name](
        SHAPE.p_AM.T,
        SAMPLE_RATE_HZ,
        SNAPSHOT,
        c=C,
        azimuth=np.radians(np.linspace(-90.0, 90.0, 1801)),
    )

    def locate(frame: NDArray[np.float32]) -> Place:
        starts = range(0, frame.shape[1] - SNAPSHOT + 1, HOP)
        window = np.hanning(SNAPSHOT)
        cut = np.stack([frame[:, s : s + SNAPSHOT] * window for s in starts], axis=-1)
        finder.locate_sources(np.fft.rfft(cut, axis=1), freq_range=BAND_HZ)
        return float(finder.azimuth_recon[0]), None

    return locate


def methods() -> dict[str, Method]:
    """All, by the name in the table."""
    return {
        "ours, fast": ours("gcc"),
        "ours, maximum likelihood": ours("ml"),
        "pyroomacoustics tdoa": delays_of_pairs,
        "pyroomacoustics SRP": far_field("SRP"),
        "pyroomacoustics NormMUSIC": far_field("NormMUSIC"),
    }


def wrapped_deg(angle: float) -> float:
    """The angle in [-180, 180) deg."""
    return (math.degrees(angle) + 180.0) % 360.0 - 180.0


def main(trials: int) -> None:
    """Prints the table."""
    loudspeaker = Loudspeaker.of("chirp", seed=3)
    found: dict[str, dict[float, list[tuple[float, float | None]]]] = {}
    times: dict[str, list[float]] = {}

    def listen(name: str, method: Method, distance: float, bearing_deg: float):
        def estimate(frame: NDArray[np.float32]) -> None:
            start = perf_counter()
            place = method(frame)
            times.setdefault(name, []).append(perf_counter() - start)
            turned, reach = math.inf, place and place[1]
            if place is not None:
                turned = wrapped_deg(place[0]) - bearing_deg
            error = None if reach is None else reach - distance
            found.setdefault(name, {}).setdefault(distance, []).append((turned, error))

        return estimate

    everyone = methods()
    for seed, cell in enumerate(PAPER_CELLS):
        run_cell(
            loudspeaker,
            {
                name: listen(name, method, cell.range_m, cell.bearing_deg)
                for name, method in everyone.items()
            },
            cell.range_m,
            cell.bearing_deg,
            shape=SHAPE,
            snr_db=20.0,
            c=C,
            trials=trials,
            seed=seed,
        )
    distances = sorted({cell.range_m for cell in PAPER_CELLS})
    print(
        "Bearing RMSE deg / range RMSE m (outliers) over 0, 30 and 60 deg; "
        "RMSE without outliers\n"
    )
    print(f"| method | {' | '.join(f'{d:g} m' for d in distances)} | ms a frame |")
    print("|---" * (len(distances) + 2) + "|")
    for name in everyone:
        cells = [summary(found[name][d], d) for d in distances]
        milliseconds = 1e3 * float(np.median(times[name]))
        print(f"| {name} | {' | '.join(cells)} | {milliseconds:.2f} |")


def summary(errors: list[tuple[float, float | None]], distance: float) -> str:
    """RMSEs of what is no outlier, and the share of outliers."""
    good = [
        (turned, error)
        for turned, error in errors
        if abs(turned) < OUTLIER_DEG and abs(error or 0.0) < OUTLIER_SHARE * distance
    ]
    share = 1.0 - len(good) / len(errors)
    text = "-"
    if good:
        text = f"{math.sqrt(np.mean([t * t for t, _ in good])):.4f} / "
        of_range = [e for _, e in good if e is not None]
        text += f"{math.sqrt(np.mean(np.square(of_range))):.4f}" if of_range else "-"
    return text + (f" ({100.0 * share:.0f} %)" if share else "")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=50, help="frames a cell")
    main(parser.parse_args().trials)
