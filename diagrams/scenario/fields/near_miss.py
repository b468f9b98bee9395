"""Suggests names that are similar to a mistyped name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from diagrams.scenario.fields.schema_walk import at_place, leaf_paths
from diagrams.scenario.suggestions import nearest

#: Groups of synonyms with different letters; scenarios use one word of each group.
_SAME_THING = (
    ("position", "location", "place", "pose", "center", "centre", "xy", "waypoints"),
    ("size", "dimensions", "extent", "extents"),
    ("speed", "velocity"),
    ("heading", "angle", "yaw", "orientation", "theta"),
    ("top", "max", "maximum", "largest", "highest"),
    ("min", "minimum", "least", "smallest", "lowest"),
)
#: Groups of synonyms that need a second word: the top speed is not the top of a body.
_LIMITS = _SAME_THING[-2:]
#: Fields by other names: symbols of the papers, and words of other programs.
_OTHER_NAMES = {
    "k_r": "attraction.stiffness_n_m",
    "d_r": "attraction.damping_n_s_m",
    "walls": "obstacles",
    "boxes": "obstacles",
    "objects": "obstacles",
    "gains": "laws",
    "time": "duration_s",
    "t_end": "duration_s",
    "dt": "tick_s",
    "timestep": "tick_s",
    "controller": "law",
    "seeds": "seed",
    "random_seed": "seed",
    "sensors": "ultrasonic.sensors",
    "sonar": "ultrasonic",
    "mics": "robot.microphones_m",
    "positions_m": "robot.microphones_m",
    "speaker": "source",
    "target": "source",
    "leader": "source",
    "initial_pose": "start",
    "temperature": "sound_speed_m_s",
    "temperature_c": "sound_speed_m_s",
    "t60": "room.reverberation_time_s",
    "rt60": "room.reverberation_time_s",
}

#: Groups whose fields users change most.
_USUAL = (
    *("source", "robot", "start", "obstacles", "attraction", "room", "microphones"),
    "ultrasonic",
)


def near_field(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """Suggests an existing field if a user has written an unknown field.

    The function suggests the first of these fields that exists:

    1. a field in the same group with this name and a unit
    2. a field in the same group with the same meaning
    3. a field with a symbol of the papers, or a group with another name
    4. a field in a lower group with this name, with or without a unit
    5. a field anywhere with this name, with or without a unit, if the group of the
       unknown field does not exist or is the whole scenario
    6. a field in the same group with a similar name

    Args:
        schema: JSON Schema of the whole data.
        place: Parts of the path of the unknown field.

    Returns:
        Path of the field, empty if there is no such field.
    """
    *parents, last = place
    if "/" in last:
        *parents, last = place = [*parents, *last.split("/")]
        if last in at_place(schema, parents):
            return ".".join(place)
    siblings = list(at_place(schema, parents))
    found = (
        next((each for each in siblings if each.startswith(f"{last}_")), "")
        or _of_that_meaning(last, siblings)
        or _other_name(schema, last)
    )
    if found:
        return found if "." in found else ".".join([*parents, found])
    if parents and siblings:
        near = nearest(last, siblings)
        return _below(schema, place) or (near and ".".join([*parents, near]))
    return next(iter(fields_called(schema, last)), "") or nearest(last, siblings)


def fields_called(schema: Mapping[str, Any], name: str) -> list[str]:
    """Returns the paths of all fields with a name, with or without a unit.

    Fields of the run come first, then those of the source, the robot and obstacles.
    """
    found = [
        path
        for path in leaf_paths(schema)
        if path[-1] == name or path[-1].startswith(f"{name}_")
    ]

    def rank(path: Sequence[str]) -> tuple[int, int]:
        usual = _USUAL.index(path[0]) if path[0] in _USUAL else len(_USUAL)
        return 0 if len(path) == 1 else 1 + usual, len(path)

    return [".".join(path) for path in sorted(found, key=rank)]


def _of_that_meaning(name: str, siblings: Iterable[str]) -> str:
    """Finds a field of the same group with the same meaning, whatever its unit."""
    first, _, rest = name.casefold().partition("_")
    for alike in _SAME_THING:
        for field in siblings if first in alike else ():
            other, _, more = field.casefold().partition("_")
            if other in alike and (alike not in _LIMITS or more.startswith(rest)):
                return field
    return ""


def _other_name(schema: Mapping[str, Any], name: str) -> str:
    path = _OTHER_NAMES.get(name.casefold(), "")
    return path if path.partition(".")[0] in schema.get("properties", {}) else ""


def _below(schema: Mapping[str, Any], place: Sequence[str]) -> str:
    """Finds a field in a lower group with this name, or with this name and a unit."""
    *parents, name = place
    below = [
        (*parents, *path)
        for path in leaf_paths(schema, parents)
        if path[-1] == name or path[-1].startswith(f"{name}_")
    ]
    return min(map(".".join, below), key=len, default="")
