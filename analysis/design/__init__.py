"""Gains from requirements."""

from analysis.design.attraction_search import search_attraction
from analysis.design.design_study import DesignStudy, study_design
from analysis.design.gain_search import search_gains
from analysis.design.requirements import DesignRequirements, LawDesign, check_law

__all__ = [
    "DesignRequirements",
    "DesignStudy",
    "LawDesign",
    "check_law",
    "search_attraction",
    "search_gains",
    "study_design",
]
