"""``python -m benchmarks.free_field``: estimators beside the Cramer-Rao bound.

The cells of Han 2019 (1-4 m; 0, 30 and 60 deg), chirp and band noise of
0.5-8 kHz, 20 and 30 dB over the noise at the array; all estimators get the
same frames. A table row is a method in one sound at one level, over all cells.
"""

from __future__ import annotations

import argparse
from time import perf_counter

import numpy as np

from analysis.hearing.free_field import (
    Estimator,
    FreeFieldCell,
    Loudspeaker,
    frame_estimator,
    run_cell,
    total_consistency,
)
from analysis.hearing.paper_tables import PAPER_CELLS
from analysis.reporting.markdown import markdown_head, markdown_row
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


def run(trials: int) -> None:
    """Prints the table, a row as soon as it is known."""
    print(markdown_head(HEADINGS))
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
                print_row((kind, f"{snr_db:g} dB", method), cells)
    for method in METHODS:
        print_row(("all", "all", method), everything[method])


def print_row(title: tuple[str, ...], cells: list[FreeFieldCell]) -> None:
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
    print(markdown_row([*title, *parts]), flush=True)


def print_times(frames: int = 200) -> None:
    """Median time a frame on this machine, ms."""
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
        print(f"{method}: {1e3 * float(np.median(times)):.2f} ms a frame")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=400, help="frames a cell")
    run(parser.parse_args().trials)
    print_times()
