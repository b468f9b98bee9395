"""The diagram against a plain loop over the same pure functions.

Full audio: what the blocks add (ports, events, caching, order of updates) must
not change a bit of the motion.
"""

from __future__ import annotations

import numpy as np

from benchmarks.plain_loop import PlainLoop
from diagrams import load_scenario, simulate


def test_diagram_moves_as_the_plain_loop_does():
    scenario = load_scenario("default", ["duration_s=8"])
    columns = simulate(scenario).columns
    states = PlainLoop(scenario).run()[: len(columns["t"])]
    assert np.count_nonzero(columns["detected"]) > 50
    for k, name in enumerate(("p_WB_x", "p_WB_y", "theta_WB")):
        np.testing.assert_allclose(columns[name], states[:, k], atol=1e-9, rtol=0)
