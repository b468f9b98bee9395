"""What pulls, pushes and commands a robot, as arrows over it in a replay."""

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

#: Arrows are recorded so often; a browser interpolates, 1/s.
ARROWS_PER_S = 8.0
#: Length of the greatest force, and of the shortest arrow, m.
LONGEST_M, SHORTEST_M = 0.8, 1e-3
#: Over the microphones, m.
HEIGHT_M = 0.36
#: Half widths of shaft and head, m, and where the head begins on an arrow of 1 m.
SHAFT_M, HEAD_M, NECK = 0.02, 0.055, 0.75


class Arrow(NamedTuple):
    """An arrow that begins at P."""

    name: str
    """attraction, repulsion, or law."""
    vectors: NDArray[np.float64]
    """(n, 2) in W at the ticks: N of forces, m/s of law."""
    m_per_unit: float
    """Length of the arrow for 1 of the unit, m."""


def scale_m_n(result: RunResult) -> float | None:
    """Length of 1 N, so that the greatest force of a run is seen whole, m.

    Args:
        result: The run of one robot, or of several.

    Returns:
        One of 1, 2, 5 times a power of ten, m; none where no law tells forces.
    """
    sizes = [
        np.hypot(*own.vector(name))
        for own in result.robots.values()
        if "attraction_x" in own.columns
        for name in ("attraction", "repulsion")
    ]
    if not sizes:
        return None
    # A moment of contact must not shrink all else.
    greatest = max(float(np.percentile(np.concatenate(sizes), 99.0)), 1e-3)
    power = 10.0 ** np.floor(np.log10(LONGEST_M / greatest))
    return float(max(k * power for k in (1, 2, 5) if k * power * greatest <= LONGEST_M))


def arrows(own: RunResult, m_per_n: float | None) -> list[Arrow]:
    """The arrows of one robot.

    Forces, where its law tells them, and the velocity of P that its wheels are told to
    give it, as far as it would get in a second.

    Args:
        own: The run of that robot.
        m_per_n: Length of 1 N, m, from ``scale_m_n`` of the whole run.

    Returns:
        One to three.
    """
    found = []
    if m_per_n is not None and "attraction_x" in own.columns:
        found = [
            Arrow(name, own.vector(name).T, m_per_n)
            for name in ("attraction", "repulsion")
        ]
    return [*found, Arrow("law", _commanded(own), 1.0)]


def _commanded(own: RunResult) -> NDArray[np.float64]:
    """(n, 2) velocity of P in W that the commanded wheel speeds would give, m/s."""
    robot, theta = own.scenario.only.robot, own.columns["theta_WB"]
    left = robot.wheel_radius_m * own.columns["wheel_speed_left"]
    right = robot.wheel_radius_m * own.columns["wheel_speed_right"]
    aside = robot.control_point_m * (right - left) / robot.wheel_separation_m
    return np.column_stack(rotate(theta, 0.5 * (left + right), aside))


def record_arrows(
    meshcat: Meshcat, own: RunResult, path: str, m_per_n: float | None
) -> None:
    """Records the arrows of one robot, flat over it.

    Args:
        meshcat: Records already.
        own: The run of that robot.
        path: Of the robot in Meshcat's tree; arrows are at ``forces/`` and ``law/``
            and this.
        m_per_n: Length of 1 N, m, from ``scale_m_n`` of the whole run.
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
        # No two in one plane, which would flicker.
        height = HEIGHT_M + 0.004 * number
        for time, p, v, length in zip(times, places, vectors, lengths, strict=True):
            # An arrow without length keeps its direction, and does not spin.
            if length > SHORTEST_M:
                yaw = float(np.arctan2(v[1], v[0]))
            spot: Any = np.array([*p, height])  # untyped: Drake's stubs take it amiss
            pose = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), spot)
            meshcat.SetTransform(place, pose, float(time))
            wide = min(1.0, float(length) / 0.3)
            scale = [float(length), wide, 1.0]
            meshcat.SetProperty(f"{place}/arrow", "scale", scale, float(time))


def arrow_path(robot: str, name: str) -> str:
    """Where an arrow of a robot is in Meshcat's tree.

    Args:
        robot: Path of the robot there.
        name: Of the arrow.

    Returns:
        Path without a slash in front.
    """
    return f"law/{robot}" if name == "law" else f"forces/{robot}/{name}"


def _add(meshcat: Meshcat, path: str, colour: str) -> None:
    """An arrow of 1 m along x."""
    x = [0.0, NECK, NECK, 0.0, NECK, 1.0, NECK]
    y = [-SHAFT_M, -SHAFT_M, SHAFT_M, SHAFT_M, -HEAD_M, 0.0, HEAD_M]
    vertices: Any = np.asfortranarray(np.vstack([x, y, np.zeros(7)]))
    faces: Any = np.asfortranarray([[0, 0, 4], [1, 2, 5], [2, 3, 6]], dtype=np.int32)
    meshcat.SetTriangleMesh(f"{path}/arrow", vertices, faces, Rgba(*to_rgb(colour)))
