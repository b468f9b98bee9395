"""What a run's directory keeps: its scenario, and what each robot did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diagrams import RunResult, Scenario, load_scenario
from systems.framework.input_error import InputError

__all__ = ["SCENARIO_FILE", "TABLE_FILE", "RecordedRun"]

SCENARIO_FILE, TABLE_FILE = "scenario.yaml", "trajectory.parquet"
#: Without these there is nothing to see.
_NEEDED = ("t", "p_WB_x", "p_WB_y", "theta_WB")


@dataclass(frozen=True)
class RecordedRun:
    """A run as another program gets it."""

    scenario: Scenario
    """The whole one."""
    robots: Mapping[str, Mapping[str, NDArray[np.float64]]]
    """(n,) columns by name, of each robot by name."""

    @classmethod
    def of(cls, result: RunResult) -> RecordedRun:
        """From a run that has just ended."""
        robots = {name: own.columns for name, own in result.robots.items()}
        return cls(result.full_scenario, robots)

    @classmethod
    def load(cls, directory: str | Path) -> RecordedRun:
        """From the result directory of ``phonotaxis simulate``.

        Raises:
            InputError: It is none, or its files do not belong together.
        """
        import pandas as pd
        from pyarrow import ArrowException

        folder = Path(directory)
        for name in (SCENARIO_FILE, TABLE_FILE):
            if not (folder / name).is_file():
                raise InputError(
                    "result",
                    f"{str(folder)!r} has no {name}; give the result directory of a "
                    "run, as phonotaxis simulate makes it",
                )
        scenario = load_scenario(folder / SCENARIO_FILE)
        try:
            table = pd.read_parquet(folder / TABLE_FILE)
        except (OSError, ArrowException, ValueError) as error:
            raise InputError(
                "result",
                f"{str(folder / TABLE_FILE)!r} cannot be read ({error}); run again",
            ) from None
        columns = {name: table[name].to_numpy(dtype=float) for name in table.columns}
        robots = {name: _own(columns, name, scenario) for name in scenario.all_robots}
        for name, own in robots.items():
            if missing := [key for key in _NEEDED if key not in own]:
                raise InputError(
                    "result",
                    f"{str(folder / TABLE_FILE)!r} has no {missing[0]} of {name}, as "
                    f"{SCENARIO_FILE} beside it would have; run again",
                )
        return cls(scenario, robots)

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) of the ticks, s."""
        return next(iter(self.robots.values()))["t"]


def _own(
    columns: Mapping[str, NDArray[np.float64]], name: str, scenario: Scenario
) -> Mapping[str, NDArray[np.float64]]:
    """The columns of one robot, as if there were no others."""
    if len(scenario.all_robots) == 1:
        return columns
    prefix = f"{name}."
    own = {
        key.removeprefix(prefix): values
        for key, values in columns.items()
        if key.startswith(prefix)
    }
    return {"t": columns["t"], **own} if "t" in columns else own
