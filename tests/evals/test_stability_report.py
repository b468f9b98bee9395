"""The whole report of one law: what others rely on, and what it says."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

import phonotaxis
from diagrams import load_scenario

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def report(made_once) -> Path:
    def fill(folder: Path) -> None:
        words = ["stability", "obstacle_free", "--law", "conventional", "--json"]
        assert phonotaxis.main([*words, "--out", str(folder / "out")]) == 0

    return made_once("stability_of_conventional", fill) / "out"


@pytest.fixture(scope="module")
def document(report: Path) -> dict[str, Any]:
    return json.loads((report / "summary.json").read_text())


def test_keys_that_others_rely_on(document):
    point = document["equilibria"]["points"][0]
    assert {"position_W", "kind", "eigenvalues"} <= set(point)
    assert np.shape(point["eigenvalues"])[1] == 2
    for loop in ("target_loop", "implemented_loop"):
        assert {
            "poles", "damping_ratio", "natural_frequency_rad_s", "phase_margin_deg",
            "delay_margin_s", "disk_margin",
        } <= set(document["margins"][loop])  # fmt: skip
    assert document["certified_starts"]["certificate"]["kind"] == "energy"
    verdicts = document["verdicts"]
    assert {"name", "value", "threshold", "verdict"} <= set(verdicts[0])
    assert len({row["name"] for row in verdicts}) == len(verdicts)


def test_ideal_target_loop_is_the_closed_form(document):
    # M s^2 + D s + K = 0 and L = K / (M s^2 + D s) with 3.94, 1 and 2.
    loop = document["margins"]["target_loop"]
    assert loop["poles"][0] == pytest.approx([-0.1269036, 0.7010775], rel=1e-6)
    assert loop["damping_ratio"] == pytest.approx(0.17812, rel=1e-4)
    assert loop["phase_margin_deg"] == pytest.approx(20.19, abs=0.005)
    assert loop["delay_margin_s"] == pytest.approx(0.5105, abs=5e-5)


def test_nothing_failed_and_the_printed_gains_do_not_pass(document):
    assert not [key for key, part in document.items() if "problem" in str(part)[:12]]
    verdicts = {row["name"]: row["verdict"] for row in document["verdicts"]}
    assert verdicts["growth at rest"] == "pass"
    assert verdicts["damping ratio at rest"] == "fail"
    assert verdicts["collisions from certified starts"] == "pass"


def test_margin_verdicts_are_the_least_of_every_cut_both_ways(document):
    """From the document's own margins: null is a margin without end."""
    loops = document["margins"]["implemented_loop"]["margins"].values()
    verdicts = {row["name"]: row["value"] for row in document["verdicts"]}
    directions = [
        20.0 * abs(np.log10(loop[name]))
        for loop in loops
        for name in ("gain_increase_margin", "gain_reduction_margin")
        if loop[name]
    ]
    assert verdicts["least gain margin"] == pytest.approx(min(directions))
    turns = [
        loop[name]
        for loop in loops
        for name in ("phase_lag_margin_deg", "phase_lead_margin_deg")
    ]
    assert verdicts["least phase margin"] == pytest.approx(min(turns))
    balanced = [d["alpha"] for loop in loops for d in loop["disks"] if d["skew"] == 0.0]
    assert verdicts["least disk margin"] == pytest.approx(min(balanced))
    peaks = [loop["sensitivity_peak"] for loop in loops]
    assert verdicts["largest sensitivity peak"] == pytest.approx(max(peaks))
    delays = [row["delay_s"] for row in document["delay_margins"]["margins"]]
    assert len(delays) == 2
    assert verdicts["least delay margin"] == pytest.approx(min(delays))
    largest = {row["hold"]: row["largest"] for row in document["burst_cycle"]["cycles"]}
    assert verdicts["deviation remaining after a burst cycle"] == pytest.approx(
        largest["motion"]
    )


def test_page_holds_everything_and_loads_nothing(report):
    page = (report / "report.html").read_text()
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)
    assert not re.findall(r'(?:src|href)="(?!#|data:)', page)
    assert not re.findall(r"url\((?!#)|@import", page)
    # Its one script lets keyboards scroll what is too wide, and loads nothing.
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert page.count("<script") == 1
    assert not re.findall(r"fetch|import|XMLHttp|https?:", script)
    assert page.count("<figure>") > 8
    assert (
        "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower().split()
    )


def test_exported_models_have_the_poles_of_the_document(report, document):
    models = loadmat(report / "models.mat", simplify_cells=True)
    A = models["conventional_closed_loop_continuous"]["A"]
    expected = document["linear_models"]["continuous"]["poles"]
    found = np.linalg.eigvals(A)
    for re_part, im_part in expected:
        assert np.abs(found - complex(re_part, im_part)).min() < 1e-9
    assert models["conventional_closed_loop"]["Ts"] == 0.025
    assert len(models["conventional_closed_loop"]["StateName"]) == len(
        models["conventional_closed_loop"]["A"]
    )


def test_effective_scenario_can_be_analyzed_again(report):
    assert load_scenario(report / "scenario.yaml").only.law == "conventional"
