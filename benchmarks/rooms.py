"""``python -m benchmarks.rooms``: bursts located in reverberant rooms.

Exit status 1 if a share is below what is asked for.
"""

from __future__ import annotations

import argparse
import sys
from typing import Literal, NamedTuple

import numpy as np

from analysis.hearing.room_trials import RoomResult, draw_layouts, locate_bursts
from analysis.reporting.markdown import markdown_head, markdown_row
from benchmarks.figures import Figure, print_figures
from systems.hearing.parameters import TDOAParameters
from systems.sound.parameters import RoomParameters, SoundParameters

__all__ = ["ROOMS", "SOUNDS", "RoomTask", "run_task"]

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
    "asked",
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


def run(layouts: int) -> int:
    """Prints a row a room and sound; returns the exit status."""
    print(markdown_head(HEADINGS))
    figures = []
    for task in ROOMS:
        for kind in SOUNDS:
            found = run_task(task, kind, layouts)
            plain = run_task(task, kind, layouts, precedence=False)
            share, (low, high) = found.located.mean(), found.located_interval
            row = (
                f"{task.reverberation_time_s:g} s",
                f"to {task.largest_range_m:g} m",
                kind.replace("_", " "),
                f"{share:.3f} ({low:.3f}-{high:.3f})",
                f"{task.share:g}",
                f"{found.heard.mean():.3f}",
                f"{np.nanmedian(np.abs(found.bearing_errors_deg)):.2f} deg",
                f"{100.0 * np.nanmedian(np.abs(found.range_errors)):.1f} %",
                f"{plain.located.mean():.3f}",
            )
            print(markdown_row(row), flush=True)
            figures.append(Figure(", ".join(row[:3]), share, ">=", task.share))
    print()
    return print_figures(figures)


def main() -> int:
    """Prints the table and its verdicts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--layouts", type=int, default=400, help="of each room")
    layouts = parser.parse_args().layouts
    if layouts < 1:
        parser.error("--layouts must be at least 1")
    return run(layouts)


if __name__ == "__main__":
    sys.exit(main())
