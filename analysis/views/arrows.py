"""Shows the forces on a robot and its commanded motion as arrows in a replay."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RollPitchYaw

from analysis.reporting.palette import COLOURS
from diagrams import RunResult
from systems.world.geometry import rotate

#: Rate at which arrows are recorded, 1/s. The browser interpolates between these times.
ARROWS_PER_S = 8.0
#: Lengths of arrows, m. ``LONGEST_M``: arrow of the greatest force.
#: ``SHORTEST_M``: shortest arrow.
LONGEST_M, SHORTEST_M = 0.8, 1e-3
#: Height of the arrows, m. They are above the microphones.
HEIGHT_M = 0.36
#: Shape of an arrow. ``SHAFT_M``: half of the width of the shaft, m. ``HEAD_M``: half
#: of the width of the head, m. ``NECK``: start of the head as a fraction of the length.
SHAFT_M, HEAD_M, NECK = 0.02, 0.055, 0.75


class Arrow(NamedTuple):
    """An arrow that starts at the control point P of a robot."""

    name: str
    """``attraction``, ``repulsion``, or ``law``. The arrow ``law`` shows the commanded
    velocity of the control point P."""
    vectors: NDArray[np.float64]
    """(n, 2) vectors in the world frame W at the ticks (control periods). The unit is N
    for forces, and m/s for the arrow ``law``."""
    m_per_unit: float
    """Length of the arrow per unit of its vector, m/N or s."""


def scale_m_n(result: RunResult) -> float | None:
    """Returns the length of an arrow for a force of 1 N.

    With this length, the arrow of the greatest force is at most 0.8 m long. The
    greatest force is the 99th percentile of all forces in the run. A short contact with
    a very large force therefore does not make all other arrows short.

    Args:
        result: Result of the run, for one robot or several robots.

    Returns:
        Length, m. The value is 1, 2 or 5 times a power of ten. It is None if no control
        law logs its forces.
    """
    sizes = [
        np.hypot(*own.vector(name))
        for own in result.robots.values()
        if "attraction_x" in own.columns
        for name in ("attraction", "repulsion")
    ]
    if not sizes:
        return None
    # A short contact must not make all other arrows short.
    greatest = max(float(np.percentile(np.concatenate(sizes), 99.0)), 1e-3)
    power = 10.0 ** np.floor(np.log10(LONGEST_M / greatest))
    return float(max(k * power for k in (1, 2, 5) if k * power * greatest <= LONGEST_M))


def arrows(own: RunResult, m_per_n: float | None) -> list[Arrow]:
    """Returns the arrows of one robot.

    If the control law logs its forces, two arrows show the attraction and the
    repulsion. One arrow shows the velocity of the control point P that the wheel
    commands would cause. Its length is the distance that P would move in 1 s.

    Args:
        own: Result of the run, for this robot.
        m_per_n: Length of an arrow for a force of 1 N, m, from ``scale_m_n`` of the
            whole run.

    Returns:
        One or three arrows.
    """
    found = []
    if m_per_n is not None and "attraction_x" in own.columns:
        found = [
            Arrow(name, own.vector(name).T, m_per_n)
            for name in ("attraction", "repulsion")
        ]
    return [*found, Arrow("law", _commanded(own), 1.0)]


def _commanded(own: RunResult) -> NDArray[np.float64]:
    """(n, 2) velocity of P in W that the wheel commands would cause, m/s."""
    robot, theta = own.scenario.only.robot, own.columns["theta_WB"]
    left = robot.wheel_radius_m * own.columns["wheel_speed_left"]
    right = robot.wheel_radius_m * own.columns["wheel_speed_right"]
    aside = robot.control_point_m * (right - left) / robot.wheel_separation_m
    return np.column_stack(rotate(theta, 0.5 * (left + right), aside))


def record_arrows(
    meshcat: Meshcat, own: RunResult, path: str, m_per_n: float | None
) -> None:
    """Records the arrows of one robot, as flat objects above the robot.

    Args:
        meshcat: Meshcat instance (Drake's 3D viewer) that is already recording.
        own: Result of the run, for this robot.
        path: Path of the robot in the scene tree of the 3D viewer. ``arrow_path``
            derives the paths of the arrows from this path.
        m_per_n: Length of an arrow for a force of 1 N, m, from ``scale_m_n`` of the
            whole run.
    """
    end = own.simulated_s
    times = np.unique([*np.arange(0.0, end, 1.0 / ARROWS_PER_S), end])
    ticks = np.abs(own.time[:, None] - times).argmin(axis=0)
    places = own.vector("p_WP").T[ticks]
    for number, arrow in enumerate(arrows(own, m_per_n)):
        place = arrow_path(path, arrow.name)
        _add(meshcat, place, COLOURS[arrow.name])
        vectors = arrow.m_per_unit * arrow.vectors[ticks]
        lengths = np.clip(np.hypot(*vectors.T), SHORTEST_M, 2.0 * LONGEST_M)
        yaw = 0.0
        # The arrows have different heights. Surfaces in one plane would flicker.
        height = HEIGHT_M + 0.004 * number
        for time, p, v, length in zip(times, places, vectors, lengths, strict=True):
            # An arrow without length keeps its direction.
            if length > SHORTEST_M:
                yaw = float(np.arctan2(v[1], v[0]))
            spot: Any = np.array([*p, height])  # Drake's type stubs reject arrays
            pose = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), spot)
            meshcat.SetTransform(place, pose, float(time))
            wide = min(1.0, float(length) / 0.3)
            scale = [float(length), wide, 1.0]
            meshcat.SetProperty(f"{place}/arrow", "scale", scale, float(time))


def arrow_path(robot: str, name: str) -> str:
    """Returns the path of an arrow in the scene tree of Meshcat (Drake's 3D viewer).

    Args:
        robot: Path of the robot in the scene tree.
        name: Name of the arrow.

    Returns:
        Path without a leading slash.
    """
    return f"law/{robot}" if name == "law" else f"forces/{robot}/{name}"


def _add(meshcat: Meshcat, path: str, colour: str) -> None:
    """Adds an arrow of 1 m length along x."""
    x = [0.0, NECK, NECK, 0.0, NECK, 1.0, NECK]
    y = [-SHAFT_M, -SHAFT_M, SHAFT_M, SHAFT_M, -HEAD_M, 0.0, HEAD_M]
    vertices: Any = np.asfortranarray(np.vstack([x, y, np.zeros(7)]))
    faces: Any = np.asfortranarray([[0, 0, 4], [1, 2, 5], [2, 3, 6]], dtype=np.int32)
    meshcat.SetTriangleMesh(f"{path}/arrow", vertices, faces, Rgba(*to_rgb(colour)))
