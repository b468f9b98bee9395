"""Each run of docs/failures.md fails by the mechanism that the page says."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.comparison.mechanisms import failure_mechanisms
from analysis.runs.metrics import run_metrics
from diagrams import RunResult, load_scenario, simulate

pytestmark = pytest.mark.slow

PAGE = (Path(__file__).parents[2] / "docs" / "failures.md").read_text("utf-8")


def commands(section: str) -> list[str]:
    """The commands of a section, by its heading."""
    text = PAGE.partition(f"## {section}\n")[2].partition("\n## ")[0]
    blocks = re.findall(r"(?ms)^```sh\n(.*?)^```$", text)
    joined = "".join(blocks).replace("\\\n", " ")
    return [line.partition("#")[0].strip() for line in joined.splitlines()]


def run(command: str) -> RunResult:
    """What `phonotaxis simulate` would run."""
    program, verb, scenario, *words = shlex.split(command)
    assert (program, verb) == ("phonotaxis", "simulate")
    fields = {"--law": "law=", "--velocity-term": "repulsion.velocity_term="}
    overrides = [
        fields.get(option, "") + value
        for option, value in zip(words[::2], words[1::2], strict=True)
    ]
    return simulate(load_scenario(scenario, overrides))


def mechanism(result: RunResult, metrics: dict[str, Any]) -> Any:
    row = pd.DataFrame([{"cause": result.cause, **metrics}])
    columns = {"contact_warning_s": float, "contact_unseen_s": float}
    return failure_mechanisms(row.astype(columns)).iloc[0]


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        ("Out of sight beside the bar", "out of sight"),
        ("Never heard", "never heard"),
        ("Heard late", "heard late"),
        ("Jam", "jam"),
        ("Swings", "swings"),
        ("Held off", "held off"),
        ("The vanishing push", "pushed too little"),
    ],
)
def test_the_first_run_of_a_section_fails_so(section, expected):
    result = run(commands(section)[0])
    assert mechanism(result, run_metrics(result)) == expected


def test_the_active_push_falls_on_the_way_to_contact():
    """And that of the conventional law grows, to no avail."""
    active, conventional = (run(command) for command in commands("The vanishing push"))
    for result, grows in ((active, False), (conventional, True)):
        push = np.hypot(result.columns["repulsion_x"], result.columns["repulsion_y"])
        assert (push[-1] > push[-8]) == grows


def test_the_printed_velocity_term_drives_the_robot():
    """Net work of the push, which brakes with `closing`."""
    printed, closing = (run(command) for command in commands("Rectified damping"))
    work = [run_metrics(result)["push_work_j"] or 0.0 for result in (printed, closing)]
    assert work[0] > 0.5
    assert work[1] < 0.0
    assert closing.simulated_s < printed.simulated_s
