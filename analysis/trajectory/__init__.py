"""Stability of robots on routes: frozen gains, adaptation, chains of robots."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.trajectory.adaptation_stability import (
        AdaptationStability,
        adaptation_stability,
    )
    from analysis.trajectory.chain_run import run_chain
    from analysis.trajectory.frozen_gains import FrozenPoint, frozen_gains, gain_bounds
    from analysis.trajectory.point_run import PointLoop, run_point
    from analysis.trajectory.robot_chain import RobotChain, robot_chain
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "AdaptationStability",
    "FrozenPoint",
    "PointLoop",
    "RobotChain",
    "adaptation_stability",
    "frozen_gains",
    "gain_bounds",
    "robot_chain",
    "run_chain",
    "run_point",
]
