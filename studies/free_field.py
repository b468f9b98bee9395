"""Estimators beside the Cramer-Rao bound.

The cells of Han 2019 (1-4 m; 0, 30 and 60 deg), chirp and band noise of
0.5-8 kHz, 20 and 30 dB over the noise at the array; all estimators get the
same frames. A table row is a method in one sound at one level, over all cells.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from time import perf_counter

import numpy as np

from analysis.arrays.paper_tables import PAPER_CELLS
from analysis.arrays.single_frames import Estimator, Loudspeaker, frame_estimator
from studies.support.free_field_trials import FreeFieldCell, run_cell, total_consistency
from studies.tables import Table
from systems.base.robot import RobotParameters
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
METHODS = ("gcc", "ml")
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
HEADINGS = (
    "sound",
    "SNR",
    "method",
    "bearing RMSE / bound",
    "range RMSE / bound",
    "stated / RMSE",
    "NEES (interval)",
    "outliers",
)


def estimators() -> dict[str, Estimator]:
    """One for each method."""
    return {
        method: frame_estimator(
            TDOAParameters.model_validate({"method": method}), SHAPE, C
        )
        for method in METHODS
    }


def table_rows(trials: int) -> Iterator[Sequence[str]]:
    """A row a sound, level and method, then all together."""
    everything: dict[str, list[FreeFieldCell]] = {method: [] for method in METHODS}
    seed = 0
    for kind in ("chirp", "band_noise"):
        loudspeaker = Loudspeaker.of(kind, seed=3)
        for snr_db in (20.0, 30.0):
            rows = []
            for place in PAPER_CELLS:
                seed += 1
                rows.append(
                    run_cell(
                        loudspeaker,
                        estimators(),
                        place.range_m,
                        place.bearing_deg,
                        shape=SHAPE,
                        snr_db=snr_db,
                        c=C,
                        trials=trials,
                        seed=seed,
                    )
                )
            for method in METHODS:
                cells = [row[method] for row in rows]
                everything[method] += cells
                yield table_row((kind, f"{snr_db:g} dB", method), cells)
    for method in METHODS:
        yield table_row(("all", "all", method), everything[method])


def table_row(title: tuple[str, ...], cells: list[FreeFieldCell]) -> Sequence[str]:
    """The median cell's ratio, and the worst with its interval's lower end."""
    parts = []
    for name in ("bearing_ratio", "range_ratio"):
        ratios = [getattr(cell, name) for cell in cells]
        worst = max(ratios, key=lambda ratio: ratio.value)
        median = np.median([ratio.value for ratio in ratios])
        parts.append(f"{median:.2f}, at most {worst.value:.2f} ({worst.low:.2f})")
    stated = [
        value
        for cell in cells
        for value in (cell.stated_bearing_ratio, cell.stated_range_ratio)
    ]
    parts.append(f"{min(stated):.2f} to {max(stated):.2f}")
    nees = total_consistency(cells)
    parts.append(f"{nees.mean:.3f} ({nees.low:.3f}-{nees.high:.3f})")
    parts.append(str(sum(cell.outliers for cell in cells)))
    return [*title, *parts]


def time_rows(frames: int = 200) -> Iterator[Sequence[str]]:
    """Median time a frame on this machine, a row a method."""
    loudspeaker = Loudspeaker.of("chirp", seed=3)
    p_AS = np.array([2.0, 1.0])
    noise = np.random.default_rng(1).standard_normal((3, 2500), dtype=np.float32)
    frame = loudspeaker.pressure(0.3, p_AS, SHAPE.p_AM, C) + np.float32(1e-3) * noise
    for method, estimate in estimators().items():
        times = []
        for _ in range(frames):
            start = perf_counter()
            estimate(frame)
            times.append(perf_counter() - start)
        yield method, f"{1e3 * float(np.median(times)):.2f}"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--trials", type=int, default=400, help="frames a cell")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """Both tables."""
    yield Table("errors beside the bound", HEADINGS, table_rows(options.trials))
    yield Table("times", ("method", "ms a frame"), time_rows())
