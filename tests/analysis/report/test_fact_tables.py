"""Tables of named numbers."""

from __future__ import annotations

import pytest

from analysis.report.fact_tables import fact_table, readable_name


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("top_kinetic_energy_j", "top kinetic energy (J)"),
        ("damping_n_s_m", "damping (N s/m)"),
        ("speed_m_s", "speed (m/s)"),
        ("natural_frequency_rad_s", "natural frequency (rad/s)"),
        ("certified_share", "certified share"),
    ],
)
def test_units_are_read_off_names(name, text):
    assert readable_name(name) == text


def test_facts_of_groups_stand_under_their_group():
    facts = {
        "law": "active",
        "runs": 300,
        "covered": False,
        "margins": {"delay_s": 0.5, "hidden": 1.0},
        "grid": list(range(1000)),
        "rows": [{"a": 1}],
        "none": None,
    }
    assert list(map(list, fact_table(facts, skip=["margins.hidden"]).rows)) == [
        ["law", "active"],
        ["runs", 300],
        ["covered", "no"],
        ["margins: delay (s)", 0.5],
        ["none", None],
    ]
