"""Wind, plume and sensors in Drake: against closed forms and compiled steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from phonotaxis.testing import evaluate, run
from systems.framework.block import RunFacts
from systems.framework.compiling import njit
from systems.odor import airflow_sensors
from systems.odor.airflow_sensors import AirflowSensors
from systems.odor.gas_sensor_array import GasSensorArray
from systems.odor.odor_plume import PLUME_SIZE, OdorPlume
from systems.odor.parameters import GasSensorParameters, WindParameters
from systems.odor.wind import WIND_SIZE, WindField

pytestmark = pytest.mark.drake

POSE = (1.5, 0.1, 3.0)
TICK_S = 0.025
NOTHING = np.empty(0)


def blocks(kind="meandering", seed=1):
    wind = WindParameters(kind=kind)
    return (
        WindField(parameters=wind, seed=seed),
        OdorPlume(wind=wind, seed=seed + 1),
        GasSensorArray(seed=seed + 2),
        AirflowSensors(seed=seed + 3),
    )


def facts(seed):
    return RunFacts(10, TICK_S, (0.0, 0.0, 0.0), TICK_S, lambda name: seed, {})


def in_drake(four, ticks):
    """(ticks, n) gas ratios, concentrations and airflow at each tick; last wind, plume.

    What robots read at a tick is what wind and plume were before its update.
    """
    wind, plume, gas, air = four
    builder = DiagramBuilder()
    for block in four:
        builder.AddSystem(block)
    builder.Connect(wind.get_output_port(), plume.get_input_port())
    builder.Connect(plume.get_output_port(), gas.GetInputPort("plume"))
    builder.Connect(wind.get_output_port(), air.GetInputPort("wind"))
    builder.ExportInput(gas.GetInputPort("pose_WB"), "pose_WB")
    builder.ConnectInput("pose_WB", air.GetInputPort("pose_WB"))
    for block, name in (
        (gas, "gas_ratio"),
        (gas, "gas_concentration"),
        (air, "airflow"),
        (wind, "wind"),
        (plume, "plume"),
    ):
        builder.ExportOutput(block.GetOutputPort(name), name)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("pose_WB").FixValue(context, np.array(POSE))
    simulator = Simulator(diagram, context)
    names = ("gas_ratio", "gas_concentration", "airflow")
    rows: Any = []
    for tick in range(ticks):
        if tick > 0:  # an advance to 0 s would do the updates of 0 s
            simulator.AdvanceTo(tick * TICK_S)
        ports: Any = [diagram.GetOutputPort(name).Eval(context) for name in names]
        rows.append(np.concatenate(ports))
    simulator.AdvancePendingEvents()
    last = [diagram.GetOutputPort(name).Eval(context) for name in ("wind", "plume")]
    return np.array(rows), *last


def compiled(steps, ticks):
    """The same from compiled steps, as a compiled loop calls them."""
    wind, plume, gas, air = steps
    run_wind, run_plume, run_gas, run_air = (
        njit(step.step, cache=True) for step in steps
    )
    winds, puffs, ratios = (np.array(step.state) for step in steps[:3])
    rows: Any = []
    pose = np.array(POSE)
    blank = np.zeros(WIND_SIZE), np.zeros(PLUME_SIZE)
    for tick in range(ticks):
        read = np.zeros(3), np.zeros(3), np.zeros(2)
        run_gas(tick, ratios, (puffs, pose), read[:2], gas.numbers)
        run_air(tick, NOTHING, (winds, pose), read[2:], air.numbers)
        rows.append(np.concatenate(read))
        before = winds.copy()
        run_wind(tick, winds, (NOTHING,), blank[:1], wind.numbers)
        run_plume(tick, puffs, (before,), blank[1:], plume.numbers)
    return np.array(rows), winds, puffs


@pytest.mark.parametrize("kind", ["meandering", "jet"])
def test_compiled_steps_give_what_drake_gives(kind):
    ticks = 200
    read, wind, plume = in_drake(blocks(kind), ticks)
    again, last_wind, last_plume = compiled([b.step for b in blocks(kind)], ticks)
    np.testing.assert_allclose(read, again, rtol=0, atol=1e-12)
    np.testing.assert_allclose(wind, last_wind, rtol=0, atol=1e-12)
    np.testing.assert_allclose(plume, last_plume, rtol=0, atol=1e-12)


def test_in_drake_a_gas_sensor_is_a_first_order_lag():
    """All of the floor at C = 3: after t, r + (1 - r) exp(-t / 2.5), r = 4^-0.7155."""
    quiet = GasSensorParameters(noise=0.0, mismatch=0.0)
    block = GasSensorArray(parameters=quiet)
    plume = np.zeros(PLUME_SIZE)
    plume[0] = 3.0
    history = run(block, 5.0, plume=plume, pose_WB=POSE)
    rest = 4.0**-0.7155
    state = history.state[-1, :3]  # after 200 updates
    assert state == pytest.approx([rest + (1.0 - rest) * math.exp(-2.0)] * 3)
    far = rest + (1.0 - rest) * math.exp(-5.025 / 2.5)  # a tick's work ahead of state
    assert history["gas_ratio"][-1] == pytest.approx([far] * 3)
    assert history["gas_concentration"][-1] == pytest.approx([3.0] * 3)


def test_in_drake_airflow_is_a_cosine_about_each_sensor(monkeypatch):
    """A wind of 1 m/s along x and a heading of 165 deg: from 15 deg on the left."""
    monkeypatch.setattr(airflow_sensors, "_NOISE_SHARE", 0.0)
    wind = WindField(parameters=WindParameters(kind="uniform")).step.state
    pose = [0.0, 0.0, math.radians(165.0)]
    outputs = evaluate(AirflowSensors(), wind=wind, pose_WB=pose)
    expected = [3.0 * math.cos(math.radians(a)) for a in (30.0, 60.0)]
    assert outputs["airflow"] == pytest.approx(expected)


def test_a_run_draws_wind_plume_and_sensors_anew_from_its_own_seed():
    """Whatever the blocks were made with: all that is drawn, and what flew before."""
    one = [block.step_for(facts(7)) for block in blocks(seed=1)]
    two = [block.step_for(facts(7)) for block in blocks(seed=50)]
    other = [block.step_for(facts(8)) for block in blocks(seed=1)]
    first, same, different = (compiled(steps, 40) for steps in (one, two, other))
    for a, b, c in zip(first, same, different, strict=True):
        assert a.tobytes() == b.tobytes()
        assert a.tobytes() != c.tobytes()
    assert np.array_equal(one[2].numbers.scales, two[2].numbers.scales)
    assert not np.array_equal(one[2].numbers.scales, other[2].numbers.scales)
    assert not np.array_equal(one[1].state, other[1].state)
