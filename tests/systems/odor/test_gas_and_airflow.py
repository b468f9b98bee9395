"""Gas sensors: times, power law, faults; airflow sensors: lobes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.framework.compiling import njit
from systems.framework.faults import Fault
from systems.odor import airflow_sensors
from systems.odor.airflow_sensors import AirflowSensors
from systems.odor.gas_sensor_array import GasSensorArray
from systems.odor.odor_plume import PLUME_SIZE
from systems.odor.parameters import (
    AirflowParameters,
    GasSensorParameters,
    WindParameters,
)
from systems.odor.wind import WindField

QUIET = {"noise": 0.0, "mismatch": 0.0}


def ratios(levels, compiled=False, faults=(), **own):
    """(ticks, 3) where the whole floor has the concentrations of ``levels``."""
    step = GasSensorArray(
        parameters=GasSensorParameters(**{**QUIET, **own}), faults=faults, seed=1
    ).step
    work = njit(step.step, cache=True) if compiled else step.step
    state, rows = np.array(step.state), []
    for tick, level in enumerate(levels):
        plume = np.zeros(PLUME_SIZE)
        plume[0] = level
        outputs = np.zeros(3), np.zeros(3)
        work(tick, state, (plume, np.zeros(3)), outputs, step.numbers)
        rows.append(outputs[0])
    return np.array(rows)


def time_to_95(rows):
    done = np.abs(rows[:, 0] - rows[-1, 0]) < 0.05 * abs(rows[0, 0] - rows[-1, 0])
    return 0.025 * int(done.argmax())


@pytest.mark.parametrize(
    ("preset", "down", "up"),
    [("song2011", (5, 10), (15, 20)), ("tgs2620", (8, 10), (46, 48))],
)
def test_a_step_takes_the_papers_times(preset, down, up):
    """Song 2011, 2.3.3: 5 to 10 s down, 15 to 20 s up."""
    rows = ratios([1.0] * 4000 + [0.0] * 8000, preset=preset)
    assert down[0] <= time_to_95(rows[:4000]) <= down[1]
    assert up[0] <= time_to_95(rows[4000:]) <= up[1]


def test_at_rest_it_is_the_power_law():
    assert ratios([3.0] * 4000)[-1] == pytest.approx(4.0**-0.7155, rel=1e-6)


def test_compiled_it_reads_the_same():
    levels = np.abs(np.sin(np.arange(300) / 20.0))
    own = {"noise": 0.01, "mismatch": 0.02}
    np.testing.assert_allclose(
        ratios(levels, **own), ratios(levels, True, **own), rtol=1e-12
    )


def test_a_dead_sensor_reads_clean_air_and_a_frozen_one_what_it_read():
    dead = Fault(sensor="gas_sensors", number=3, kind="dead", start_s=5.0)
    frozen = Fault(sensor="gas_sensors", number=1, kind="frozen", start_s=5.0)
    rows = ratios([1.0] * 400, noise=0.01, faults=(dead, frozen))
    assert (rows[200:, 2] == 1.0).all()
    assert (rows[200:, 0] == rows[199, 0]).all()
    assert len(set(rows[200:, 1].tolist())) == 200


def test_mismatch_and_noise_are_as_large_as_told():
    drawn = [
        GasSensorArray(
            parameters=GasSensorParameters(mismatch=0.02), seed=s
        ).step.numbers
        for s in range(300)
    ]
    scales = np.concatenate([numbers.scales for numbers in drawn])
    assert np.std(scales) == pytest.approx(0.02, rel=0.1)
    exponents = np.concatenate([numbers.exponents for numbers in drawn])
    assert np.std(exponents / 0.7155) == pytest.approx(0.06, rel=0.1)
    rows = ratios([0.0] * 3000, noise=0.003)
    np.testing.assert_allclose(rows.std(axis=0), 0.003, rtol=0.1)


@pytest.fixture
def airflow(monkeypatch):
    """Readings without noise."""
    monkeypatch.setattr(airflow_sensors, "_NOISE_SHARE", 0.0)
    return _airflow


def _airflow(heading_deg, **own):
    wind = WindParameters(kind="uniform", speed_m_s=0.8)
    air = np.array(WindField(parameters=wind).step.state)
    step = AirflowSensors(parameters=AirflowParameters(**own)).step
    pose, outputs = np.array([0.0, 0.0, math.radians(heading_deg)]), [[0.0, 0.0]]
    step.step(0, [], [air, pose], outputs, step.numbers)
    return outputs[0]


def test_the_wind_on_the_nose_is_felt_alike_on_both_sides(airflow):
    """It blows along x, so that upwind is 180 deg: k U cos 45."""
    assert airflow(180.0) == pytest.approx([2.4 * math.sqrt(0.5)] * 2)


def test_the_windward_sensor_feels_more(airflow):
    """Heading 150 deg: the wind comes from 30 deg to the left."""
    left, right = airflow(150.0)
    assert left == pytest.approx(2.4 * math.cos(math.radians(15.0)))
    assert right == pytest.approx(2.4 * math.cos(math.radians(75.0)))


def test_a_crosswind_wire_feels_a_fifth_along_and_all_across(airflow):
    """Both below the threshold where it points upwind, as at point B of Song 2011."""
    assert airflow(180.0, lobe="crosswind") == pytest.approx([0.48, 0.48])
    assert airflow(90.0, lobe="crosswind") == pytest.approx([2.4, 0.0], abs=1e-9)
