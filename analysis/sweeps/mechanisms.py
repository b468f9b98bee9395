"""Causes of failed runs, derived by rules from the sensor data in a sweep's table."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.sweeps.run_rows import column
from diagrams.running.stop_rules import SUCCESSFUL

#: A body was out of sight if the time from its last echo to the contact is at least
#: this number of ticks. Then there was no echo at the last tick.
OUT_OF_SIGHT_TICKS = 1.5
#: A body was heard late if its first echo came less than this time before the contact,
#: s. At the top speed of 0.72 m/s, the robot travels 0.72 m in this time.
LATE_S = 1.0


def failure_mechanisms(rows: pd.DataFrame) -> pd.Series:
    """Determines why each failed run failed, as the name of a mechanism.

    The mechanism of a collision depends on the echoes of the body that the robot hit
    (docs/results_laws.md):

    - ``never heard``: The body returned no echo. It came from a direction outside the
      sensor cones.
    - ``out of sight``: The body returned echoes, but none at the last tick before the
      contact (tick = control period). The body had left the cones.
    - ``heard late``: The first echo came less than 1 s before the contact.
    - ``pushed too little``: The body returned echoes in time and up to the contact.

    The other failures have these mechanisms:

    - ``jam``: The robot never reached the goal. It got stuck, or the time ran out.
    - ``held off``: The robot reached the goal and got stuck later. The repulsion from
      the source itself kept the robot outside.
    - ``swings``: The robot reached the goal but did not come to rest there.
    - ``lost``: The robot lost the source.
    - ``astray``: The robot did not follow the moving source for long enough.
    - ``diverged``: The robot drove too far from the source.
    - ``no way found``: The control law reported that there is no path.
    - ``failed``: The run raised an error.

    Args:
        rows: Results of runs with sensor cones, from
            ``analysis.sweeps.store.load_results``, with an additional column ``tick_s``
            (control period, s).

    Returns:
        Name of the mechanism for each row. The name is missing if the run succeeded.
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
