"""Ticks per second of a robot with a scanner among boxes, beside IR-SIM.

    python -m benchmarks.beams [--bodies 10 35 100 300 1000]

The robot has 72 beams of 5 m, and drives straight through boxes at rest. Both programs
have the same boxes, beams, noise, and step of 25 ms, and draw nothing. IR-SIM
(https://github.com/hanruihua/ir-sim, `pip install ir-sim`) is left out if it is not
installed. It computes rays without width, gets a fixed command, and has no law.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from diagrams import Scenario, build_sound_follower, simulate
from diagrams.running.compiled.loop import compile_loop
from diagrams.scenario.scenario import scenario_from_mapping
from studies.support.figures import Figure, stay_on_one_core

LAWS = "active", "vfh_plus"
BEAMS, RANGE_M, NOISE_M, TICK_S = 72, 5.0, 0.01, 0.025
DURATION_S = 20.0
#: Runs of each; the fastest counts.
REPEATS = 3


def boxes(count: int) -> tuple[float, list[tuple[float, float, float, float, float]]]:
    """Places boxes beside the way of the robot, 35 per 100 m^2.

    Returns:
        Side of the floor, m; and x, y, heading, length and width of each box, m and
        rad.
    """
    side, draw = max(10.0, math.sqrt(count / 0.35)), np.random.default_rng(1)
    rows: list[tuple[float, float, float, float, float]] = []
    while len(rows) < count:
        x, y = draw.uniform(-side / 2.0, side / 2.0, 2).tolist()
        turn, length, width = draw.uniform([0.0, 0.2, 0.2], [math.pi, 0.6, 0.6])
        if abs(y) > 0.8:
            rows.append((x, y, float(turn), float(length), float(width)))
    return side, rows


def world(law: str, count: int) -> Scenario:
    """Returns the scenario of a robot with a law and a scanner among boxes."""
    side, rows = boxes(count)
    document: dict[str, Any] = {
        "name": "beams",
        "law": law,
        "engine": "compiled",
        "hearing": "ideal_always",
        "tick_s": TICK_S,
        "duration_s": DURATION_S,
        "arena_m": [side + 2.0, side + 2.0],
        "start": {"position_m": [-side / 2.0, 0.0]},
        "source": {
            "waypoints_m": [[1.5 - side / 2.0, 0.0], [side / 2.0, 0.0]],
            "speed_m_s": 0.2,
        },
        "stop": {"diverged_range_m": 200.0},
        "ultrasonic": {
            "preset": "lidar",
            "maximum_range_m": RANGE_M,
            "noise_m": NOISE_M,
        },
        "obstacles": [
            {
                "name": f"box_{k}",
                "waypoints_m": [[x, y]],
                "heading_deg": math.degrees(turn),
                "size_m": [length, width],
            }
            for k, (x, y, turn, length, width) in enumerate(rows)
        ],
    }
    return scenario_from_mapping(document)


def ticks_per_second(law: str, count: int) -> float:
    """Measures the compiled engine with a law among boxes."""
    scenario, best = world(law, count), 0.0
    for _ in range(REPEATS + 1):
        loop = compile_loop(scenario)
        loop.prepare()
        begin, done = process_time(), loop.done
        loop.advance(round(DURATION_S / TICK_S))
        best = max(best, (loop.done - done) / (process_time() - begin))
    return best


def drake_ticks_per_second(law: str, count: int) -> float:
    """Measures the engine of Drake with a law among boxes."""
    scenario, best = world(law, count), 0.0
    follower = build_sound_follower(scenario, log=True)
    for _ in range(REPEATS):
        begin = process_time()
        run = simulate(scenario, follower=follower, engine="drake")
        taken = process_time() - begin
        best = max(best, run.simulated_s / TICK_S / taken)
    return best


def beam_figures() -> list[Figure]:
    """Returns ratios of speeds among 35 boxes, and from 10 to 1,000, with bounds."""
    fast = {law: ticks_per_second(law, 35) for law in LAWS}
    fewest, most = ticks_per_second("active", 10), ticks_per_second("active", 1000)
    return [
        *(
            Figure(
                f"72 beams, {law}, compiled, times Drake",
                fast[law] / drake_ticks_per_second(law, 35),
                ">=",
                bound,
            )
            for law, bound in (("active", 50.0), ("vfh_plus", 18.0))
        ),
        Figure("1,000 over 10 boxes, time of a tick", fewest / most, "<=", 3.0),
    ]


def irsim_steps_per_second(count: int) -> float:
    """Measures IR-SIM among the same boxes."""
    import irsim

    side, rows = boxes(count)
    scanner = {
        "name": "lidar2d",
        "range_min": 0.0,
        "range_max": RANGE_M,
        "angle_range": math.tau,
        "number": BEAMS,
        "noise": True,
        "std": NOISE_M,
    }
    world: dict[str, Any] = {
        "world": {
            "width": side + 2.0,
            "height": side + 2.0,
            "offset": [-side / 2.0 - 1.0, -side / 2.0 - 1.0],
            "step_time": TICK_S,
            "sample_time": TICK_S,
            "collision_mode": "stop",
        },
        "robot": [
            {
                "kinematics": {"name": "diff"},
                "shape": {"name": "rectangle", "length": 0.326, "width": 0.352},
                "state": [-side / 2.0, 0.0, 0.0],
                "goal": [side, 0.0, 0.0],
                "sensors": [scanner],
            }
        ],
        "obstacle": [
            {
                "shape": {"name": "rectangle", "length": length, "width": width},
                "state": [x, y, turn],
            }
            for x, y, turn, length, width in rows
        ],
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "world.yaml")
        file.write_text(json.dumps(world))
        env = irsim.make(str(file), display=False, save_ani=False, log_level="ERROR")
    command, steps, begin = np.array([[0.2], [0.0]]), 0, process_time()
    while process_time() - begin < REPEATS:
        env.step(command)
        steps += 1
    found = steps / (process_time() - begin)
    env.end()
    return found


def main() -> None:
    """Prints one line per number of boxes."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    counts = 10, 35, 100, 300, 1000
    parser.add_argument("--bodies", type=int, nargs="+", default=counts)
    stay_on_one_core()
    names = [*LAWS, *(["IR-SIM"] if find_spec("irsim") else [])]
    print(f"{'boxes':>6}" + "".join(f"{name:>12}" for name in names) + "  ticks/s")
    for count in parser.parse_args().bodies:
        speeds = [ticks_per_second(law, count) for law in LAWS]
        if "IR-SIM" in names:
            speeds.append(irsim_steps_per_second(count))
        print(f"{count:>6}" + "".join(f"{speed:>12,.0f}" for speed in speeds))


if __name__ == "__main__":
    main()
