"""Tables of named numbers."""

from __future__ import annotations

import re

import pytest

from analysis.reporting.fact_tables import fact_table, readable_name, row_table


def cells(table: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", table)
    return [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in rows]


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
    assert cells(fact_table(facts, skip=["margins.hidden"])) == [
        ["law", "active"],
        ["runs", "300"],
        ["covered", "no"],
        ["margins: delay (s)", "0.5"],
        ["none", "\u2013"],
    ]


def test_rows_of_mappings():
    rows: list[dict[str, object]] = [
        {"speed_m_s": 0.3, "kind": "sink"},
        {"speed_m_s": None, "kind": "saddle"},
    ]
    assert cells(row_table(rows)) == [
        ["speed (m/s)", "kind"],
        ["0.3", "sink"],
        ["\u2013", "saddle"],
    ]
    assert row_table([]) == ""
