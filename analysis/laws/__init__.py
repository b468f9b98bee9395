"""Laws as force over distance: curves, push and pull, the head-on approach."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.laws.head_on import HeadOn, head_on
    from analysis.laws.law_curves import LawCurves, law_curves
    from analysis.laws.push_and_pull import net_barrier, rest_offset
    from analysis.laws.radial_law import RadialLaw, radial_law
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "HeadOn",
    "LawCurves",
    "RadialLaw",
    "head_on",
    "law_curves",
    "net_barrier",
    "radial_law",
    "rest_offset",
]
