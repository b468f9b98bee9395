"""Same seed: same bytes. Another seed: other noise, same geometry."""

from __future__ import annotations

import numpy as np

from diagrams import build_sound_follower, load_scenario, simulate


def columns(seed: int, **kwargs) -> dict[str, np.ndarray]:
    scenario = load_scenario("default", [f"seed={seed}", "duration_s=6"])
    return simulate(scenario, **kwargs).columns


def test_same_seed_same_bytes_and_a_build_can_be_used_again():
    scenario = load_scenario("default", ["seed=1", "duration_s=6"])
    follower = build_sound_follower(scenario, log=True)
    runs = [columns(1), columns(1, follower=follower), columns(1, follower=follower)]
    for name, values in runs[0].items():
        assert values.tobytes() == runs[1][name].tobytes(), name
        assert values.tobytes() == runs[2][name].tobytes(), name


def test_other_seed_other_noise_same_geometry():
    one, two = columns(1), columns(2)
    for name in ("t", "p_WS_x", "p_WS_y", "theta_WS"):
        np.testing.assert_array_equal(one[name], two[name])
    for name in ("source_range", "range_1"):
        assert not np.array_equal(one[name], two[name], equal_nan=True), name
