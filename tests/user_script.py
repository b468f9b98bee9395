"""What a user writes: checked by mypy --strict here, and against an installed wheel."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import phonotaxis


def follow(folder: Path) -> list[Path]:
    """Runs a scenario, and writes all that can be made of a run."""
    scenario = phonotaxis.load_scenario(
        "two_followers", {"hearing": "ideal", "duration_s": 1.0}
    )
    assert_type(scenario, phonotaxis.Scenario)
    result = phonotaxis.simulate(scenario)
    assert_type(result, phonotaxis.RunResult)
    assert_type(result.trajectory, pd.DataFrame)
    assert_type(result.cause, str)
    assert_type(result.plot(), Figure)
    assert_type(result.document(), dict[str, Any])
    assert_type(phonotaxis.columns(result), pd.DataFrame)
    for own in result.robots.values():
        assert_type(own, phonotaxis.RunResult)
        own.plot("time_series").savefig(folder / f"{own.name}.png")
    return [
        result.replay(folder / "replay.html"),
        result.to_mcap(folder / "run.mcap"),
        result.to_csv(folder / "trajectory.csv"),
        result.to_parquet(folder / "trajectory.parquet"),
    ]


def hear() -> float | None:
    """Locates a click in samples of three microphones, 2 m to the left of them."""
    places = [(0.0, 0.4), (0.0, 0.0), (0.0, -0.4)]
    times = np.arange(24_000) / 48_000.0
    noise = np.random.default_rng(1).standard_normal(24_000)
    paths = [float(np.hypot(0.0 - x, 2.0 - y)) / 340.0 for x, y in places]
    samples = np.array([np.interp(times - path, times, noise) for path in paths])
    result = phonotaxis.locate(samples, places, sample_rate_hz=48_000.0)
    assert_type(result, phonotaxis.LocateResult)
    bearing = result.main_source()["bearing_deg"]
    assert isinstance(bearing, float | None)
    return bearing


if __name__ == "__main__":
    try:
        files = follow(Path())
    except phonotaxis.InputError as error:
        sys.exit(f"{error.field}: {error.message}")
    sys.stdout.write(f"{hear()} deg, {len(files)} files\n")
