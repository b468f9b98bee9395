"""Puffs against their mean, wind, background and seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.framework.input_error import InputError
from systems.odor.odor_plume import (
    OWN_TIME_S,
    PUFFS_BEGIN,
    OdorPlume,
    concentration,
    release_rate,
)
from systems.odor.parameters import OdorParameters, WindParameters
from systems.odor.steady_plume import steady_concentration
from systems.odor.wind import MEANDER_TIME_S, WindField, wind_velocity

WIND = WindParameters()
INTENSITY = math.sqrt(0.12**2 + 0.12**2 + 0.1**2)


def carried(seconds, *, seed=1, own=None, wind=WIND, every=1.0, parts=1):
    """Ports ``plume`` of a run, a row every so often, s.

    Wind and plume go on by 0.1 s, or by so many parts of it.
    """
    own, tick_s = own or OdorParameters(), 0.025
    field = WindField(parameters=wind, seed=seed, tick_s=tick_s).step
    puffs = OdorPlume(parameters=own, wind=wind, seed=seed + 1, tick_s=tick_s).step
    period = field.numbers.period // parts
    dt = period * tick_s
    of_wind = field.numbers._replace(period=period, keep=math.exp(-dt / MEANDER_TIME_S))
    of_puffs = puffs.numbers._replace(
        period=period, period_s=dt, own_keep=math.exp(-dt / OWN_TIME_S)
    )
    air, plume = np.array(field.state), np.array(puffs.state)
    rows = []
    for tick in range(0, round(seconds / tick_s), period):
        before = air.copy()
        field.step(tick, air, (), (), of_wind)
        puffs.step(tick, plume, (before,), (), of_puffs)
        if tick % round(every / tick_s) == 0:
            rows.append(plume.copy())
    return rows


POINTS = [
    (x, off * INTENSITY * x) for x in (0.5, 1.0, 1.5, 2.0) for off in (0, 0.5, -0.9)
]


def means(rows):
    return np.array([np.mean([concentration(r, *p) for r in rows]) for p in POINTS])


def test_their_mean_over_fifty_minutes_is_equation_6():
    rate = release_rate(OdorParameters().ratio_at_2_m)
    got = means(carried(3000.0, every=0.5))
    expected = [
        steady_concentration(x, y, rate, 1.0, (0.197, 0.197, 0.13)) for x, y in POINTS
    ]
    np.testing.assert_allclose(got, expected, rtol=0.15)


@pytest.mark.long
def test_half_the_period_changes_no_mean_by_a_twentieth():
    """Every 0.1 s and every 0.05 s, with other random numbers, over four runs each."""
    runs = [
        [carried(3000.0, seed=s, every=0.5, parts=parts) for s in range(20, 60, 10)]
        for parts in (1, 2)
    ]
    assert {len(rows) for part in runs for rows in part} == {6000}
    whole, halved = (np.mean([means(rows) for rows in part], axis=0) for part in runs)
    np.testing.assert_allclose(halved, whole, rtol=0.05)


def test_the_same_seed_gives_the_same_bytes():
    first, again, other = (carried(20.0, seed=s)[-1] for s in (4, 4, 5))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_the_strength_is_what_a_sensor_reads_two_meters_downwind():
    own = OdorParameters(kind="steady", ratio_at_2_m=0.6)
    plume = np.array(OdorPlume(parameters=own, wind=WIND).step.state)
    assert (1.0 + concentration(plume, 2.0, 0.0)) ** -0.7155 == pytest.approx(0.6)


def test_a_closed_room_fills():
    """Q t / V, whatever the wind does."""
    own = OdorParameters(age_s=60.0, room_volume_m3=37.5)
    rate = release_rate(own.ratio_at_2_m)
    plume = carried(30.0, own=own)[-1]
    far = concentration(plume, -50.0, 0.0)
    assert far == pytest.approx(rate * 89.1 / 37.5, rel=1e-9)


@pytest.mark.parametrize("kind", ["puffs", "steady"])
def test_a_closed_room_is_as_full_at_the_start_as_its_age_says(kind):
    own = OdorParameters(kind=kind, age_s=60.0, room_volume_m3=37.5)
    plume = np.array(OdorPlume(parameters=own).step.state)
    full = release_rate(own.ratio_at_2_m) * 60.0 / 37.5
    assert concentration(plume, -50.0, 0.0) == pytest.approx(full, rel=1e-9)


def test_without_wind_puffs_stay_and_spread():
    own = OdorParameters(age_s=0.0)
    calm = WindParameters(speed_m_s=0.0)
    plume = carried(60.0, own=own, wind=calm)[-1]
    assert np.isfinite(plume).all()
    assert np.abs(plume[PUFFS_BEGIN::7][: int(plume[2])]).max() < 1e-9
    with pytest.raises(InputError, match=r"wind\.speed_m_s"):
        OdorPlume(parameters=OdorParameters(kind="steady"), wind=calm)


def test_the_unsteady_wind_has_its_spread_and_its_memory():
    """An Ornstein-Uhlenbeck process: sd 0.12, correlation exp(-1) after 8 s."""
    step = WindField(parameters=WIND, seed=2).step
    air, rows = np.array(step.state), []
    for tick in range(0, 4 * 60_000, 4):
        step.step(tick, air, (), (), step.numbers)
        rows.append(air[3:5].copy())
    gusts = np.array(rows)
    np.testing.assert_allclose(gusts.std(axis=0), 0.12, rtol=0.08)
    for gust in gusts.T:
        later = np.corrcoef(gust[:-80], gust[80:])[0, 1]
        assert later == pytest.approx(math.exp(-1.0), abs=0.1)


def test_wind_and_plume_change_ten_times_a_second():
    field, puffs = WindField().step, OdorPlume().step
    air, plume, changed = np.array(field.state), np.array(puffs.state), []
    for tick in range(12):
        before = air.copy(), plume.copy()
        puffs.step(tick, plume, (air,), (), puffs.numbers)
        field.step(tick, air, (), (), field.numbers)
        changed.append([(before[0] != air).any(), (before[1] != plume).any()])
    assert changed == [[tick % 4 == 0] * 2 for tick in range(12)]


def test_a_jet_widens_slows_and_blows_nothing_backwards():
    """Its outlet is at -2.2 m."""
    wind = WindParameters(kind="jet", meander_intensity=0.0, jet_diameter_m=0.3)
    air = np.array(WindField(parameters=wind).step.state)
    assert wind_velocity(air, -2.3, 0.0) == (0.0, 0.0)
    assert wind_velocity(air, -1.2, 0.0)[0] == pytest.approx(1.0)
    assert wind_velocity(air, 1.4, 0.0)[0] == pytest.approx(0.5)
    half_width = 0.15 + 0.1 * 3.6
    assert wind_velocity(air, 1.4, half_width)[0] == pytest.approx(0.5 * math.exp(-0.5))


def test_a_puff_spreads_by_the_way_that_the_wind_has_gone():
    """In a wind without gusts: exactly, whatever velocity the puff has of its own."""
    plume = carried(1.0, wind=WindParameters(kind="uniform"))[-1]
    puffs = plume[PUFFS_BEGIN:].reshape(-1, 7)[: int(plume[2])]
    puffs = puffs[puffs[:, 4] < 0.12 * 4.0]  # farther ones leave one by one
    # 16 a second at 1 m/s: one every 62.5 mm.
    np.testing.assert_allclose(np.diff(puffs[:, 4]), -0.12 * 0.0625, rtol=1e-9)
    np.testing.assert_allclose(puffs[:, 5] / 0.13, puffs[:, 4] / 0.12, rtol=1e-9)
    way = puffs[:, 4] / 0.12
    assert np.abs(puffs[:, 0] - way).max() < 4.0 * 0.1 * way.max()
    assert np.std((puffs[:, 0] - way) / way) == pytest.approx(0.1, abs=0.05)
