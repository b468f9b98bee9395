"""Both engines make the same run with every noise, fault and rate of every block.

Robots that meet amplify what differs: a last bit becomes a tenth of a millimeter.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from diagrams import Scenario, load_scenario, simulate
from diagrams.running.compiled.loop_blocks import shared_blocks, shared_world
from diagrams.scenario.fields.field_list import list_fields
from diagrams.scenario.fields.shipped import scenario_schema
from systems.framework.block import Step
from systems.framework.noise import (
    TickNoise,
    standard_normals,
    tick_noise,
    tick_normals,
)

#: Last names of fields that disturb, or decide when something is done.
DISTURBING = re.compile(
    r"noise|fault|dropout|loss$|error$|slip|mismatch|drift|fading|tolerance|friction"
    r"|latency|period_s$|frame_s$|sample_rate|rate$|rounding|pulses|intensity"
    r"|firing|tick_s|step_s|snr|spread"
)
#: Such by their names alone, and why they are not set.
OTHERS = {
    "sound_search.noise_s": "for how long a search listens",
    "gas_sensors.mismatch": "0.01 by default",
    "tdoa.false_alarm_rate": "a threshold",
}
FAST = {"tick_s": 0.0125, "microphones.frame_s": 0.05, "ultrasonic.period_s": 0.0375}
WHEELS = {
    "plant.slip": [0.02, -0.01],
    "plant.pulses_per_revolution": 1000,
}
AIR = {
    "wind.meander_intensity": 0.2,
    "gas_sensors.noise": 0.01,
    "robots.finder.faults": [
        {"sensor": "gas_sensors", "number": 2, "kind": "frozen", "start_s": 2.0},
        {"sensor": "contact_switches", "kind": "stuck_open", "start_s": 1.0},
    ],
    "compass.noise_deg": 2.0,
    "radio.latency_s": 0.075,
    "radio.loss": 0.1,
    "integration_step_s": 0.01,
}
OBJECTS = {
    "objects.noise_m": 0.02,
    "objects.velocity_noise_m_s": 0.05,
    "objects.latency_s": 0.05,
}
#: Two robots that drive toward each other and past, 0.9 m wide each.
MEETING: dict[str, Any] = {
    "robots": {
        "near": {"start": {"position_m": [0.0, 0.0]}},
        "far": {
            "start": {"position_m": [-0.3, 1.6], "heading_deg": -30.0},
            "attraction": {"follow_distance_m": 0.9},
        },
    },
    "source.waypoints_m": [[2.2, 0.5], [4.0, 0.5]],
    "obstacles": [{"name": "box", "size_m": [0.2, 0.2], "waypoints_m": [[1.2, -0.6]]}],
}
#: Bodies near them that repeat a lap, stop and turn, and keep to times.
SCHEDULES = [
    *MEETING["obstacles"],
    {
        "name": "lap",
        "waypoints_m": [[1.4, -1.4], [2.0, -1.4], [2.0, -1.1]],
        "speed_m_s": 0.8,
        "at_end": "loop",
    },
    {
        "name": "stop",
        "waypoints_m": [[2.9, 1.5], [2.6, 1.5], [2.6, 1.9]],
        "pauses_s": [0.2, 0.5, 0.0],
    },
    {
        "name": "times",
        "waypoints_m": [[1.0, 2.6], [1.6, 2.6]],
        "waypoint_times_s": [0.2, 1.9],
        "at_end": "shuttle",
    },
]
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "by ear": (
        "default",
        {
            **MEETING,
            **FAST,
            **WHEELS,
            "duration_s": 4.0,
            "law": "active",
            "sound.period_s": 1.0,
            "microphones.sample_rate_hz": 48_000.0,
            "microphones.snr_db_at_1m": 15.0,
            "microphones.ego_noise_file": "noise.wav",
            "microphones.ego_noise_snr_db_at_1m": 25.0,
            "faults": [
                {"sensor": "microphones", "number": 3, "kind": "dead", "start_s": 3.0}
            ],
            "ultrasonic.noise_m": 0.01,
            "ultrasonic.dropout_probability": 0.1,
            "ultrasonic.firing": "sequential",
        },
    ),
    "in a room with loudspeakers": (
        "convoy",
        {
            "duration_s": 2.5,
            "robots.leader.loudspeaker.period_s": 1.5,
            "room": {
                "size_m": [14.0, 14.0, 3.0],
                "absorption": 0.5,
                "maximum_order": 1,
            },
            "microphones.snr_db_at_1m": 20.0,
        },
    ),
    "guarded, with faults": (
        "default",
        {
            **MEETING,
            **WHEELS,
            "duration_s": 8.0,
            "hearing": "ideal",
            "law": "active",
            "guard.obstacle_speed_m_s": 0.3,
            "plant.friction": 0.1,
            "faults": [
                {"sensor": "odometry", "kind": "lost", "start_s": 6.0},
                {"sensor": "ultrasonic", "number": 2, "kind": "noisy", "start_s": 4.0},
            ],
            "guard.wheel_error": 0.03,
            "guard.place_error_m": 0.05,
            "ultrasonic.noise_m": 0.01,
            "ultrasonic.dropout_probability": 0.05,
        },
    ),
    "guarded law, lidar": (
        "default",
        {
            **MEETING,
            "duration_s": 4.0,
            "hearing": "ideal",
            "law": "guarded",
            "ultrasonic.preset": "lidar",
            "ultrasonic.dropout_probability": 0.02,
            "plant.pulses_per_revolution": None,
        },
    ),
    "dwa": (
        "default",
        {
            **MEETING,
            "obstacles": SCHEDULES,
            "source.waypoint_times_s": [0.5, 7.0],
            "duration_s": 4.0,
            "hearing": "ideal",
            "law": "dwa",
        },
    ),
    "mppi": (
        "default",
        {
            **MEETING,
            "duration_s": 2.5,
            "hearing": "ideal",
            "law": "mppi",
            "laws.mppi.turn_spread_rad_s": 1.3,
        },
    ),
    "four on routes": (
        "robots_4",
        {**OBJECTS, **WHEELS, "seed": 43, "duration_s": 20.0},
    ),
    "adaptive": (
        "robots_2",
        {
            **OBJECTS,
            "duration_s": 20.0,
            "law": "trajectory_adaptive",
            "laws.trajectory_adaptive.rate": 5.0,
            "laws.trajectory_adaptive.contact_rate": 2.0,
        },
    ),
    "by beams": (
        "robots_2",
        {
            "duration_s": 16.0,
            "obstacle_sensing": "ultrasonic",
            "ultrasonic.preset": "scan_7",
            "ultrasonic.noise_m": 0.01,
            "ultrasonic.dropout_probability": 0.05,
            "faults": [
                {"sensor": "ultrasonic", "number": 3, "kind": "frozen", "start_s": 3.0}
            ],
        },
    ),
    "searching": (
        "odor_then_sound",
        {
            **AIR,
            "duration_s": 25.0,
            "room": None,
            "search.wait_s": 1.0,
            "robots.finder.start.position_m": [0.1, 0.05],
        },
    ),
}
#: Runs in which robots come near to one another, and how near, m.
MEET = {
    "by ear": 1.3,
    "guarded, with faults": 1.8,
    "guarded law, lidar": 1.6,
    "dwa": 1.3,
    "mppi": 1.3,
    "four on routes": 1.5,
    "adaptive": 1.0,
    "by beams": 1.0,
}


def scenario_of(name: str, folder: Path) -> Scenario:
    library, fields = RUNS[name]
    if "microphones.ego_noise_file" in fields:
        noise = np.random.default_rng(7).standard_normal((48_000, 3))
        soundfile.write(folder / "noise.wav", 0.1 * noise, 48_000)
        fields = {**fields, "microphones.ego_noise_file": str(folder / "noise.wav")}
    return load_scenario(library, fields)


def test_every_field_that_disturbs_is_set_in_a_run():
    """From the models of parameters: a new one is set, or named with a reason."""
    fields = {field.path: field for field in list_fields(scenario_schema())}
    found = {
        path
        for path, field in fields.items()
        if DISTURBING.search(path.rpartition(".")[2])
        and not path.startswith(("robots.", "sources."))
    }
    found -= {path for path in found if path.startswith("faults.")}
    found = {re.sub(r"^loudspeaker\.", "robots.leader.loudspeaker.", p) for p in found}
    given = {
        f"{path}.{own}" if isinstance(value, Mapping) and path == "room" else path
        for _, settings in RUNS.values()
        for path, value in settings.items()
        for own in (value if isinstance(value, Mapping) else [""])
    }
    assert len(found) > 25
    assert found - given - OTHERS.keys() == set()
    assert OTHERS.keys() - found == set(), "no such field, or its name says nothing"
    for _, settings in RUNS.values():
        for path in found & settings.keys():
            if path in fields:
                assert settings[path] != fields[path].default, path


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_both_engines_make_the_same_run(name, tmp_path):
    scenario = scenario_of(name, tmp_path)
    drake, compiled = (simulate(scenario, engine=e) for e in ("drake", "compiled"))
    assert compiled.ending == drake.ending
    assert compiled.columns.keys() == drake.columns.keys()
    np.testing.assert_array_equal(compiled.time, drake.time)
    assert drake.simulated_s > 1.0
    for column, values in drake.columns.items():
        # Speeds are differences of places over a tick.
        atol = 1e-7 if "speed" in column else 1e-9
        np.testing.assert_allclose(
            compiled.columns[column], values, rtol=0.0, atol=atol, err_msg=column
        )
    for column, values in drake.world.items():
        np.testing.assert_allclose(compiled.world[column], values, rtol=0.0, atol=1e-9)
    robots = [own.poses("WB")[:, :2] for own in drake.robots.values()]
    apart = [
        np.hypot(*(one - other).T).min()
        for k, one in enumerate(robots)
        for other in robots[:k]
    ]
    assert len(apart) > 0
    if name in MEET:
        assert min(apart) < MEET[name]


def test_both_engines_draw_the_same_numbers():
    noise = tick_noise(5)
    plain: Any = getattr(tick_normals, "py_func")  # noqa: B009
    numbers = plain(noise, 3, 2, 5)
    np.testing.assert_array_equal(tick_normals(noise, 3, 2, 5), numbers)
    np.testing.assert_array_equal(standard_normals((2, 5), 5, 3), numbers)
    assert numbers.dtype == np.float64


def single_precision(value: Any, name: str) -> list[str]:
    """Numbers of single precision in what a step depends on."""
    if isinstance(value, TickNoise):
        return []  # a table from which double precision is made
    if isinstance(value, np.ndarray | np.generic):
        return [name] if value.dtype in (np.float32, np.complex64) else []
    if isinstance(value, tuple | list):
        names = getattr(value, "_fields", range(len(value)))
        pairs = zip(names, value, strict=True)
        return [n for k, v in pairs for n in single_precision(v, f"{name}.{k}")]
    return []


@pytest.mark.parametrize("name", RUNS)
def test_no_step_multiplies_by_single_precision(name, tmp_path):
    """Times a Python float that is single precision in numpy, double in numba."""
    scenario = scenario_of(name, tmp_path)
    world = shared_world(scenario)
    every = [*shared_blocks(scenario).values(), *([world] if world else [])]
    steps = [
        (part, block.step)
        for made in every
        for part, block in made.blocks.items()
        if isinstance(getattr(block, "step", None), Step)
    ]
    assert len(steps) > 3
    for part, step in steps:
        assert single_precision(step.numbers, part) == []
