"""Errors of places beside those stated.

Simulated recordings of drawn arrays whose places, air, clocks and gains are off by what
their geometry files state, through ``locate``; beside them the bound with that budget
in it. Then chirps of 10 ms in an echoing room, by an array that is known exactly.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from multiprocessing import Pool

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.locate import hear
from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.recorded_samples import RecordedSamples
from analysis.arrays.recording_search import MAD_TO_STD
from analysis.report.intervals import estimate_rate
from studies.support.drawn_recordings import (
    RATE,
    SHORT_COUNT,
    Cell,
    DrawnArray,
    bearing_bound,
    draw_array,
    exact_array,
    range_bound,
    record,
)
from studies.tables import Table
from systems.framework.input_error import InputError

CELLS = [
    Cell(*values)
    for values in product((0.002, 0.01, 0.03), (0.0, 0.3, 0.6), (0.005, 0.02, 0.1, 1.0))
]
# Half of the arrays are drawn until their bound, over the range, is below this.
SUPPORTED = 0.2
# Where the bound leaves no doubt whether a range is to be given.
CLEARLY, CLEARLY_NOT = 0.15, 0.27
LARGE_M = 0.3
HEADINGS = (
    "drawn alike",
    "arrays",
    "refused",
    "no source",
    "ranges",
    "given below 0.15, above 0.27 by bound",
    "within 1 deviation",
    "within 2",
    "stated over bound (10-90 %)",
    "bearings within 1",
    "within 2",
    "stated over bound",
)


@dataclass(frozen=True)
class Trial:
    """One array and its recording."""

    cell: Cell
    drawn: DrawnArray
    refused: str
    """Why the recording was; empty: it was not."""
    faults: tuple[str, ...]
    late_s: tuple[float, ...]
    """Errors of the arrivals, from their mean, all stretches alike."""
    range_m: float
    """NaN where none is given; so the others."""
    range_std_m: float
    bearing_off: float
    """rad."""
    bearing_std: float
    ranges_m: tuple[float, ...]
    """Of single estimates; NaN where none is given."""

    @property
    def heard(self) -> bool:
        """Whether a bearing was told."""
        return math.isfinite(self.bearing_std)

    @property
    def ranged(self) -> bool:
        """Whether a range was told."""
        return math.isfinite(self.range_m)


def try_array(cell: Cell, drawn: DrawnArray, rng: np.random.Generator) -> Trial:
    """Records and locates."""
    samples = record(drawn, cell, rng)
    try:
        heard = hear(RecordedSamples(samples, RATE, "recording"), drawn.geometry)
    except InputError as error:
        return Trial(cell, drawn, str(error), (), (), *(math.nan,) * 4, ())
    known = drawn.geometry.known
    found = LocatedSource(
        {},
        known.shape,
        heard.estimates,
        len(heard.search.stretches),
        largest_range_error=known.largest_range_error,
    ).main_source()
    late: list[float] = []
    for sighting in heard.sightings:
        lag = np.append(0.0, sighting.tau - drawn.tau)
        late.extend((lag - lag.mean()) * math.sqrt(lag.size / (lag.size - 1)))
    off, std = math.nan, math.nan
    if found["bearing_deg"] is not None:
        off = math.remainder(
            math.radians(found["bearing_deg"]) - drawn.bearing, 2.0 * math.pi
        )
        std = math.radians(found["bearing_std_deg"])
    return Trial(
        cell=cell,
        drawn=drawn,
        refused="",
        faults=tuple(fault.message for fault in heard.faults),
        late_s=tuple(late),
        range_m=math.nan if found["range_m"] is None else found["range_m"],
        range_std_m=math.nan if found["range_m"] is None else found["range_std_m"],
        bearing_off=off,
        bearing_std=std,
        ranges_m=tuple(e.range_m or math.nan for e in heard.estimates),
    )


def _of_cell(task: tuple[int, int, int]) -> Trial:
    """By the numbers of the seed, the cell and the draw."""
    _, number, draw = task
    cell, rng = CELLS[number], np.random.default_rng(task)
    largest = SUPPORTED if draw % 2 else math.inf
    return try_array(cell, draw_array(cell, rng, largest_error=largest), rng)


def own_deviations(trials: Sequence[Trial]) -> Callable[[Trial], float]:
    """What noise and reflections do to arrivals, from the errors of the delays.

    Alike for all trials with a reverberation time, a sound, and large or small arrays:
    the median deviation, which leaves stretches out that heard something else.
    """

    def alike(trial: Trial) -> tuple[float, float, bool]:
        large = trial.drawn.geometry.known.shape.aperture_m > LARGE_M
        return trial.cell.t60, trial.cell.seconds, large

    late: dict[tuple[float, float, bool], list[float]] = defaultdict(list)
    for trial in trials:
        late[alike(trial)].extend(trial.late_s)
    found = {
        key: MAD_TO_STD * float(np.median(np.abs(of))) for key, of in late.items() if of
    }
    return lambda trial: found.get(alike(trial), 0.0)


def table_rows(
    trials: Sequence[Trial],
    key: Callable[[Trial], str],
    own: Callable[[Trial], float],
) -> Iterator[Sequence[str]]:
    """Rows of trials that have something alike."""
    groups = defaultdict(list)
    for trial in trials:
        groups[key(trial)].append(trial)
    for name, group in groups.items():
        yield _row(name, group, own)


def _row(
    name: str, trials: list[Trial], own: Callable[[Trial], float]
) -> tuple[str, ...]:
    of_delays = {
        id(t): own(t) ** 2 * (np.eye(len(t.drawn.stated) - 1) + 1.0) for t in trials
    }
    asked = [t for t in trials if not t.refused]
    bound = {id(t): range_bound(t.drawn, of_delays[id(t)]) for t in asked}
    share = {id(t): bound[id(t)] / t.drawn.range_m for t in asked}
    ranged = [t for t in asked if t.ranged]
    clear = [t.ranged for t in asked if share[id(t)] < CLEARLY]
    none = [t.ranged for t in asked if share[id(t)] > CLEARLY_NOT]
    off = np.array([(t.range_m - t.drawn.range_m) / t.range_std_m for t in ranged])
    ratio = [t.range_std_m / bound[id(t)] for t in ranged]
    told = [t for t in asked if t.heard]
    turned = np.array([t.bearing_off / t.bearing_std for t in told])
    wide = [t.bearing_std / bearing_bound(t.drawn, of_delays[id(t)]) for t in told]
    return (
        name,
        str(len(trials)),
        str(len(trials) - len(asked)),
        str(len(asked) - len(told)),
        str(len(ranged)),
        f"{sum(clear)} of {len(clear)}, {sum(none)} of {len(none)}",
        _within(off, 1.0),
        _within(off, 2.0),
        _middle(ratio, ".2f"),
        _within(turned, 1.0),
        _within(turned, 2.0),
        _middle(wide, ".2f"),
    )


def _within(deviations: NDArray[np.float64], limit: float) -> str:
    if not deviations.size:
        return "-"
    inside = estimate_rate(int(np.sum(np.abs(deviations) < limit)), deviations.size)
    share, low, high = (100.0 * x for x in (inside.value, *inside.ends))
    return f"{share:.0f} % ({low:.0f}-{high:.0f})"


def _middle(values: Sequence[float], form: str) -> str:
    if not values:
        return "-"
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return f"{middle:{form}} ({low:{form}}-{high:{form}})"


def arrays_tables(trials: Sequence[Trial]) -> Iterator[Table]:
    """Trials by what may be drawn alike, and what was refused or found at fault."""
    own = own_deviations(trials)

    def place(trial: Trial) -> str:
        return f"{1e3 * trial.cell.place_std:.0f} mm"

    def size(trial: Trial) -> str:
        aperture = trial.drawn.geometry.known.shape.aperture_m
        return f"{place(trial)}, " + (
            "to 0.3 m"
            if aperture < LARGE_M
            else "0.3 to 1 m"
            if aperture < 1.0
            else "1 to 2 m"
        )

    def count(trial: Trial) -> str:
        n = len(trial.drawn.stated)
        return f"{place(trial)}, " + ("3 or 4" if n < 5 else "5 to 8") + " microphones"

    keys: Sequence[Callable[[Trial], str]] = (
        place,
        lambda t: f"{place(t)}, T60 {t.cell.t60:g} s",
        lambda t: f"{place(t)}, {1e3 * t.cell.seconds:.0f} ms",
        lambda t: f"T60 {t.cell.t60:g} s, {1e3 * t.cell.seconds:.0f} ms",
        lambda t: f"{place(t)}, {t.drawn.kind}",
        size,
        count,
    )
    rows = [row for key in keys for row in table_rows(trials, key, own)]
    yield Table("drawn arrays", HEADINGS, rows)
    faults = [
        (size(trial), trial.drawn.kind, message)
        for trial in trials
        for message in (trial.refused, *trial.faults)
        if message
    ]
    yield Table("refused or at fault", ("array", "kind", "message"), faults)


CHIRPS = Cell(0.0, 0.6, 0.01)


def _of_chirps(task: tuple[int, int]) -> Trial:
    rng = np.random.default_rng((*task, 99))
    return try_array(CHIRPS, exact_array(rng), rng)


def chirps_table(trials: Sequence[Trial]) -> Table:
    """Chirps 5 m away, by an array that is known exactly."""
    headings = (
        "sources", "ranges", "largest, median bias", "largest, median scatter",
        "chirps", "with a range", "farthest off", "within 1, 2 deviations",
    )  # fmt: skip
    ranged = [t for t in trials if t.ranged]
    bias = 100.0 * np.abs([t.range_m / t.drawn.range_m - 1.0 for t in ranged])
    off = np.array([(t.range_m - t.drawn.range_m) / t.range_std_m for t in ranged])
    scatter = [np.nanstd(t.ranges_m) for t in ranged]
    each = np.array([r - t.drawn.range_m for t in trials for r in t.ranges_m])
    row = (
        str(len(trials)),
        str(len(ranged)),
        f"{bias.max():.1f} %, {np.median(bias):.1f} %",
        f"{np.max(scatter):.3f} m, {np.median(scatter):.3f} m",
        str(SHORT_COUNT * len(trials)),
        str(np.isfinite(each).sum()),
        f"{np.nanmax(np.abs(each)):.3f} m",
        f"{_within(off, 1.0)}, {_within(off, 2.0)}",
    )
    return Table("chirps 5 m away", headings, [row])


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--draws", type=int, default=15, help="of each cell (15)")
    parser.add_argument("--chirps", type=int, default=20, help="sources (20)")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--processes", type=int, default=1)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """All tables."""
    tasks = [
        (options.seed, number, draw)
        for number in range(len(CELLS))
        for draw in range(options.draws)
    ]
    chirps = [(options.seed, draw) for draw in range(options.chirps)]
    with Pool(options.processes) as pool:
        if tasks:
            yield from arrays_tables(pool.map(_of_cell, tasks, chunksize=1))
        if chirps:
            yield chirps_table(pool.map(_of_chirps, chirps, chunksize=1))
