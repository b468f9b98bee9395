"""``make bench``: every figure beside its bound; exit status 1 if one is missed.

Run on one core of an idle machine. Ratios and differences are from one run
of one process, so that they mean the same on another machine.
"""

from __future__ import annotations

import sys

from benchmarks.figures import Figure, print_figures, stay_on_one_core
from benchmarks.hearing import frame_figures
from benchmarks.memory import memory_growth_mb
from benchmarks.speed import diagram_overhead, real_time_factor

IDEAL = ("hearing=ideal", "obstacle_sensing=ideal", "odometry.rounding=false")


def main() -> int:
    """Prints the table."""
    stay_on_one_core()
    return print_figures(
        [
            Figure("full audio, times real time", real_time_factor(()), ">=", 60.0),
            Figure(
                "ideal sensors, times real time", real_time_factor(IDEAL), ">=", 150.0
            ),
            Figure(
                "diagram over plain loop, full audio", diagram_overhead(), "<=", 1.5
            ),
            Figure("memory, minute 1 to 10, MB", memory_growth_mb(), "<=", 20.0),
            *frame_figures(),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
