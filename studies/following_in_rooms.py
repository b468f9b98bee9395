"""The closed loop in a room.

`obstacle_free` in the free field, and in a room of 7 m x 7 m x 3 m that
reverberates for 0.4 s, with colored ego noise 20 dB below the source at 1 m: how
much of the run the robot follows; and, from starts with the source behind it, how
often the target is on the source's side after one burst, two and three. Exit
status 1 if the room costs more than a twentieth of the following, or more than a
twentieth of the starts is not resolved after two bursts.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from analysis.runs.metric_table import run_metrics
from diagrams import RunResult, load_scenario, simulate
from studies.support.figures import Figure, bounds_table
from studies.tables import Table

ROOM = "room={size_m: [7.0, 7.0, 3.0], reverberation_time_s: 0.4}"
NOISE_RATE_HZ = 32_000
NOISE_S = 4.0
#: Where source and mirror image are nearer to each other, the choice is no matter, m.
BESIDE_M = 0.3
#: When the first bursts have been heard to their ends, s.
BURST_ENDS_S = (0.6, 2.6, 4.6)
#: Headings of both tables.
FOLLOWING = (
    "where",
    "seed",
    "ends",
    "following",
    "error rms",
    "target p95",
    "frames believed",
)
BEHIND = (
    "where",
    "starts with the source behind",
    "right side after one burst",
    "after two",
    "after three",
    "error after two, median",
)


def write_ego_noise(folder: Path) -> str:
    """A recording of 4 s with a power of 1/f above 50 Hz; returns its path."""
    count = round(NOISE_S * NOISE_RATE_HZ)
    white = np.random.default_rng(0).standard_normal(count)
    hertz = np.fft.rfftfreq(count, 1.0 / NOISE_RATE_HZ)
    pink = np.fft.irfft(np.fft.rfft(white) / np.sqrt(np.maximum(hertz, 50.0)), count)
    file = folder / "ego_noise.wav"
    soundfile.write(file, 0.2 * pink / np.abs(pink).max(), NOISE_RATE_HZ)
    return str(file)


def in_a_room(noise_file: str, snr_db: float = 20.0) -> list[str]:
    """Settings of a room and of ego noise that far below the source at 1 m."""
    return [
        ROOM,
        f"microphones.ego_noise_file={noise_file}",
        f"microphones.ego_noise_snr_db_at_1m={snr_db}",
    ]


def behind(seed: int) -> list[str]:
    """Settings of a robot amid the room with a resting source behind it."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.3, 0.3, 2)
    heading = rng.uniform(-math.pi, math.pi)
    away = heading + rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(100.0, 180.0))
    distance = rng.uniform(2.0, 2.8)
    S = x + distance * math.cos(away), y + distance * math.sin(away)
    return [
        f"start.position_m=[{x:.3f}, {y:.3f}]",
        f"start.heading_deg={math.degrees(heading):.1f}",
        f"source.waypoints_m=[[{S[0]:.3f}, {S[1]:.3f}]]",
        f"seed={seed}",
    ]


def target_errors(result: RunResult) -> NDArray[np.float64]:
    """(n,) distance of the target from the source, m."""
    columns = result.columns
    return np.hypot(
        columns["p_WS_estimated_x"] - columns["p_WS_x"],
        columns["p_WS_estimated_y"] - columns["p_WS_y"],
    )


def on_the_right_side(result: RunResult) -> NDArray[np.bool_]:
    """(n,) whether the target is nearer to the source than to its mirror image."""
    columns, robot = result.columns, result.scenario.only.robot
    ahead = np.array([np.cos(columns["theta_WB"]), np.sin(columns["theta_WB"])])
    p_WP = np.array([columns["p_WB_x"], columns["p_WB_y"]])
    p_WP += robot.control_point_m * ahead
    p_WS = np.array([columns["p_WS_x"], columns["p_WS_y"]])
    depth = np.sum((p_WS - p_WP) * ahead, axis=0)
    image = p_WS - 2.0 * depth * ahead
    target = [columns["p_WS_estimated_x"], columns["p_WS_estimated_y"]]
    from_image = np.hypot(*(target - image))
    beside = 2.0 * np.abs(depth) < BESIDE_M
    return (target_errors(result) < from_image) | beside


def following_rows(
    settings: dict[str, list[str]], runs: int, shares: dict[str, list[float]]
) -> Iterator[Sequence[object]]:
    """A row a setting and seed; the shares of following go into ``shares``."""
    for seed in range(1, runs + 1):
        for name, overrides in settings.items():
            scenario = load_scenario("obstacle_free", [*overrides, f"seed={seed}"])
            result = simulate(scenario, engine="compiled")
            metrics = run_metrics(result)
            following = metrics["following_fraction"] or 0.0
            if result.cause != "completed":
                following = 0.0
            shares.setdefault(name, []).append(following)
            late = target_errors(result)[result.time > BURST_ENDS_S[1]]
            yield (
                name,
                seed,
                result.cause,
                f"{following:.3f}",
                f"{metrics['following_error_rms_m']:.2f} m",
                f"{np.quantile(late, 0.95):.2f} m",
                f"{metrics['detections']:.0f}",
            )


def behind_rows(
    settings: dict[str, list[str]], starts: int, shares: dict[str, list[float]]
) -> Iterator[Sequence[object]]:
    """A row a setting; shares on the right side after each burst go into ``shares``."""
    for name, overrides in settings.items():
        resolved, errors = [], []
        for seed in range(starts):
            scenario = load_scenario(
                "default",
                [
                    "obstacles=[]",
                    f"duration_s={BURST_ENDS_S[-1]}",
                    *behind(seed),
                    *overrides,
                ],
            )
            result = simulate(scenario, engine="compiled")
            # A run that has reached the source ends; so does its target.
            ends = np.searchsorted(result.time, np.array(BURST_ENDS_S) - 1e-9)
            ends = np.minimum(ends, len(result.time) - 1)
            resolved.append(on_the_right_side(result)[ends])
            errors.append(target_errors(result)[ends[1]])
        shares[name] = np.mean(resolved, axis=0).tolist()
        row = [f"{share:.2f}" for share in shares[name]]
        error = f"{np.median(errors):.2f} m"
        yield name, starts, *row, error


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--runs", type=int, default=3, help="of the scenario")
    parser.add_argument("--starts", type=int, default=40, help="with it behind")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """Both tables, and their bounds."""
    following: dict[str, list[float]] = {}
    resolved: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        room = in_a_room(write_ego_noise(Path(folder)))
        settings = {"free field": [], "room, ego noise": room}
        rows = following_rows(settings, options.runs, following)
        yield Table("following", FOLLOWING, rows)
        rows = behind_rows(settings, options.starts, resolved)
        yield Table("source behind", BEHIND, rows)
    free, loud = (float(np.mean(following[name])) for name in settings)
    after_two = resolved["room, ego noise"][1]
    yield from bounds_table(
        [
            Figure("following, room less free field", loud - free, ">=", -0.05),
            Figure("behind, resolved after two bursts", after_two, ">=", 0.95),
        ]
    )
