"""A guarded robot whose sensing fails stops, touches nothing, and says why."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.runs.guarded_motion import halts_of
from analysis.runs.run_report import run_document, run_text
from diagrams import load_scenario, simulate
from systems.base.carrier_parameters import SourceRobotParameters
from systems.safety.braking import HALTED
from systems.world.paths import WaypointPath

#: What the model of the motors leaves of a braking from top speed, s: 0.72 m/s less
#: 1.5 m/s^2, and five times the lag.
BRAKING_S = 1.0
START_S = 3.0


def faulty(law, *settings, name="two_static_obstacles"):
    overrides = ["hearing=ideal", f"law={law}", "guard={}", *settings]
    return simulate(load_scenario(name, overrides), engine="compiled")


@pytest.mark.parametrize("law", ["guarded", "active"])
@pytest.mark.parametrize(
    ("setting", "fault", "sensor"),
    [
        (
            "faults=[{sensor: ultrasonic, number: 2, kind: silent, start_s: 3}]",
            "silent",
            2,
        ),
        ("faults=[{sensor: odometry, kind: lost, start_s: 3}]", "odometry lost", 0),
    ],
)
def test_it_stops_and_says_why(law, setting, fault, sensor):
    run = faulty(law, setting)
    assert run.collision is None
    (halt,) = halts_of(run)
    assert (halt.fault, halt.sensor) == (fault, sensor)
    assert START_S <= halt.start_s < START_S + 0.3
    late = run.time > halt.start_s + BRAKING_S
    moved = np.hypot(
        np.ptp(run.columns["p_WB_x"][late]), np.ptp(run.columns["p_WB_y"][late])
    )
    assert moved < 1e-3
    assert (run.columns["guard_action"][late] == HALTED).all()
    assert run.cause == "stuck"
    summary = run_document(run)
    assert summary["halts"][0]["fault"] == fault
    assert str(halt) in run_text(run, summary)


@pytest.mark.parametrize("kind", ["frozen", "noisy"])
def test_echoes_that_cannot_be_halt_it_before_a_wall(kind):
    """They are known once there are echoes; what reads none may be right."""
    fault = f"faults=[{{sensor: ultrasonic, number: 2, kind: {kind}, start_s: 2}}]"
    run = faulty("active", fault, name="u_trap")
    assert run.collision is None
    (halt, *_) = halts_of(run)
    assert (halt.fault, halt.sensor) == (kind, 2)


def test_sound_sensing_halts_nothing():
    run = faulty("guarded")
    assert run.cause == "reached"
    assert halts_of(run) == []


@pytest.mark.parametrize("law", ["guarded", "active"])
def test_a_sound_that_jumps_leads_into_nothing(law, monkeypatch):
    """After 4 s it is 4 m farther to the right half a second later."""
    waypoints = (4.0, 2.0), (4.0, -2.0)
    jump = WaypointPath(waypoints, speed=8.0, acceleration=100.0, start_time=4.0)
    monkeypatch.setattr(SourceRobotParameters, "path", lambda _: jump)
    run = faulty(law, "source.waypoints_m=[[4,2],[4,-2]]", "duration_s=20")
    assert run.collision is None
    speeds = np.hypot(*np.diff([run.columns["p_WS_x"], run.columns["p_WS_y"]])) / 0.025
    assert speeds.max() > 5.0
