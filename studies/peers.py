"""Our estimators beside those of pyroomacoustics.

The cells of Han 2019 (1-4 m; 0, 30 and 60 deg) in the free field, sound of
0.5-8 kHz 20 dB above white noise at the array, 25 ms at 100 kHz; every
estimator gets the same frames. Each trial's bearing lies within half a degree
of its cell's, so that no search grid is favored. Cells are the RMSE of the bearing in
deg / of the range in m; in brackets the share of outliers, which are left out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.cramer_rao import LocalizationBound, position_bound
from analysis.arrays.paper_tables import PAPER_CELLS
from analysis.arrays.single_frames import Loudspeaker
from studies.support.figures import stay_on_one_core
from studies.support.peer_estimators import SHAPE, C, Frame, estimators
from studies.tables import Table
from systems.framework.signals import SAMPLE_RATE_HZ, TICK_S

SNR_DB = 20.0

#: Off by more is an outlier: the bearing, and the range as a share of itself.
OUTLIER_DEG, OUTLIER_SHARE = 10.0, 0.5


@dataclass(frozen=True)
class PeerCell:
    """What an estimator did in one place."""

    range_m: float
    bearing_deg: float
    trials: int
    outliers: int
    bearing_rmse_deg: float | None
    """Of the frames that are no outliers; None where all are."""
    range_rmse_m: float | None
    """The same; None too for those who give no range."""


@dataclass(frozen=True)
class PeerResult:
    """What an estimator did in all places."""

    name: str
    time_ms: float
    """Median processor time a frame, ms; 0 for the bound."""
    cells: list[PeerCell]


def frames(
    loudspeaker: Loudspeaker, range_m: float, bearing_deg: float, trials: int, seed: int
) -> Iterator[tuple[Frame, float, LocalizationBound]]:
    """Frames of one place, each with its bearing in rad and the bound."""
    rng = np.random.default_rng(seed)
    noise_pa = loudspeaker.level_pa / range_m * 10.0 ** (-SNR_DB / 20.0)
    for _ in range(trials):
        bearing = math.radians(bearing_deg + rng.uniform(-0.5, 0.5))
        p_AS = range_m * np.array([math.cos(bearing), math.sin(bearing)])
        begin = rng.uniform(0.1, loudspeaker.seconds - 0.1)
        frame = loudspeaker.pressure(begin, p_AS, SHAPE.p_AM, C)
        frame += noise_pa * rng.standard_normal(frame.shape, dtype=np.float32)
        bound = position_bound(
            loudspeaker.energy,
            begin,
            begin + TICK_S,
            p_AS,
            SHAPE.p_AM,
            noise_pa,
            sample_rate_hz=SAMPLE_RATE_HZ,
            c=C,
        )
        yield frame, bearing, bound


def compare(
    kind: str, places: list[tuple[float, float]], trials: int
) -> list[PeerResult]:
    """Runs all estimators on the same frames.

    Args:
        kind: Of sound, ``chirp`` or ``band_noise``.
        places: Range in m and bearing in deg of each cell.
        trials: Frames a cell.

    Returns:
        The Cramer-Rao bound, then the estimators.
    """
    loudspeaker, contenders = Loudspeaker.of(kind, seed=3), estimators()
    times: dict[str, list[float]] = {name: [] for name in contenders}
    cells: dict[str, list[PeerCell]] = {name: [] for name in ("bound", *contenders)}
    for seed, (range_m, bearing_deg) in enumerate(places):
        errors: dict[str, list[tuple[float, float]]] = {name: [] for name in cells}
        for frame, bearing, bound in frames(
            loudspeaker, range_m, bearing_deg, trials, seed
        ):
            errors["bound"].append((bound.bearing_std, bound.range_std))
            for name, estimate in contenders.items():
                if not times[name]:
                    estimate(frame)  # compiles, fills caches
                start = process_time()
                found = estimate(frame)
                times[name].append(process_time() - start)
                errors[name].append((found[0] - bearing, found[1] - range_m))
        for name, values in errors.items():
            cells[name].append(_cell(np.array(values), range_m, bearing_deg))
    return [
        PeerResult(name, 1e3 * float(np.median(times.get(name, [0.0]))), found)
        for name, found in cells.items()
    ]


def _cell(errors: NDArray[np.float64], range_m: float, bearing_deg: float) -> PeerCell:
    """Sums up (trials, 2) errors of bearing in rad and range in m."""
    bearing, distance = np.rad2deg(errors[:, 0]), errors[:, 1]
    good = np.abs(bearing) <= OUTLIER_DEG
    ranged = np.isfinite(distance).any()
    if ranged:
        good &= np.abs(distance) <= OUTLIER_SHARE * range_m
    return PeerCell(
        range_m=range_m,
        bearing_deg=bearing_deg,
        trials=len(errors),
        outliers=int(np.count_nonzero(~good)),
        bearing_rmse_deg=_rms(bearing[good]),
        range_rmse_m=_rms(distance[good]) if ranged else None,
    )


def _rms(values: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def table(results: list[PeerResult]) -> Table:
    """A row is an estimator at one bearing."""
    distances = sorted({cell.range_m for cell in results[0].cells})
    fastest = next(result.time_ms for result in results if result.name == "gcc")
    header = ["estimator", "bearing", *(f"{r:g} m" for r in distances), "ms", "x gcc"]
    rows = []
    for result in results:
        title = [result.name]
        times = [f"{result.time_ms:.2f}", f"{result.time_ms / fastest:.1f}"]
        for bearing in sorted({cell.bearing_deg for cell in result.cells}):
            cells = sorted(
                (cell for cell in result.cells if cell.bearing_deg == bearing),
                key=lambda cell: cell.range_m,
            )
            texts = [_cell_text(cell) for cell in cells]
            rows.append([*title, f"{bearing:g} deg", *texts, *times])
            title, times = [""], ["", ""]
    return Table("estimators on the same frames", header, rows)


def _cell_text(cell: PeerCell) -> str:
    if cell.bearing_rmse_deg is None:
        return "all outliers"
    text = f"{cell.bearing_rmse_deg:.4f}"
    if cell.range_rmse_m is not None:
        text += f" / {cell.range_rmse_m:.4f}"
    if cell.outliers:
        text += f" ({100.0 * cell.outliers / cell.trials:.0f} %)"
    return text


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--trials", type=int, default=50, help="frames a cell")
    parser.add_argument("--sound", choices=("chirp", "band_noise"), default="chirp")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    stay_on_one_core()
    places = [(place.range_m, place.bearing_deg) for place in PAPER_CELLS]
    yield table(compare(options.sound, places, options.trials))
