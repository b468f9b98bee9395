"""``make bench``: every figure beside its bound; exit status 1 if one is missed.

Run on one core of an idle machine. Ratios and differences are from one run
of one process, so that they mean the same on another machine.
"""

from __future__ import annotations

import os
import sys

from benchmarks.memory import memory_growth_mb
from benchmarks.speed import diagram_overhead, real_time_factor

IDEAL = ("hearing=ideal", "obstacle_sensing=ideal", "odometry.rounding=false")


def main() -> int:
    """Prints the table."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    figures = (
        ("full audio, times real time", real_time_factor(()), ">=", 40.0),
        ("ideal sensors, times real time", real_time_factor(IDEAL), ">=", 150.0),
        ("diagram over plain loop, full audio", diagram_overhead(), "<=", 1.5),
        ("memory, minute 1 to 10, MB", memory_growth_mb(), "<=", 20.0),
    )
    missed = False
    for name, value, sense, bound in figures:
        met = value >= bound if sense == ">=" else value <= bound
        missed |= not met
        verdict = "" if met else "  MISSED"
        print(f"{name:<38} {value:8.2f}   {sense} {bound:g}{verdict}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
