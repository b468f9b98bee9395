"""Whether the law's push holds P before one body: the blocks' own force.

With exact nearest points a small body is never a local minimum: P slips off to
the side. A cone reports a range without a direction, so that the push turns with
the robot; stepping aside, the robot turns, and the push brings it back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from diagrams import Scenario
from studies.nonlinear.equilibrium_maps import BOX_M, BOX_X_M, TO_GO_M, boxes_scenario
from studies.nonlinear.head_on import head_on
from systems.framework.input_error import InputError
from systems.laws.impedance_controller import attraction_force, repulsion_force
from systems.ranging.collision_vector import collision_vectors, echo_points
from systems.ranging.ideal_obstacle_sensor import nearest_vectors
from systems.ranging.ultrasonic_array import cone_ranges
from systems.world.geometry import control_point, rotate

#: Extents of the bodies, m: 1 nm stands for a point.
_BODIES_M = {"point": (1e-9, 1e-9), "face": BOX_M}


@dataclass(frozen=True)
class TrapStiffness:
    """What a small sideways step does at the equilibrium before one body."""

    sensing: str
    """``exact`` or ``cones``."""
    body: str
    """``point``, or ``face``: a printed box whose face looks at the robot."""
    equilibrium_m: float
    """Clearance of P, m."""
    along_n_m: float
    """-dF/dx along the line, N/m; positive: P returns."""
    across_n_m: float
    """-dF/dy across it, N/m. The heading turns with P, by dy / epsilon."""

    @property
    def trap(self) -> bool:
        """Whether P returns from any small step."""
        return self.along_n_m > 0.0 and self.across_n_m > 0.0

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return {**vars(self), "trap": self.trap}


def trap_stiffness(
    scenario: Scenario, sensing: str, body: str = "point"
) -> TrapStiffness:
    """Stiffness of the blocks' own force at the equilibrium before one body.

    P is on the line to the source, the body straight ahead. The hand-position
    law turns the robot by dy/epsilon where P steps aside by dy.

    Args:
        scenario: Law and gains.
        sensing: ``exact`` or ``cones``.
        body: ``point`` or ``face``.

    Returns:
        Along the line and across it, N/m; positive: P returns.

    Raises:
        InputError: The law is not known.
        InputError: The law does not hold P before the body, or a word is
            unknown.
    """
    if sensing not in ("exact", "cones"):
        raise InputError("sensing", f"{sensing!r} is neither 'exact' nor 'cones'")
    if body not in _BODIES_M:
        raise InputError("body", f"{body!r} is neither 'point' nor 'face'")
    size = _BODIES_M[body]
    case = boxes_scenario(scenario, [(BOX_X_M, 0.0)], "cones", size)
    contact = head_on(case, to_go_m=TO_GO_M + 0.5 * size[0])
    c, step = contact.equilibrium_m, 1e-4
    x = BOX_X_M - 0.5 * size[0] - c
    law, epsilon = contact.law.function, scenario.only.robot.control_point_m

    def force(dx: float, dy: float) -> tuple[float, float]:
        return _block_force(case, law, (x + dx, dy, dy / epsilon), sensing)

    return TrapStiffness(
        sensing=sensing,
        body=body,
        equilibrium_m=c,
        along_n_m=-(force(step, 0.0)[0] - force(-step, 0.0)[0]) / (2.0 * step),
        across_n_m=-(force(0.0, step)[1] - force(0.0, -step)[1]) / (2.0 * step),
    )


def _block_force(
    case: Scenario, law: Any, place: tuple[float, float, float], sensing: str
) -> tuple[float, float]:
    """Sum of the forces at rest by the blocks' functions, N in W.

    The place is x and y of P, and the heading.
    """
    x, y, theta = place
    offset = case.only.robot.control_point_m
    pose = (x - offset * math.cos(theta), y - offset * math.sin(theta), theta)
    around = case.bodies().values()
    bodies = [row for body in around for row in body.rectangles(0.0)]
    if sensing == "exact":
        vectors = nearest_vectors(
            pose,
            bodies,
            range(len(bodies)),
            offset,
            case.follower.ultrasonic.maximum_range_m,
            1,
        )
    else:
        ranges = cone_ranges(
            np.array(pose), np.array(bodies), case.follower.ultrasonic, offset
        )
        echo = ranges <= case.follower.ultrasonic.maximum_range_m
        points = echo_points(ranges.tolist(), echo.tolist(), case.follower.ultrasonic)
        vectors = collision_vectors(
            points, case.follower.collision_vector, case.follower.ultrasonic.neighbors
        )
    p_WP, p_WS = control_point(pose, offset), case.source.path().pose(0.0)[:2]
    F_m = attraction_force(
        p_WP, (0.0, 0.0), p_WS, 1.0, case.follower.attraction, case.only.robot.mass_kg
    )
    pushes = [repulsion_force(rotate(theta, x, y), 0.0, law) for _, x, y in vectors]
    F_b = np.sum(pushes or [(0.0, 0.0)], axis=0)
    return float(F_m[0] + F_b[0]), float(F_m[1] + F_b[1])
