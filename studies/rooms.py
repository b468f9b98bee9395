"""Bursts located in reverberant rooms.

Exit status 1 if a share is below what is asked for.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from studies.support.figures import Figure, bounds_table
from studies.support.room_trials import RoomResult, draw_layouts, locate_bursts
from studies.tables import Table
from systems.hearing.parameters import TDOAParameters
from systems.sound.parameters import RoomParameters, SoundParameters

SOUNDS: tuple[Literal["chirp", "band_noise"], ...] = ("chirp", "band_noise")
SEED = 1


class RoomTask(NamedTuple):
    """What is asked for in a room of 7 m x 7 m x 3 m."""

    reverberation_time_s: float
    """By Sabine's formula, s."""
    largest_range_m: float
    """Of the sources, m."""
    share: float
    """Of the bursts that must be located."""


HEADINGS = (
    "T60",
    "range",
    "sound",
    "located (95 %)",
    "required",
    "heard",
    "bearing, median",
    "range, median",
    "located without precedence",
)
ROOMS = (RoomTask(0.25, 2.0, 0.98), RoomTask(0.4, 3.0, 0.95), RoomTask(0.6, 4.0, 0.80))


def run_task(
    task: RoomTask,
    kind: Literal["chirp", "band_noise"],
    layouts: int,
    *,
    precedence: bool = True,
    seed: int = SEED,
) -> RoomResult:
    """One burst in each of some random layouts; the same for every sound."""
    room = RoomParameters(reverberation_time_s=task.reverberation_time_s)
    return locate_bursts(
        room,
        SoundParameters(kind=kind),
        list(draw_layouts(room, task.largest_range_m, layouts, seed)),
        parameters=TDOAParameters(suppress_echoes=precedence),
        seed=seed,
    )


def table_rows(layouts: int, figures: list[Figure]) -> Iterator[Sequence[str]]:
    """A row a room and sound; the shares go into ``figures``."""
    for task in ROOMS:
        for kind in SOUNDS:
            found = run_task(task, kind, layouts)
            plain = run_task(task, kind, layouts, precedence=False)
            rate = found.located_rate
            row = (
                f"{task.reverberation_time_s:g} s",
                f"to {task.largest_range_m:g} m",
                kind.replace("_", " "),
                f"{rate.value:.3f} ({rate.low:.3f}-{rate.high:.3f})",
                f"{task.share:g}",
                f"{found.heard.mean():.3f}",
                f"{np.nanmedian(np.abs(found.bearing_errors_deg)):.2f} deg",
                f"{100.0 * np.nanmedian(np.abs(found.range_errors)):.1f} %",
                f"{plain.located.mean():.3f}",
            )
            yield row
            figures.append(Figure(", ".join(row[:3]), rate.value, ">=", task.share))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--layouts", type=int, default=400, help="of each room")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table and its bounds."""
    figures: list[Figure] = []
    yield Table("bursts in rooms", HEADINGS, table_rows(options.layouts, figures))
    yield from bounds_table(figures)
