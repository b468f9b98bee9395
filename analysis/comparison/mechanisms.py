"""Why runs failed, from what the sensors knew: rules over a sweep's table."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.runs.run_table import column
from diagrams.running.stop_rules import SUCCESSFUL

#: A body without an echo for so many ticks before the contact was out of sight: none
#: at the last tick.
OUT_OF_SIGHT_TICKS = 1.5
#: A body first heard of so shortly before the contact was heard late, s: from top
#: speed at 0.72 m/s, less than 0.72 m.
LATE_S = 1.0


def failure_mechanisms(rows: pd.DataFrame) -> pd.Series:
    """Mechanism of each failed run; missing where a run succeeded.

    Of collisions, by the echoes of the body that was hit (docs/results_laws.md):

    - ``never heard``: there was none, the body came from where no cone looks;
    - ``out of sight``: there was none any more at the last tick, the body had left
      the cones for the side of the bar;
    - ``heard late``: the first one was less than 1 s before the contact;
    - ``pushed too little``: heard in time and to the end.

    Of the others: ``jam`` (stuck, or out of time, without ever having come into the
    goal), ``held off`` (stuck after it came: the push off the source itself keeps
    it outside), ``swings`` (unsettled: it came, and did not come to rest there),
    ``lost``, ``astray`` and ``diverged`` (the source), ``no way found`` (as the law
    says), ``failed`` (an error).

    Args:
        rows: Of ``analysis.sweeps.store.load_results``, with cones, and each run's
            ``tick_s``.
    """
    cause = rows["cause"].astype("object")
    names = cause.where(~cause.isin(SUCCESSFUL))
    names = names.replace({"stuck": "jam", "timeout": "jam", "unsettled": "swings"})
    came = np.isfinite(column(rows, "time_to_goal_s"))
    names = names.mask((cause == "stuck") & came, "held off")
    hits = cause == "collision"
    warning, unseen = rows["contact_warning_s"], rows["contact_unseen_s"]
    names = names.mask(hits, "pushed too little")
    names = names.mask(hits & (warning < LATE_S), "heard late")
    out_of_sight = unseen >= OUT_OF_SIGHT_TICKS * rows["tick_s"]
    names = names.mask(hits & out_of_sight, "out of sight")
    return names.mask(hits & warning.isna(), "never heard")
