"""Resident memory of a long simulation."""

from __future__ import annotations

from pathlib import Path

from diagrams import build_sound_follower, load_scenario, make_simulator

__all__ = ["memory_growth_mb"]

#: Overrides that keep the robot busy for ten minutes.
LONG = (
    "duration_s=600",
    "source.waypoints_m=[[1.6, 0], [6, 0], [6, 5], [1.6, 5]]",
    "source.at_end=shuttle",
    "obstacles=[]",
)


def memory_growth_mb() -> float:
    """Growth from minute 1 to minute 10 with full audio and all logs, MB."""
    scenario = load_scenario("default", LONG)
    simulator = make_simulator(build_sound_follower(scenario, log=True))
    simulator.Initialize()
    simulator.AdvanceTo(60.0)
    before = _resident_mb()
    simulator.AdvanceTo(600.0)
    return _resident_mb() - before


def _resident_mb() -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return float(line.split()[1]) / 1024.0
    raise RuntimeError("memory: this system does not tell a process's memory")
