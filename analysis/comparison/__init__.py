"""Laws side by side on the same layouts, and the papers' claims judged."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.comparison.claims import CLAIMS, claims_table
    from analysis.comparison.compare import (
        prepare_comparison,
    )
    from analysis.comparison.laws_in_pairs import compare_runs
    from analysis.comparison.mechanisms import failure_mechanisms
    from analysis.comparison.paired_statistics import paired_median, paired_rate
    from analysis.comparison.plans import EXPERIMENTS, comparison_plan, library_layouts
    from analysis.comparison.report import compare_summary, write_comparison
    from analysis.comparison.report_text import compare_text
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "CLAIMS",
    "EXPERIMENTS",
    "claims_table",
    "compare_runs",
    "compare_summary",
    "compare_text",
    "comparison_plan",
    "failure_mechanisms",
    "library_layouts",
    "paired_median",
    "paired_rate",
    "prepare_comparison",
    "write_comparison",
]
