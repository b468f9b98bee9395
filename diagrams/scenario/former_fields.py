"""Accepts fields of the previous version, and states what has replaced them.

The file ``former_fields.tsv`` lists the fields of the previous version. For a renamed
field, it states the new path. For a field that has become a constant, it states the
value and the place of the constant. For a field without any effect now, it states why.
"""

from __future__ import annotations

import csv
import json
import logging
import re
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from diagrams.scenario.participants import KINDS, kind_of
from diagrams.scenario.shorthand import ROBOT_FIELDS
from systems.framework.input_error import InputError
from systems.laws.catalog import LAWS

_LOGGER = logging.getLogger("phonotaxis")
_TABLE = Path(__file__).with_suffix(".tsv")
#: Names of sensor elements in the lists of faults of the previous version.
_ELEMENTS = {"microphone", "sensor", "switch"}
#: Kind of a fault that states none, by group of the previous version.
_FAULTS = {
    "microphones": "dead",
    "ultrasonic": "silent",
    "gas_sensors": "dead",
    "contact_switches": "stuck_open",
}
#: Beginning of a path to a field of one robot.
_PREFIX = re.compile(r"^(?:robots\.[^.]+\.)?")
_MISSING = object()


class _Former(NamedTuple):
    path: str
    new: str
    """New path; empty: the field is a constant now, or has no effect."""
    value: Any
    """Value of the constant; ``_MISSING``: the field has no effect, whatever its
    value."""
    place: str
    """File and name of the constant, or why the field has no effect."""


@cache
def former_fields() -> tuple[_Former, ...]:
    """The fields of the previous version that have a new name or are constants now."""
    with _TABLE.open(encoding="utf-8", newline="") as file:
        return tuple(
            _Former(path, new, json.loads(value) if value else _MISSING, place)
            for path, new, value, place in csv.reader(file, delimiter="\t")
        )


def renewed(data: dict[str, Any], law: Any = None) -> dict[str, Any]:
    """Replaces fields of the previous version, and prints a note for the user.

    The previous version saved all groups of fields for every kind of robot. If the data
    contain former fields, the function therefore also removes groups that the robots do
    not have.

    Args:
        data: Fields of a scenario, changed in place.
        law: Law that will replace the law of all robots. None: the laws in the data.

    Returns:
        The same data.

    Raises:
        InputError: A field has become a constant, but its value in the data differs
            from the constant.
    """
    notes: dict[str, None] = {}
    for where, fields in _robots_and_sources(data):
        own_law = law or fields.get("law", data.get("law"))
        notes |= dict.fromkeys(_renewed(where, fields, own_law))
    if notes:
        _drop_groups_of_other_kinds(data)
        _LOGGER.warning("fields of the previous version: %s", "; ".join(notes))
    return data


@lru_cache(maxsize=1024)
def renamed(path: str) -> str:
    """Returns the present path of a field, given the dotted path that a user wrote.

    If the field had another name in the previous version, the function prints a note.
    """
    new = path
    for former in former_fields():
        for begin in _PREFIX.findall(new):
            rest = new.removeprefix(begin)
            if former.new and f"{rest}.".startswith(f"{former.path}."):
                new = f"{begin}{former.new}{rest.removeprefix(former.path)}"
    if new != path:
        _LOGGER.warning("field of the previous version: %s is now %s", path, new)
    return new


def is_constant_now(path: str, value: Any) -> bool:
    """Whether a field has become a constant with the value that a user has given.

    The result is also True if a former field has no effect any more. The result is
    False if no constant has replaced the field at the dotted path ``path``. If the
    constant has another value, the function raises an ``InputError``.
    """
    begin = _PREFIX.match(path)
    own = path[begin.end() :] if begin else path
    if own.startswith("repulsion."):
        own = f"laws.{own.removeprefix('repulsion.')}"
    former = next((each for each in former_fields() if each.path == own), None)
    if former is None or former.new:
        return False
    if former.value is _MISSING:
        _LOGGER.warning("field of the previous version: %s", _without_effect(former))
        return True
    if value != former.value:
        raise InputError(
            path,
            f"is {value!r}, but this is no longer a field; {constant_now(own)}; leave "
            "it out",
        )
    return True


def constant_now(path: str) -> str:
    """Returns the constant that has replaced a field of the previous version.

    ``path`` is the dotted path of the field. The result is the place and value of the
    constant in words, or why the field has no effect. It is an empty text if the field
    is no former field, or has a new name.
    """
    for former in former_fields():
        if former.path == path and not former.new:
            if former.value is _MISSING:
                return f"it has no effect: {former.place}"
            return f"it is now the constant {former.place} = {former.value!r}"
    return ""


def _robots_and_sources(data: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    yield "", data
    for group in ("robots", "sources"):
        named = data.get(group)
        for name, own in named.items() if isinstance(named, dict) else ():
            if isinstance(own, dict):
                yield f"{group}.{name}.", own


def _renewed(where: str, fields: dict[str, Any], law: Any) -> Iterator[str]:
    _renew_safety_filter(fields)
    _renew_rounding(fields)
    _renew_gaps(fields)
    _renew_band(fields)
    for former in former_fields():
        path = former.path
        if where.startswith("sources."):
            if not path.startswith("source."):
                continue
            path = path.removeprefix("source.")
        value = _taken(fields, path.split("."))
        if value is _MISSING:
            continue
        if former.new.startswith("guard.") and not _has_guard(fields, law):
            yield f"{where}{path} has no effect without a guard"
        elif former.new.startswith("impedance.") and path.split(".")[1] != law:
            yield f"{where}{path} has no effect with law {law!r}"
        elif former.new:
            _put(fields, former.new.split("."), value)
            yield f"{where}{path} is now {former.new}"
        elif former.value is _MISSING:
            yield f"{where}{_without_effect(former)}"
        elif value != former.value:
            raise InputError(
                f"{where}{path}",
                f"is {value!r}, but this is no longer a field; "
                f"{constant_now(former.path)}; remove it",
            )
        else:
            yield f"{where}{path} is now a constant"
    yield from _renewed_faults(where, fields)


def _without_effect(former: _Former) -> str:
    return f"{former.path} has no effect: {former.place}"


def _renew_safety_filter(fields: Mapping[str, Any]) -> None:
    """Replaces a group or null by true or false, for the filter of the adaptive law."""
    for laws in (fields.get("repulsion"), fields.get("laws")):
        adaptive = laws.get("trajectory_adaptive") if isinstance(laws, dict) else None
        if isinstance(adaptive, dict) and "safety_filter" in adaptive:
            given = adaptive["safety_filter"]
            adaptive["safety_filter"] = given is not None and given is not False


def _renew_rounding(fields: dict[str, Any]) -> None:
    """Replaces encoders that do not round angles by encoders without pulses."""
    odometry = fields.get("odometry")
    if isinstance(odometry, dict) and odometry.get("rounding") is False:
        fields["odometry"] = {**odometry, "pulses_per_revolution": None}
        del fields["odometry"]["rounding"]


def _renew_gaps(fields: dict[str, Any]) -> None:
    """Replaces ideal hearing without gaps by hearing ``ideal_always``."""
    ideal = fields.get("ideal_hearing")
    if isinstance(ideal, dict) and ideal.get("burst_gaps") is False:
        fields["ideal_hearing"] = {**ideal, "burst_gaps": True}
        if fields.get("hearing") == "ideal":
            fields["hearing"] = "ideal_always"


def _renew_band(fields: dict[str, Any]) -> None:
    """Replaces the ends of the estimator's band by one field."""
    tdoa = fields.get("tdoa")
    if not isinstance(tdoa, dict) or "band_hz" in tdoa:
        return
    ends = [tdoa.get("low_hz", 300.0), tdoa.get("high_hz", 15_000.0)]
    kept = {name: v for name, v in tdoa.items() if name not in ("low_hz", "high_hz")}
    if kept.get("band") == "found":
        fields["tdoa"] = {**kept, "band": "set", "band_hz": "found"}
    elif ends != [300.0, 15_000.0]:
        fields["tdoa"] = {**kept, "band": "set", "band_hz": ends}


def _renewed_faults(where: str, fields: dict[str, Any]) -> Iterator[str]:
    """Collects the faults of all sensors in one list."""
    for group, kind in _FAULTS.items():
        faults = _taken(fields, [group, "faults"])
        if isinstance(faults, list):
            found = [_fault(group, kind, each) for each in faults]
            fields.setdefault("faults", []).extend(found)
            yield f"{where}{group}.faults is now faults"
    lost_at_s = _taken(fields, ["odometry", "lost_at_s"])
    if lost_at_s is not _MISSING:
        if lost_at_s is not None:
            lost = {"sensor": "odometry", "kind": "lost", "start_s": lost_at_s}
            fields.setdefault("faults", []).append(lost)
        yield f"{where}odometry.lost_at_s is now one of faults"


def _has_guard(fields: Mapping[str, Any], law: Any) -> bool:
    known = LAWS.get(str(law))
    return fields.get("guard") is not None or (known is not None and known.guarded)


def _fault(group: str, kind: str, fault: Any) -> Any:
    if not isinstance(fault, Mapping):
        return fault
    new = {"sensor": group, "number": 1, "kind": kind}
    new |= {("number" if key in _ELEMENTS else key): v for key, v in fault.items()}
    if (group, new["kind"]) == ("gas_sensors", "stuck"):
        new["kind"] = "frozen"
    return new


def _taken(fields: dict[str, Any], path: list[str]) -> Any:
    """Removes a field and all groups that become empty; returns the field's value."""
    first, *rest = path
    if first not in fields:
        return _MISSING
    if not rest:
        return fields.pop(first)
    below = fields[first]
    if not isinstance(below, dict):
        return _MISSING
    value = _taken(below, rest)
    if value is not _MISSING and not below:
        del fields[first]
    return value


def _put(fields: dict[str, Any], path: list[str], value: Any) -> None:
    *groups, last = path
    for group in groups:
        below = fields.get(group)
        if below is None:
            below = fields[group] = {}
        elif not isinstance(below, dict):
            return
        fields = below
    if isinstance(value, dict) and isinstance(fields.get(last), dict):
        value = {**value, **fields[last]}
    fields.setdefault(last, value)
    if isinstance(value, dict):
        fields[last] = value


def _drop_groups_of_other_kinds(data: dict[str, Any]) -> None:
    robots = data.get("robots")
    named = robots if isinstance(robots, dict) and robots else {"": {}}
    kinds = {}
    for name, own in named.items():
        if isinstance(own, dict):
            kinds[name] = kind_of({**data, **own})
            for field in [*own]:
                if (
                    field in ROBOT_FIELDS
                    and field not in KINDS[kinds[name]].model_fields
                ):
                    del own[field]
    for field in [*data]:
        if field in ROBOT_FIELDS and not set(ROBOT_FIELDS[field]) & {*kinds.values()}:
            del data[field]
