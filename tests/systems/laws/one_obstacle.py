"""State and inputs of a controller that follows a target beside one obstacle."""

from __future__ import annotations

from typing import Any

#: One tick ago, the obstacle was at (0.81, 0.02): it moves at about 9 m/s.
ONE_OBSTACLE: dict[str, Any] = {
    "state": [2.0, 0.81, 0.02, 0, 0, 0, 0, 0, 0],
    "p_WS_estimated": [2.0, 0.4],
    "target_valid": [1.0],
    "collision_vectors_B": [0.6, 0.1, 0, 0, 0, 0],
    "features": [2.0, 0, 0],
    "pose_WB_estimated": [-0.1, 0.1, 0.2],
    "v_WP": [0.3, -0.1],
}
