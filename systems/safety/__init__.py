"""What the robot knows to be free, and the guard that keeps it there."""

from systems.safety.braking import can_be_braked
from systems.safety.free_space import FreeSpace
from systems.safety.free_space_map import FreeSpaceMap, FreeSpaceParameters
from systems.safety.motion_guard import GuardParameters, MotionGuard
from systems.safety.sensing_monitor import SensingMonitor

__all__ = [
    "FreeSpace",
    "FreeSpaceMap",
    "FreeSpaceParameters",
    "GuardParameters",
    "MotionGuard",
    "SensingMonitor",
    "can_be_braked",
]
