"""Converts short forms of the list of range sensors in a scenario.

The group ``ultrasonic`` of a scenario accepts these short forms:

- ``sensors: 8`` defines 8 sensors with evenly spaced axes all around.
- ``sensors: {1: {noise_m: 0.05}}`` changes sensor 1 of the preset, counted from 0.
- ``noise_m: 0.01`` beside ``sensors`` gives this value to each sensor that has no
  ``noise_m`` of its own. Without a list of sensors, the value is for all sensors of the
  preset. The other ``SHARED_FIELDS`` work in the same way.
- ``axes_deg`` and ``positions_m`` are the fields of earlier versions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from systems.framework.input_error import InputError, shortened
from systems.framework.meanings import meanings
from systems.framework.parameters import Parameters
from systems.ranging.sensor_presets import SENSOR_PRESETS

#: Fields of a sensor that a scenario may set once for all sensors.
SHARED_FIELDS = (
    "position_m",
    "beam_half_angle_deg",
    "minimum_range_m",
    "maximum_range_m",
    "noise_m",
    "dropout_probability",
)
_MOST_SENSORS = 360


def expanded(data: Mapping[str, Any]) -> dict[str, Any]:
    """Replaces the short forms by one record per sensor.

    Args:
        data: Input of the group ``ultrasonic``. The values may be invalid.

    Returns:
        Input with all records in ``sensors`` and without short forms. A record of the
        wrong type does not change.

    Raises:
        InputError: The number of sensors, or the index of a sensor, is out of range.
    """
    given = dict(data)
    places = _replace_former_fields(given)
    # A later check rejects an unknown preset.
    preset = SENSOR_PRESETS.get(str(given.get("preset")), SENSOR_PRESETS["three"])
    usual = {key: value for key, value in preset.items() if key != "sensors"}
    shared = {key: given.pop(key) for key in SHARED_FIELDS if key in given}
    sensors = given.get("sensors", {})
    if isinstance(sensors, Mapping):
        records = [{**usual, **own, **shared} for own in _ring_or_list(preset)]
        _change(records, sensors)
    elif isinstance(sensors, int | list | tuple) and not isinstance(sensors, bool):
        records = [
            {**usual, **shared, **own} if isinstance(own, Mapping) else own
            for own in map(_plain, _ring_or_list(given))
        ]
    else:
        return given
    if places and len(places) != len(records):
        raise InputError(
            "positions_m",
            f"has {len(places)} positions for {len(records)} sensors; give "
            "ultrasonic.sensors.0.position_m and so on",
        )
    for record, place in zip(records, places, strict=False):
        if isinstance(record, dict):
            record["position_m"] = place
    given["sensors"] = records
    return given


def _replace_former_fields(given: dict[str, Any]) -> Sequence[Any]:
    """Replaces the former fields ``axes_deg`` and ``positions_m`` in place.

    If ``positions_m`` has several positions, the function returns them, one per sensor.
    Otherwise the result is empty.
    """
    if "axes_deg" in given:
        axes = given.pop("axes_deg")
        listed = isinstance(axes, list | tuple)
        given["sensors"] = [{"axis_deg": axis} for axis in axes] if listed else axes
    places = given.get("positions_m")
    if not isinstance(places, list | tuple):
        return ()
    del given["positions_m"]
    if len(places) == 1:
        given["position_m"] = places[0]
        return ()
    return places


def _ring_or_list(group: Mapping[str, Any]) -> Sequence[Any]:
    """Returns the list of sensors of a group.

    If the group has a number of sensors instead, their axes are evenly spaced all
    around.
    """
    sensors = group["sensors"]
    number = sensors if isinstance(sensors, int) else len(sensors)
    if not 1 <= number <= _MOST_SENSORS:
        raise InputError("sensors", f"{number} sensors; use 1 to {_MOST_SENSORS}")
    if not isinstance(sensors, int):
        return list(sensors)
    return [{"axis_deg": 180.0 - 360.0 * k / sensors} for k in range(sensors)]


def _change(records: list[Any], changes: Mapping[Any, Any]) -> None:
    """Changes some of the records in place, by their index."""
    for key, own in changes.items():
        if not str(key).isdecimal() or int(key) >= len(records):
            raise InputError(
                f"sensors.{key}",
                f"is not one of {len(records)} sensors; count from 0 to "
                f"{len(records) - 1}",
            )
        whole = not isinstance(own, Mapping)
        records[int(key)] = own if whole else {**records[int(key)], **own}


def _plain(record: Any) -> Any:
    if isinstance(record, Parameters):
        return record.model_dump(exclude_unset=True)
    return record


def check_shared(data: Mapping[str, Any], model: type[Parameters]) -> None:
    """Checks the fields that a scenario sets for all sensors.

    This early check lets error messages name these fields, and not a field of one
    sensor.

    Args:
        data: Input of the group ``ultrasonic``.
        model: Parameter class of one sensor.

    Raises:
        InputError: A value has the wrong type, or is out of range.
    """
    try:
        model.model_validate({key: data[key] for key in SHARED_FIELDS if key in data})
    except ValidationError as error:
        raise InputError.joined(
            InputError(
                ".".join(map(str, each["loc"])),
                f"is {shortened(repr(each['input']), 80)}; "
                f"{each['msg'][0].lower()}{each['msg'][1:]}",
            )
            for each in error.errors(include_url=False)
        ) from None


def shortened_sensors(dumped: dict[str, Any]) -> dict[str, Any]:
    """Moves the most frequent value of each shared field from the sensors to the group.

    If a user later changes this value in the group, it changes for all sensors that had
    the value.

    Args:
        dumped: All fields of ``UltrasonicParameters`` as plain values.

    Returns:
        Short form. ``expanded`` converts the short form back to the same records.
    """
    if "sensors" not in dumped:  # only some of the fields are wanted
        return dumped
    columns = {key: [each[key] for each in dumped["sensors"]] for key in SHARED_FIELDS}
    usual = {key: max(values, key=values.count) for key, values in columns.items()}
    own = [
        {key: value for key, value in each.items() if value != usual.get(key)}
        for each in dumped["sensors"]
    ]
    return {**dumped, "sensors": own, **usual}


def mark_shared(schema: dict[str, Any]) -> None:
    """Marks the shared fields in the JSON Schema of a sensor, in place."""
    for key in SHARED_FIELDS:
        schema["properties"][key]["shared"] = True


def add_shorthand(schema: dict[str, Any], model: type[Parameters]) -> None:
    """Adds the short forms to the JSON Schema of ``UltrasonicParameters``, in place.

    ``model`` is the parameter class of one sensor.
    """
    properties, told = schema["properties"], meanings(model)
    own = model.model_json_schema()["properties"]
    few = {"minItems": 1, "maxItems": _MOST_SENSORS}
    number = {"type": "integer", "minimum": 1, "maximum": _MOST_SENSORS}
    listed = {"type": "array", "items": properties["sensors"]["items"], **few}
    front = [
        {"axis_deg": own["axis_deg"]} for own in SENSOR_PRESETS["three"]["sensors"]
    ]
    properties["sensors"] = {"anyOf": [listed, number], "default": front}
    for key in SHARED_FIELDS:
        text = f"{told[key]} It applies to all sensors without a value of their own."
        properties[key] = {**own[key], "description": " ".join(text.split())}
        del properties[key]["shared"]
