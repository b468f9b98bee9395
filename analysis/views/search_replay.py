"""Shows the plume, the phases and the radio of searches in a replay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform

from analysis.views.plume_history import plume_history
from diagrams import RunResult
from systems.odor.odor_plume import PUFF_SIZE, PUFFS_BEGIN
from systems.odor.parameters import CONTAINER_M

#: Display of the plume. ``_PERIOD_S``: interval between two displays, s. ``_DISCS``:
#: number of discs, from the source downwind.
_PERIOD_S, _DISCS = 0.5, 30
#: Difference between the distances of two discs from the source, m. Each disc shows the
#: puff that is nearest to its distance.
_APART_M = 0.15
#: Radius of a disc before scaling, m.
_RADIUS_M = 1.0
#: Height of the container, m.
_HEIGHT_M = 0.12
#: Height of the lamp above a robot, m.
_LAMP_M = 0.32
#: Color of the lamp for each state of the robot.
_LAMPS = {
    "rests": Rgba(0.6, 0.6, 0.6),
    "senses": Rgba(0.94, 0.89, 0.26),
    "moves": Rgba(0.0, 0.45, 0.7),
    "found": Rgba(0.0, 0.62, 0.45),
    "gave up": Rgba(0.84, 0.37, 0.0),
}
#: Duration of the flash for a radio frame, s.
_FLASH_S = 0.25


def record_switch(
    meshcat: Meshcat, path: str, times: Iterable[float], states: Iterable[bool]
) -> None:
    """Records the visibility of an object each time that it changes.

    The first state counts from 0 s on.

    Args:
        meshcat: Meshcat instance (Drake's 3D viewer) that is already recording.
        path: Path of the object in the scene tree of the 3D viewer.
        times: Times of the states, s.
        states: Whether the object is visible, for each time.
    """
    last: bool | None = None
    for time, state in zip(times, states, strict=True):
        if state != last:
            meshcat.SetProperty(
                path,
                "visible",
                value=bool(state),
                time_in_recording=0.0 if last is None else float(time),
            )
            last = state


def record_searches(
    meshcat: Meshcat, result: RunResult, paths: Mapping[str, str]
) -> None:
    """Records the objects that a search adds to a replay.

    The added objects are:

    - the container of the odor source
    - discs for puffs of the plume
    - a lamp above each searching robot
    - a white flash above a robot for each of its radio frames that the sink receives

    The sink is the computer of the operator. The lamp is gray while the robot rests,
    yellow while it senses or listens, and blue while it moves. It is green after the
    robot has found the source, and orange after it has given up.

    Args:
        meshcat: Meshcat instance (Drake's 3D viewer) that is already recording.
        result: Result of the run.
        paths: Paths of the robots in the scene tree of the 3D viewer, by name of the
            robot.
    """
    if result.full_scenario.odor is not None:
        _record_plume(meshcat, result)
    for name, own in result.robots.items():
        if own.scenario.only.searches is not None:
            _record_lamp(meshcat, own, f"{paths[name]}/lamp")
            frames = result.world.get(f"{name}.frames")
            if frames is not None:
                _record_flashes(meshcat, own, frames, f"{paths[name]}/radio")


def _placed(x: float, y: float, z: float) -> RigidTransform:
    place: Any = np.array([x, y, z])  # Drake's type stubs reject arrays
    return RigidTransform(place)


def _record_plume(meshcat: Meshcat, result: RunResult) -> None:
    odor = result.full_scenario.odor
    assert odor is not None
    x, y = odor.position_m
    box = Box(*CONTAINER_M, _HEIGHT_M)
    meshcat.SetObject("odor/container", box, Rgba(0.6, 0.2, 0.5))
    meshcat.SetTransform("odor/container", _placed(x, y, 0.5 * _HEIGHT_M))
    if odor.kind == "steady":
        return
    paths = [f"odor/puff_{k}" for k in range(_DISCS)]
    disc = Cylinder(_RADIUS_M, 0.002)
    for k, path in enumerate(paths):
        meshcat.SetObject(path, disc, Rgba(0.6, 0.2, 0.5, 0.5 - 0.4 * k / _DISCS))
    seen: list[list[bool]] = [[] for _ in paths]
    times = []
    for instant in plume_history(result.full_scenario, result.simulated_s):
        if round(instant.time_s / _PERIOD_S * 1000) % 1000:
            continue
        times.append(instant.time_s)
        count = int(instant.plume[2])
        end = PUFFS_BEGIN + PUFF_SIZE * count
        puffs = instant.plume[PUFFS_BEGIN:end].reshape(-1, PUFF_SIZE)
        away = np.hypot(puffs[:, 0] - x, puffs[:, 1] - y)
        for k, path in enumerate(paths):
            shown = _nearest(away, _APART_M * (k + 0.5))
            seen[k].append(shown is not None)
            if shown is not None:
                u, v = puffs[shown, :2]
                place = _placed(float(u), float(v), 0.004 + 0.0005 * k)
                meshcat.SetTransform(path, place, instant.time_s)
                size = float(puffs[shown, 4])
                meshcat.SetProperty(path, "scale", [size, size, 1.0], instant.time_s)
    for path, states in zip(paths, seen, strict=True):
        record_switch(meshcat, path, times, states)


def _nearest(away: NDArray[np.float64], distance: float) -> int | None:
    """Returns the number of the puff nearest to a given distance, or None.

    The value is None if no puff is within ``_APART_M`` of the distance.
    """
    if not len(away):
        return None
    k = int(np.abs(away - distance).argmin())
    return k if abs(away[k] - distance) < _APART_M else None


def _record_lamp(meshcat: Meshcat, own: RunResult, path: str) -> None:
    columns = own.columns
    over, moves = columns["search_ended"], columns["move"] > 0.5
    going = over < 0.5
    senses: NDArray[Any] = columns.get("listening", np.zeros_like(over)) > 0.5
    states = {
        "rests": going & ~moves & ~senses,
        "senses": going & senses,
        "moves": going & moves,
        "found": np.abs(over - 1.0) < 0.5,
        "gave up": over > 1.5,
    }
    for name, seen in states.items():
        lamp = f"{path}/{name}"
        meshcat.SetObject(lamp, Sphere(0.035), _LAMPS[name])
        meshcat.SetTransform(lamp, _placed(0.0, 0.0, _LAMP_M))
        record_switch(meshcat, lamp, own.time, seen)


def _record_flashes(
    meshcat: Meshcat, own: RunResult, frames: NDArray[np.float64], path: str
) -> None:
    meshcat.SetObject(path, Sphere(0.06), Rgba(1.0, 1.0, 1.0, 0.8))
    meshcat.SetTransform(path, _placed(0.0, 0.0, _LAMP_M + 0.09))
    heard = own.time[1:][np.diff(frames) > 0.5]
    since = np.searchsorted(heard, own.time, side="right")
    last = np.where(since > 0, np.r_[-1e9, heard][since], -1e9)
    record_switch(meshcat, path, own.time, own.time - last < _FLASH_S)
