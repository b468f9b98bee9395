"""The stability report, which gathers models, margins, certificates and verdicts."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.stability.law_analysis import LawAnalysis, analyse_law
    from analysis.stability.model_sheet import model_sheet
    from analysis.stability.recommended_gains import RecommendedGains, recommend_gains
    from analysis.stability.report_files import (
        stability_document,
        stability_text,
        write_stability,
    )
    from analysis.stability.report_parts import parts
    from analysis.stability.verdicts import Verdict, judge
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "LawAnalysis",
    "RecommendedGains",
    "Verdict",
    "analyse_law",
    "judge",
    "model_sheet",
    "parts",
    "recommend_gains",
    "stability_document",
    "stability_text",
    "write_stability",
]
