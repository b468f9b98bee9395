"""Resident memory of a long simulation."""

from __future__ import annotations

import ctypes
import gc
from pathlib import Path

from diagrams import build_sound_follower, load_scenario, make_simulator

#: Overrides that keep the robot busy for ten minutes.
LONG = (
    "duration_s=600",
    "source.waypoints_m=[[1.6, 0], [6, 0], [6, 5], [1.6, 5]]",
    "source.at_end=shuttle",
    "obstacles=[]",
)


def memory_growth_mb() -> float:
    """Growth from minute 2 to minute 10 with full audio, MB.

    Without logs, which grow by design (20 MB in ten minutes). Before each reading the
    allocator gives back its free pages, whose number differs from run to run. Of the
    growth, 6 MB is the path that the source has driven.
    """
    simulator = make_simulator(build_sound_follower(load_scenario("default", LONG)))
    simulator.Initialize()
    simulator.AdvanceTo(120.0)
    before = _resident_mb()
    simulator.AdvanceTo(600.0)
    return _resident_mb() - before


def _resident_mb() -> float:
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return float(line.split()[1]) / 1024.0
    raise RuntimeError("memory: this system does not tell a process's memory")
