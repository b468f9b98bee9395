"""The range of every number of a scenario, by the kind of quantity that it is.

Defaults stand in the table of docs/model.md, which tests/test_docs.py holds; here are
those of the models that a scenario has none of unless asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from diagrams.scenario import Scenario

#: What the unit at the end of a field's name allows, longest ending first. A robot on
#: a floor stays within a kilometre, a run within a day; nothing that divides is 0.
KINDS = {
    "_sound_speed_m_s": (50.0, 1e4),
    "_position_m": (-1e3, 1e3),
    "_positions_m": (-1e3, 1e3),
    "_microphones_m": (-1e3, 1e3),
    "_waypoints_m": (-1e3, 1e3),
    "_corner_m": (-1e3, 1e3),
    "_clearance_m": (0.0, 1e3),
    "_start_s": (0.0, 86_400.0),
    "_start_time_s": (0.0, 86_400.0),
    "_n_s_m": (1e-9, 1e6),
    "_m_s2": (1e-3, 1e6),
    "_n_m": (1e-9, 1e6),
    "_m_s": (1e-3, 100.0),
    "_deg": (-3600.0, 3600.0),
    "_hz": (1.0, 1e6),
    "_kg": (1e-3, 1e4),
    "_pa": (1e-9, 1e6),
    "_j": (1e-9, 1e6),
    "_n": (1e-9, 1e6),
    "_v": (1e-9, 1e6),
    "_m": (1e-9, 1e3),
    "_s": (1e-9, 86_400.0),
    # Weights of a sum, which may leave a part out, and what is held against it.
    "_gain": (0.0, 1e6),
    "_threshold": (0.0, 1e6),
}
ABOVE_0, BELOW_1 = math.nextafter(0.0, 1.0), math.nextafter(1.0, 0.0)
#: Fields that are narrower or wider than their kind, or have no unit.
FIELDS = {
    "Scenario.duration_s": (1e-9, 3600.0),
    "Scenario.seed": (0, 2**63 - 1),
    "StopParameters.following_share": (0.0, 1.0),
    "IntegratorParameters.step_s": (1e-5, 0.025),
    # Things that may stand still, and laws whose springs and dampers may be left out.
    "CarrierParameters.speed_m_s": (0.0, 100.0),
    "ObstacleParameters.speed_m_s": (0.0, 100.0),
    "AttractionParameters.stiffness_n_m": (0.0, 1e6),
    "AttractionParameters.damping_n_s_m": (0.0, 1e6),
    "AttractionParameters.follow_distance_m": (0.0, 1e3),
    "CollisionVectorParameters.pair_separation_m": (0.0, 1e3),
    "TrackerParameters.measurement_floor_m": (0.0, 1e3),
    "TrackerParameters.believed_outliers": (1, 1000),
    # Cells below 5 mm are too many for a window, above 25 cm too few.
    "FreeSpaceParameters.cell_m": (0.005, 0.25),
    "FreeSpaceParameters.range_margin_m": (0.0, 1e3),
    "FreeSpaceParameters.wheel_error": (0.0, 1.0),
    "FreeSpaceParameters.place_error_m": (0.0, 1e3),
    "RouteParameters.goal_m": (-1e3, 1e3),
    **{
        f"{kind}TrajectoryParameters.contact_{field}": (0.0, 1e6)
        for kind in ("Conventional", "Adaptive", "Filtered")
        for field in ("stiffness_n_m", "damping_n_s_m")
    },
    # Weights, rates and shares, which may be left out.
    **{
        f"{which}AdaptationParameters.{field}": ends
        for which in ("", "Printed")
        for field, ends in {
            "rate": (0.0, 1e6),
            "contact_rate": (0.0, 1e6),
            "penalty": (0.0, 1e6),
            "leakage": (0.0, 1e6),
            "velocity_weight_s": (0.0, 86_400.0),
            "normalisation": (1e-9, 1e6),
        }.items()
    },
    "ReferenceModelParameters.natural_frequency_rad_s": (1e-9, 1e6),
    "ReferenceModelParameters.damping_ratio": (1e-9, 1e6),
    "SafetyFilterParameters.margin_m": (0.0, 1e3),
    "SafetyFilterParameters.approach_rate": (1e-3, 100.0),
    "SafetyFilterParameters.horizon_s": (0.1, 60.0),
    "ObjectSensorParameters.noise_m": (0.0, 1e3),
    "ObjectSensorParameters.velocity_noise_m_s": (0.0, 100.0),
    "ObjectSensorParameters.latency_s": (0.0, 86_400.0),
    "ObjectDetectorParameters.most_oblique_deg": (0.0, 85.0),
    "ObjectDetectorParameters.noise_m": (0.0, 1e3),
    "ObjectDetectorParameters.confirmation_s": (0.0, 86_400.0),
    "ObjectDetectorParameters.memory_s": (0.0, 86_400.0),
    "ObjectDetectorParameters.resting_m_s": (0.0, 100.0),
    # A way along walls would graze them.
    "RouteParameters.clearance_m": (1e-9, 1e3),
    "GuardParameters.obstacle_speed_m_s": (0.0, 100.0),
    "GuardParameters.margin_m": (0.0, 1e3),
    "GuardParameters.least_margin_m": (0.0, 1e3),
    "GuardParameters.slow_turn_rad_s": (0.0, 10.0),
    # Air on earth; speeds of sound from rubber to steel.
    "AcousticParameters.temperature_c": (-50.0, 60.0),
    "UltrasonicParameters.beam_half_angle_deg": (ABOVE_0, math.nextafter(90.0, 0.0)),
    "UltrasonicParameters.noise_m": (0.0, 1e3),
    "UltrasonicParameters.dropout_probability": (0.0, 1.0),
    "PlantParameters.slip": (-BELOW_1, BELOW_1),
    "PlantParameters.friction": (1e-3, 100.0),
    "OdometryParameters.pulses_per_revolution": (1, 10_000_000),
    # A burst has two edges of 4 ms; half of 100 kHz is the highest frequency.
    "SoundParameters.on_s": (0.008, 60.0),
    "TDOAParameters.high_hz": (1.0, 50_000.0),
    "TDOAParameters.false_alarm_rate": (ABOVE_0, BELOW_1),
    "TDOAParameters.maximum_misfit": (0.0, 1.0),
    "TDOAParameters.maximum_ambiguity": (0.0, 1.0),
    "TDOAParameters.maximum_bearing_std_deg": (1e-9, 1e6),
    "TDOAParameters.maximum_relative_range_std": (1e-9, 1e6),
    "IdealHearingParameters.bearing_noise_deg": (0.0, 1e6),
    "IdealHearingParameters.range_noise_fraction": (0.0, 1e6),
    "MicArrayParameters.snr_db_at_1m": (-40.0, 150.0),
    "MicArrayParameters.sensitivity_db": (-120.0, 40.0),
    "MicArrayParameters.preamplifier_gain_db": (-40.0, 120.0),
    "MicArrayParameters.adc_bits": (2, 16),
    "MicArrayParameters.channel_skew_s": (0.0, 86_400.0),
    "MicArrayParameters.ego_noise_snr_db_at_1m": (-40.0, 150.0),
    "MicArrayParameters.ego_noise_share_at_rest": (0.0, 1.0),
    "MicArrayParameters.position_tolerance_m": (0.0, 0.1),
    "MicArrayParameters.delay_tolerance_s": (0.0, 1e-4),
    "MicArrayParameters.gain_tolerance_db": (0.0, 40.0),
    # A robot's clock, and the frames of its microphones.
    "Scenario.tick_s": (1e-3, 1.0),
    "MicArrayParameters.frame_s": (1e-3, 1.0),
    "UltrasonicParameters.period_s": (1e-3, 1.0),
    "MicArrayParameters.sample_rate_hz": (1e3, 1e5),
    # A robot that never backs off, does not weave, or follows by distance alone.
    "FollowingParameters.back_speed_m_s": (0.0, 100.0),
    "FollowingParameters.approach_gain": (1e-9, 1e6),
    "FollowingParameters.turn_gain": (1e-9, 1e6),
    "FollowingParameters.turn_rate_rad_s": (ABOVE_0, 20.0),
    "FollowingParameters.source_share": (0.0, 1.0),
    "GuardedParameters.weave_rad": (0.0, 1.5),
    "GuardedParameters.search_rad": (0.0, 1.5),
    "GuardedParameters.search_less": (0.0, 1.0),
    "DynamicWindowParameters.turn_acceleration_rad_s2": (1e-9, 1e6),
    "VectorFieldHistogramParameters.slow_density": (1e-9, 1e6),
    "PathIntegralParameters.samples": (10, 5_000),
    "PathIntegralParameters.steps": (2, 100),
    "PathIntegralParameters.turn_spread_rad_s": (1e-9, 1e6),
    "PathIntegralParameters.temperature": (1e-9, 1e6),
    "PathIntegralParameters.collision_cost": (0.0, 1e6),
    # The room's response is worked out anew at most once a frame.
    "RoomParameters.update_period_s": (1e-3, 60.0),
    "RoomParameters.reverberation_time_s": (1e-3, 20.0),
    "RoomParameters.absorption": (ABOVE_0, 1.0),
    "RoomParameters.maximum_order": (1, 150),
    "SensorFaultParameters.sensor": (1, 360),
    # Robots that search: shares, ratios, angles within what they can be, addresses.
    "StopParameters.odor_ahead_deg": (0.0, 180.0),
    "WindParameters.speed_m_s": (0.0, 20.0),
    "WindParameters.meander_intensity": (0.0, 1.0),
    "WindParameters.meander_time_s": (0.1, 3600.0),
    "WindParameters.jet_origin_m": (-1e3, 1e3),
    "WindParameters.jet_growth": (0.0, 1.0),
    "OdorSourceParameters.ratio_at_2_m": (1e-3, 0.999),
    "OdorSourceParameters.height_m": (0.0, 1e3),
    "OdorSourceParameters.puffs_per_s": (1.0, 50.0),
    "OdorSourceParameters.level_growth": (1e-3, 1.0),
    "OdorSourceParameters.upright_growth": (1e-3, 1.0),
    "OdorSourceParameters.own_intensity": (0.0, 1.0),
    "OdorSourceParameters.own_time_s": (0.01, 3600.0),
    "OdorSourceParameters.mean_intensity": (1e-3, 1.0),
    "OdorSourceParameters.reach_m": (0.5, 1e3),
    "OdorSourceParameters.age_s": (0.0, 86_400.0),
    "OdorSourceParameters.room_volume_m3": (1.0, 1e6),
    "AirflowParameters.gain_s_m": (1e-9, 1e6),
    "AirflowParameters.noise": (0.0, 1.0),
    "GasSensorParameters.height_m": (0.0, 1e3),
    "GasSensorParameters.exponent": (1e-9, 1e6),
    "GasSensorParameters.noise": (0.0, 1.0),
    "GasSensorParameters.mismatch": (0.0, 0.1),
    "GasSensorParameters.slope_mismatch": (0.0, 0.15),
    "GasSensorParameters.drift_per_h": (-0.03, 0.03),
    "GasSensorFaultParameters.sensor": (1, 3),
    "ContactFaultParameters.switch": (1, 2),
    "MicrophoneFaultParameters.microphone": (1, 64),
    "CompassParameters.hard_iron": (-0.9, 0.9),
    "CompassParameters.soft_iron": (0.1, 10.0),
    "CompassParameters.noise_deg": (0.0, 90.0),
    **{
        f"HeadingControlParameters.{field}": (0.0, 1e6)
        for field in (
            "proportional",
            "integral",
            "differential",
            "integral_within_deg",
            "largest_integral_deg",
            "largest_differential_deg",
        )
    },
    "HeadingControlParameters.largest_error_deg": (1e-9, 1e6),
    "HeadingControlParameters.turning_beyond_deg": (1e-9, 1e6),
    "RadioParameters.latency_s": (0.0, 86_400.0),
    "RadioParameters.loss": (0.0, 1.0),
    "RadioParameters.byte_error": (0.0, 1.0),
    "RadioParameters.level_at_1_m_dbm": (-150.0, 50.0),
    "RadioParameters.path_loss_exponent": (1.0, 10.0),
    "RadioParameters.fading_db": (0.0, 30.0),
    "CrossPowerParameters.ambiguous_share": (0.0, 1.0),
    "PlumeSearchParameters.wait_s": (0.0, 86_400.0),
    "PlumeSearchParameters.most_steps": (1, 1000),
    "PlumeSearchParameters.gate_share": (0.0, 1.0),
    "PlumeSearchParameters.address": (1, 3),
    **{
        f"SongRuleParameters.{field}_threshold": (0.0, 2.0)
        for field in ("initial", "turning", "reverse")
    },
    "SongRuleParameters.airflow_threshold": (1e-9, 1e6),
    **{
        f"SongRuleParameters.{field}_turn_deg": (0.0, 180.0)
        for field in ("upwind", "gradient", "local")
    },
    "UpwindGradientParameters.largest_lean_deg": (0.0, 90.0),
    "UpwindGradientParameters.lost_share": (0.0, 1.0),
    "UpwindGradientParameters.cast_deg": (45.0, 180.0),
    "UpwindGradientParameters.still_air": (1e-9, 1e6),
    "SoundSearchParameters.caller": (1, 3),
    "SoundSearchParameters.address": (1, 3),
    "SoundSearchParameters.waits_for": (0, 3),
    "SoundSearchParameters.noise_s": (0.0, 86_400.0),
    "SoundSearchParameters.tries": (1, 100),
    "SoundSearchParameters.most_steps": (1, 1000),
}
#: Least and greatest length of texts and lists.
LENGTHS = {
    "Scenario.name": (1, None),
    "Scenario.law": (1, None),
    "Scenario.blocks": (None, 32),
    "UltrasonicParameters.axes_deg": (1, 360),
    "UltrasonicParameters.positions_m": (None, 360),
    "UltrasonicParameters.faults": (None, 360),
    "Scenario.obstacles": (None, 100),
    "Scenario.robots": (None, 16),
    "Scenario.sources": (None, 16),
    "ObstacleParameters.name": (1, None),
    "ObstacleParameters.waypoints_m": (None, 1000),
    "SourceRobotParameters.waypoints_m": (None, 1000),
    "RobotParameters.microphones_m": (3, None),
    "ContactParameters.faults": (None, 2),
    "GasSensorParameters.faults": (None, 8),
    "MicArrayParameters.faults": (None, 64),
}
#: A room, an obstacle and a guard of which nothing is said.
DEFAULTS = {
    "RoomParameters.size_m": [7.0, 7.0, 3.0],
    "RoomParameters.reverberation_time_s": 0.4,
    "RoomParameters.source_height_m": 0.3,
    "RoomParameters.microphone_height_m": 0.3,
    "RoomParameters.update_period_s": 0.1,
    "ObstacleParameters.name": "obstacle",
    "ObstacleParameters.size_m": [0.1, 0.05],
    "ObstacleParameters.waypoints_m": [[2.0, 1.0]],
    "ObstacleParameters.heading_deg": 0.0,
    "ObstacleParameters.speed_m_s": 0.3,
    "ObstacleParameters.acceleration_m_s2": 1.0,
    "ObstacleParameters.start_time_s": 0.0,
    "ObstacleParameters.at_end": "stop",
    "ObstacleParameters.corner_radius_m": 0.05,
    "GuardParameters.obstacle_speed_m_s": 0.0,
    "GuardParameters.braking_m_s2": 1.5,
    "GuardParameters.margin_m": 0.012,
    "GuardParameters.least_margin_m": 0.009,
    "GuardParameters.slow_turn_rad_s": 0.3,
    "SensorFaultParameters.sensor": 1,
    "SensorFaultParameters.kind": "silent",
    "SensorFaultParameters.start_s": 0.0,
}


def schemas() -> dict[str, dict[str, Any]]:
    """Schema of every field of the scenario's tree, as `Model.field`.

    It is that of what a field holds, which may be given in a shorter form.
    """
    scenario = Scenario.model_json_schema(mode="serialization")
    models = {"Scenario": scenario, **scenario["$defs"]}
    return {
        f"{model}.{field}": schema
        for model, whole in models.items()
        for field, schema in whole["properties"].items()
    }


def numbers(schema: dict[str, Any]) -> Iterator[tuple[float, float]]:
    """Least and greatest value of every number in a field."""
    if schema.get("type") in ("number", "integer"):
        yield limits(schema)
    for part in (*schema.get("anyOf", ()), *schema.get("prefixItems", ())):
        yield from numbers(part)
    if isinstance(schema.get("items"), dict):
        yield from numbers(schema["items"])


def limits(schema: dict[str, Any]) -> tuple[float, float]:
    """Least and greatest value that a number may have."""
    whole = schema["type"] == "integer"
    least = schema.get("minimum", -math.inf)
    greatest = schema.get("maximum", math.inf)
    if "exclusiveMinimum" in schema:
        above = schema["exclusiveMinimum"]
        least = above + 1 if whole else math.nextafter(above, math.inf)
    if "exclusiveMaximum" in schema:
        below = schema["exclusiveMaximum"]
        greatest = below - 1 if whole else math.nextafter(below, -math.inf)
    return least, greatest


def wanted(field: str) -> tuple[float, float]:
    """What the tables above say of `Model.field`."""
    model, _, name = field.partition(".")
    if model in ("SourceRobotParameters", "InterfererParameters"):
        field = f"CarrierParameters.{name}"
    kinds = (limits for kind, limits in KINDS.items() if f"_{name}".endswith(kind))
    return FIELDS.get(field) or next(kinds)


NUMBERS = {name: set(numbers(schema)) for name, schema in schemas().items()}


@pytest.mark.parametrize("field", [name for name in NUMBERS if NUMBERS[name]])
def test_range(field):
    assert NUMBERS[field] == {wanted(field)}


def test_lengths_of_texts_and_lists():
    """Pairs and triples are as long as they are."""
    found = {}
    for name, schema in schemas().items():
        least = schema.get("minLength", schema.get("minItems"))
        greatest = schema.get("maxLength", schema.get("maxItems"))
        greatest = schema.get("maxProperties", greatest)
        if least != greatest:
            found[name] = (least, greatest)
    assert found == LENGTHS


@pytest.mark.parametrize("field", DEFAULTS)
def test_default_of_what_a_scenario_need_not_have(field):
    assert schemas()[field]["default"] == DEFAULTS[field]


def test_what_a_room_is_not_asked_for_is_worked_out():
    for field in ("corner_m", "absorption", "maximum_order"):
        assert schemas()[f"RoomParameters.{field}"]["default"] is None
