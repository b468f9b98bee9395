"""What linear models tell: margins, delay, sampling, bursts, contact, robustness."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.linear.burst_cycle import BurstCycle, burst_cycle
    from analysis.linear.burst_gaps import gap_chart
    from analysis.linear.contact_mode import contact_limits, largest_contact_stiffness
    from analysis.linear.delay_margin import DelayMargin, delay_margin
    from analysis.linear.delayed_run import check_delay_margin
    from analysis.linear.gang_of_four import gang_of_four
    from analysis.linear.loop_margins import LoopMargins, all_margins, loop_margins
    from analysis.linear.robustness import pole_cloud
    from analysis.linear.root_locus import root_loci
    from analysis.linear.sampled_stability import gain_chart, poles_against_period
    from analysis.linear.step_response import check_step
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "BurstCycle",
    "DelayMargin",
    "LoopMargins",
    "all_margins",
    "burst_cycle",
    "check_delay_margin",
    "check_step",
    "contact_limits",
    "delay_margin",
    "gain_chart",
    "gang_of_four",
    "gap_chart",
    "largest_contact_stiffness",
    "loop_margins",
    "pole_cloud",
    "poles_against_period",
    "root_loci",
]
