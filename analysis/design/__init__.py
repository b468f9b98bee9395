"""Gains from requirements."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.design.attraction_search import search_attraction
    from analysis.design.design_study import DesignStudy, study_design
    from analysis.design.gain_search import search_gains
    from analysis.design.requirements import DesignRequirements, LawDesign, check_law
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "DesignRequirements",
    "DesignStudy",
    "LawDesign",
    "check_law",
    "search_attraction",
    "search_gains",
    "study_design",
]
