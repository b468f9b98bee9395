"""What the robot knows to be free, and the guard that keeps it there."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.safety.braking import can_be_braked
    from systems.safety.free_space import FreeSpace
    from systems.safety.free_space_map import FreeSpaceMap
    from systems.safety.motion_guard import MotionGuard
    from systems.safety.parameters import FreeSpaceParameters, GuardParameters
    from systems.safety.sensing_monitor import SensingMonitor
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "FreeSpace",
    "FreeSpaceMap",
    "FreeSpaceParameters",
    "GuardParameters",
    "MotionGuard",
    "SensingMonitor",
    "can_be_braked",
]
