"""A finished run as its scenario and its table, for example loaded from files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.loading import load_scenario
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import pandas as pd

    from diagrams.running.run_result import RunResult

SCENARIO_FILE, TABLE_FILE = "scenario.yaml", "trajectory.parquet"
#: Columns that every table must have.
_NEEDED = (
    *("t", "p_WB_x", "p_WB_y", "theta_WB"),
    *("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"),
    *("p_WS_x", "p_WS_y", "theta_WS", "v_WB_x", "v_WB_y", "omega_WB"),
)


@dataclass(frozen=True)
class RecordedRun:
    """Scenario and table of a finished run, for the export to other programs."""

    scenario: Scenario
    """The whole scenario, with all robots."""
    table: pd.DataFrame
    """Table of the run, from ``RunResult.trajectory``."""

    @classmethod
    def of(cls, result: RunResult) -> RecordedRun:
        """Makes a recorded run from the result of a run."""
        return cls(result.full_scenario, result.trajectory)

    @classmethod
    def load(cls, directory: str | Path) -> RecordedRun:
        """Loads a recorded run from the result directory of ``phonotaxis simulate``.

        Raises InputError if the files are missing or do not belong together.
        """
        folder = Path(directory)
        for name in (SCENARIO_FILE, TABLE_FILE):
            if not _is_file(folder / name):
                raise InputError(
                    "result",
                    f"{str(folder)!r} has no {name}; give the result directory of a "
                    "run of phonotaxis simulate",
                )
        scenario = load_scenario(folder / SCENARIO_FILE)
        run = cls(scenario, _read(folder / TABLE_FILE))
        for name, own in run.robots.items():
            if missing := [key for key in _NEEDED if key not in own]:
                raise InputError(
                    "result",
                    f"{str(folder / TABLE_FILE)!r} has no {missing[0]} of "
                    f"{name}, which a run of {SCENARIO_FILE} has; run again",
                )
        return run

    @cached_property
    def robots(self) -> dict[str, Mapping[str, NDArray[np.float64]]]:
        """Columns of each robot, by name of the robot.

        Each value is a mapping from names of columns to (n,) arrays. The names do not
        begin with the name of the robot.
        """
        names = list(self.scenario.robots)
        columns = {
            str(name): self.table[name].to_numpy(dtype=float) for name in self.table
        }
        if len(names) == 1:
            return {names[0]: columns}
        return {name: _own(columns, f"{name}.") for name in names}

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) times of the ticks (control periods), s."""
        return next(iter(self.robots.values()))["t"]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # the name is not valid for a file
        return False


def _read(path: Path) -> pd.DataFrame:
    import pandas as pd
    from pyarrow import ArrowException

    try:
        return pd.read_parquet(path)
    except (OSError, ArrowException, ValueError) as error:
        raise InputError(
            "result", f"{str(path)!r} cannot be read ({error}); run again"
        ) from None


def _own(
    columns: Mapping[str, NDArray[np.float64]], prefix: str
) -> Mapping[str, NDArray[np.float64]]:
    own = {
        key.removeprefix(prefix): values
        for key, values in columns.items()
        if key.startswith(prefix)
    }
    return {"t": columns["t"], **own} if "t" in columns else own
