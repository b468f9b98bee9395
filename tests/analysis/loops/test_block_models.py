"""Two independent routes to the one-period matrix."""

from __future__ import annotations

import control
import numpy as np
import pytest

from analysis.loops.block_models import join_blocks, sampled_blocks
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import ideal_scenario
from analysis.loops.linear_models import simple_poles
from diagrams.scenario.scenario import Scenario

SOURCE_PORTS = (("hearing", "pose_WS"), ("collision", "pose_WS"))
SIGNALS = ("acceleration_W[0]", "acceleration_W[1]", "p_PS_B[0]", "p_PS_B[1]")
POSES = ("pose_WS[0]", "pose_WS[1]", "pose_WS[2]")
BOX = {"name": "box", "waypoints_m": [[1.2, 0.6]], "size_m": [0.1, 0.05]}


def build(law, hold="motion", **data):
    data = {"law": law, "tracker": {"hold": hold}, "obstacles": [BOX]} | data
    return ideal_loop(ideal_scenario(Scenario.model_validate(data)))


@pytest.mark.parametrize(
    "law", ["none", "conventional", "active", "conventional2017", "active2017"]
)
@pytest.mark.parametrize("hold", ["motion", "world", "robot"])
def test_blocks_joined_by_control_are_the_derivative_of_one_period(law, hold):
    """At a place where forces act, which is no equilibrium."""
    loop = build(law, hold)
    state, time_s = loop.settled_state((0.6, 0.1, 0.3))
    whole = loop.period_derivatives(
        state,
        time_s,
        inputs={SOURCE_PORTS: loop.scenario.source.path().pose(time_s)},
        outputs=[("controller", "acceleration_W"), ("hearing", "p_PS_B")],
    )
    joined = join_blocks(
        sampled_blocks(loop, state, time_s),
        loop.state_names,
        name="closed loop",
        inputs=POSES,
        outputs=SIGNALS,
    )
    np.testing.assert_allclose(joined.A, whole.A, atol=1e-8)
    np.testing.assert_allclose(joined.B, whole.B, atol=1e-8)
    np.testing.assert_allclose(joined.C, whole.C, atol=1e-8)
    np.testing.assert_allclose(joined.D, whole.D, atol=1e-8)
    ours = simple_poles(joined.poles)
    theirs = np.linalg.eigvals(whole.A)
    assert len(ours) >= 4
    for pole in ours:
        assert np.abs(theirs - pole).min() < 1e-8


def test_moving_loops_agree_too():
    loop = build("active", source={"waypoints_m": [[2.0, 0.0], [50.0, 0.0]]})
    state, time_s = loop.settled_state((0.6, 0.0, 0.0), (0.3, 0.0))
    whole = loop.period_derivatives(state, time_s)
    blocks = sampled_blocks(loop, state, time_s)
    joined = join_blocks(blocks, loop.state_names, name="following")
    np.testing.assert_allclose(joined.A, whole.A, atol=1e-8)


def test_interconnect_by_names_gives_the_same_loop():
    """control's own wiring, whose matrices come from finite differences."""
    loop = build("conventional")
    state, time_s = loop.settled_state((0.6, 0.1, 0.3))
    models = sampled_blocks(loop, state, time_s)
    joined = join_blocks(models, loop.state_names, name="closed loop")
    systems = [model.to_control() for model in models]
    said = {name for model in models for name in model.output_names}
    heard = [name for model in models for name in model.input_names]
    outside = sorted({name for name in heard if name not in said})
    whole = control.interconnect(
        systems, inplist=outside, inputs=outside, outputs=False, check_unused=False
    )
    poles = np.linalg.eigvals(whole.A)
    for pole in simple_poles(joined.poles):
        assert np.abs(poles - pole).min() < 1e-5
