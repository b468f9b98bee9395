"""``make bench``: every figure beside its bound; exit status 1 if one is missed.

Run on one core of an idle machine. Ratios and differences are from one run
of one process, so that they mean the same on another machine.
"""

from __future__ import annotations

import sys

from benchmarks.beams import beam_figures
from benchmarks.hearing import frame_figures
from benchmarks.memory import memory_growth_mb
from benchmarks.speed import (
    compiled_speed,
    overhead_of_a_run,
    overhead_of_the_diagram,
    real_time_factor,
)
from benchmarks.start import start_figures
from studies.support.figures import Figure, print_figures, stay_on_one_core

IDEAL = ("hearing=ideal", "obstacle_sensing=ideal", "plant.pulses_per_revolution=null")


def main() -> int:
    """Prints the table."""
    stay_on_one_core()
    return print_figures(
        [
            # Seconds are of one machine: this is what any of today reaches.
            Figure("full audio, times real time", real_time_factor(()), ">=", 30.0),
            Figure("the same, compiled", real_time_factor((), "compiled"), ">=", 150.0),
            # What Drake needs for Python blocks that do nothing is most of such a run.
            Figure(
                "ideal sensors, over hollow blocks",
                overhead_of_a_run(IDEAL),
                "<=",
                1.5,
            ),
            Figure(
                "diagram over plain loop and hollow blocks",
                overhead_of_the_diagram(),
                "<=",
                1.5,
            ),
            Figure("compiled loop, times Drake", compiled_speed(), ">=", 30.0),
            Figure(
                "eight robots on routes, times real time",
                real_time_factor((), name="robots_8"),
                ">=",
                4.0,
            ),
            Figure(
                "the same, compiled",
                real_time_factor((), "compiled", "robots_8"),
                ">=",
                500.0,
            ),
            *beam_figures(),
            Figure("memory, minute 2 to 10, MB", memory_growth_mb(), "<=", 12.0),
            *frame_figures(),
            *start_figures(),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
