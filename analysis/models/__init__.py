"""The loop as equations: operating points, linear models, point masses."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.models.equilibria import find_equilibria, follow_equilibrium
    from analysis.models.force_field import ForceField
    from analysis.models.ideal_loop import IdealLoop, ideal_loop
    from analysis.models.linear_models import LinearModel, Mode
    from analysis.models.linearisation import (
        check_gradient,
        compare_routes,
        continuous_model,
        sampled_model,
    )
    from analysis.models.model_export import write_models
    from analysis.models.open_loops import open_loop, target_loop
    from analysis.models.operating_points import (
        OperatingPoint,
        moving_equilibrium,
        resting_equilibrium,
    )
    from analysis.models.point_mass import PointMass, point_mass
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "ForceField",
    "IdealLoop",
    "LinearModel",
    "Mode",
    "OperatingPoint",
    "PointMass",
    "check_gradient",
    "compare_routes",
    "continuous_model",
    "find_equilibria",
    "follow_equilibrium",
    "ideal_loop",
    "moving_equilibrium",
    "open_loop",
    "point_mass",
    "resting_equilibrium",
    "sampled_model",
    "target_loop",
    "write_models",
]
