"""Many scenarios, in many processes, into one table."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.sweeps.distributions import Distribution
    from analysis.sweeps.plan import SweepPlan, SweepPoint, dump_plan, load_sweep
    from analysis.sweeps.store import load_results
    from analysis.sweeps.summary import sweep_summary, sweep_text
    from analysis.sweeps.sweep import PreparedSweep, prepare_sweep, run_sweep
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "Distribution",
    "PreparedSweep",
    "SweepPlan",
    "SweepPoint",
    "dump_plan",
    "load_results",
    "load_sweep",
    "prepare_sweep",
    "run_sweep",
    "sweep_summary",
    "sweep_text",
]
